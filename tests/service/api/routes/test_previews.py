"""Previews of textures over REST."""

import numpy as np
import pytest
from fastapi.testclient import TestClient
from tests.service.api.conftest import TOKENS, FakeRig, Serve

from frictus.textures import Region, Scene, Spectrum
from frictus_hardware.physics.friction import FrictionLaw
from frictus_hardware.physics.screen import Screen
from frictus_service.fidelity.preview import CENTRES_HZ
from frictus_service.synthesis.scene import compile_scene


def spectrum(*components: dict[str, float]) -> dict[str, object]:
    return {"kind": "spectrum", "components": list(components)}


def test_what_is_asked_for_stands_in_place_and_band(
    api: TestClient, rng: np.random.Generator
) -> None:
    amplitude, hz = rng.uniform(0.01, 0.1, size=2), CENTRES_HZ[[4, 11]]
    phase = rng.uniform(0.0, 6.0, size=2)
    speed_mm_s = rng.uniform(20.0, 100.0)
    turns = hz[0] / speed_mm_s
    texture = spectrum(
        {"amplitude_n": amplitude[0], "cycles_per_mm": turns, "phase_rad": phase[0]},
        {"amplitude_n": amplitude[1], "hz": float(np.round(hz[1], 1)), "phase_rad": phase[1]},
    )
    answer = api.post("/v1/preview", json=texture, params={"speed_mm_s": speed_mm_s})
    assert answer.status_code == 200, answer.json()
    found = answer.json()
    assert found["applied"] is None
    expected = np.zeros(16)
    expected[[4, 11]] = amplitude / np.sqrt(2.0)
    np.testing.assert_allclose(found["rms_n"], expected, rtol=1e-9)
    way, time = found["courses"]
    assert (way["per"], time["per"]) == ("mm", "s")
    at = way["step"] * np.arange(len(way["friction_n"]))
    course = amplitude[0] * np.cos(2.0 * np.pi * turns * at + phase[0])
    np.testing.assert_allclose(way["friction_n"], course, atol=1e-12)


def test_gain_is_what_the_rig_would_apply_and_nothing_changes(
    api: TestClient, rig: FakeRig, rng: np.random.Generator
) -> None:
    turns = rng.uniform(1.0, 5.0)
    texture = spectrum({"amplitude_n": 2.0, "cycles_per_mm": turns})
    found = api.post("/v1/preview", json=texture, params={"rig": rig.name}).json()
    screen = Screen(peak_v=75.0, size_mm=(100.0, 60.0))
    scene = Scene(regions=[Region(texture=Spectrum.model_validate(texture))])
    law = FrictionLaw(gain_n=0.39, cutoff_0_hz=385.68, slope_hz_per_mm_s=13.811)
    applied = compile_scene(scene, law, screen, 20_000.0).applied
    assert applied.scaled
    assert found["applied"] == applied.model_dump(mode="json")
    assert rig.calls == []


def test_map_is_an_image(api: TestClient, rig: FakeRig) -> None:
    pixel = (
        "iVBORw0KGgoAAAANSUhEUgAAAAIAAAACCAAAAABX3VL4AAAADklEQVR4nGNgqGdg+A8AAoUBfwzK0lYA"
        "AAAASUVORK5CYII="
    )
    texture = {"kind": "map", "image_png": pixel, "white_n": 0.1}
    found = api.post("/v1/preview", json=texture).json()
    assert (found["courses"], found["rms_n"]) == ([], None)


@pytest.mark.parametrize(
    ("texture", "query", "status", "code"),
    [
        (spectrum({"amplitude_n": 1.0, "hz": 5_000.0}), {"rig": ""}, 422, "not_feasible"),
        (spectrum({"amplitude_n": 1.0, "hz": 50.0}), {"rig": "absent"}, 404, "no_rig"),
        (spectrum({"amplitude_n": -1.0, "hz": 50.0}), {}, 422, "bad_request"),
        (spectrum({"amplitude_n": 1.0, "hz": 50.0}), {"speed_mm_s": 0}, 422, "bad_request"),
        (
            {"kind": "profile", "friction_n": [1.0, 1.0], "period_mm": 1.0},
            {},
            422,
            "not_feasible",
        ),
    ],
    ids=["beyond the band", "no rig", "negative", "no speed", "constant"],
)
def test_what_cannot_be_is_refused_with_the_reason(
    api: TestClient,
    rig: FakeRig,
    texture: dict[str, object],
    query: dict[str, str],
    status: int,
    code: str,
) -> None:
    params = {name: value or rig.name for name, value in query.items()}
    if "speed_mm_s" in query:
        params = dict(query)
    answer = api.post("/v1/preview", json=texture, params=params)
    assert (answer.status_code, answer.json()["code"]) == (status, code)


def test_looking_needs_no_more_than_read(serve: Serve) -> None:
    client = serve(tokens=True)
    texture = spectrum({"amplitude_n": 1.0, "hz": 50.0})
    for scope, status in (("read", 200), ("render", 403)):
        headers = {"Authorization": f"Bearer {TOKENS[scope]}"}
        answer = client.post("/v1/preview", json=texture, headers=headers)
        assert answer.status_code == status
