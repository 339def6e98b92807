"""The texture library over REST."""

import errno
import io
import json
import wave
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient
from tests.clients.effect_files.hmpg_writer import hmpg
from tests.clients.effect_files.made import (
    ahap,
    band,
    basis,
    continuous,
    event,
    haptic,
    hjif,
    keyframes,
)

from frictus_service import library as library_module

SINE = {"kind": "spectrum", "components": [{"amplitude_n": 0.1, "cycles_per_mm": 2.0}]}
SLOPE = {"kind": "slope", "peak_hz": 200.0, "low_order": 1, "high_order": 2, "rms_n": 0.1}
NEW = {"If-None-Match": "*"}


@pytest.fixture(autouse=True)
def shipped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """One shipped texture; set before the app is built."""
    folder = tmp_path / "shipped"
    folder.mkdir()
    (folder / "felt.json").write_text(json.dumps(SLOPE))
    monkeypatch.setattr(library_module, "SHIPPED", folder)
    return folder


def test_life_of_a_texture(api: TestClient, tmp_path: Path) -> None:
    made = api.put("/v1/textures/sine", json=SINE, headers=NEW)
    assert made.status_code == 201
    assert made.headers["location"] == "/v1/textures/sine"
    etag = made.headers["etag"]
    got = api.get("/v1/textures/sine")
    assert got.headers["etag"] == etag
    assert got.json()["components"][0]["cycles_per_mm"] == 2.0
    assert api.get("/v1/textures/sine", headers={"If-None-Match": etag}).status_code == 304

    assert api.put("/v1/textures/sine", json=SLOPE, headers=NEW).status_code == 412
    assert api.put("/v1/textures/sine", json=SLOPE).status_code == 428
    assert api.put("/v1/textures/sine", json=SLOPE, headers={"If-Match": '"old"'}).status_code
    replaced = api.put("/v1/textures/sine", json=SLOPE, headers={"If-Match": etag})
    assert replaced.status_code == 200
    assert replaced.json()["kind"] == "slope"
    late = api.put("/v1/textures/sine", json=SINE, headers={"If-Match": etag})
    assert late.status_code == 412

    assert api.delete("/v1/textures/sine").status_code == 428
    assert api.delete("/v1/textures/sine", headers={"If-Match": etag}).status_code == 412
    new = {"If-Match": replaced.headers["etag"]}
    assert api.delete("/v1/textures/sine", headers=new).status_code == 204
    assert api.get("/v1/textures/sine").status_code == 404
    assert api.delete("/v1/textures/sine", headers=new).status_code == 404
    assert api.put("/v1/textures/sine", json=SINE, headers=new).status_code == 412
    assert list((tmp_path / "textures").iterdir()) == []  # no temporary file is left


def test_what_is_got_can_be_put(api: TestClient) -> None:
    etag = api.put("/v1/textures/sine", json=SINE, headers=NEW).headers["etag"]
    document = api.get("/v1/textures/sine").json()
    again = api.put("/v1/textures/sine", json=document, headers={"If-Match": etag})
    assert again.headers["etag"] == etag


def test_shipped_textures_are_read_only(api: TestClient) -> None:
    got = api.get("/v1/textures/felt")
    assert got.json()["kind"] == "slope"
    for answer in (
        api.put("/v1/textures/felt", json=SINE, headers={"If-Match": got.headers["etag"]}),
        api.put("/v1/textures/felt", json=SINE, headers=NEW),
        api.delete("/v1/textures/felt", headers={"If-Match": "*"}),
    ):
        assert answer.status_code == 409
        assert answer.json()["code"] == "read_only"


def test_pages_cover_every_name_once(api: TestClient) -> None:
    names = [f"t{number:02d}" for number in range(7)]
    for name in names:
        assert api.put(f"/v1/textures/{name}", json=SINE, headers=NEW).status_code == 201
    seen: list[str] = []
    after: str | None = ""
    while after is not None:
        page = api.get("/v1/textures", params={"after": after, "limit": 3}).json()
        assert len(page["textures"]) <= 3
        seen += [texture["name"] for texture in page["textures"]]
        after = page["next"]
    assert seen == ["felt", *names]
    assert api.get("/v1/textures", params={"limit": 0}).status_code == 422


def test_damaged_file_is_named_and_can_be_replaced(api: TestClient, tmp_path: Path) -> None:
    api.put("/v1/textures/sine", json=SINE, headers=NEW)
    (tmp_path / "textures" / "sine.json").write_text('{"kind": "spectrum", "components"')
    listed = api.get("/v1/textures").json()["textures"]
    assert "sine.json" in next(t for t in listed if t["name"] == "sine")["damaged"]
    answer = api.get("/v1/textures/sine")
    assert (answer.status_code, answer.json()["code"]) == (500, "damaged_texture")
    blind = {"If-Match": '"x"'}
    assert api.put("/v1/textures/sine", json=SINE, headers=blind).status_code == 412
    assert api.put("/v1/textures/sine", json=SINE, headers={"If-Match": "*"}).status_code == 200
    assert api.get("/v1/textures/sine").status_code == 200


@pytest.mark.parametrize(
    "name", ["Sine", "a b", "..", "%2e%2e%2fx", "a.json", "nul", "com1", "x" * 65, "-a", "ä"]
)
def test_bad_names_are_refused(api: TestClient, tmp_path: Path, name: str) -> None:
    for answer in (
        api.put(f"/v1/textures/{name}", json=SINE, headers=NEW),
        api.get(f"/v1/textures/{name}"),
        api.delete(f"/v1/textures/{name}", headers={"If-Match": "*"}),
    ):
        assert answer.status_code in (404, 405, 422)
        assert answer.headers["content-type"] == "application/problem+json"
    assert not (tmp_path / "textures").exists()


@pytest.mark.parametrize(
    ("body", "where"),
    [
        (
            '{"kind":"spectrum","components":[{"amplitude_n":NaN,"hz":1}]}',
            ["body", "components", 0, "amplitude_n"],
        ),
        (
            '{"kind":"spectrum","components":[{"amplitude_n":1,"hz":1e999}]}',
            ["body", "components", 0, "hz"],
        ),
        ('{"kind":"profile","period_mm":-Infinity,"friction_n":[0,1]}', ["body", "period_mm"]),
        (
            '{"kind":"spectrum","components":[{"amplitude_n":1,"hz":-5}]}',
            ["body", "spectrum", "components", 0, "hz"],
        ),
        (
            '{"kind":"spectrum","components":[{"amplitude_n":"1","hz":5}]}',
            ["body", "spectrum", "components", 0, "amplitude_n"],
        ),
        (
            '{"kind":"spectrum","components":[{"amplitude_n":1,"hz":5,"khz":1}]}',
            ["body", "spectrum", "components", 0, "khz"],
        ),
        ('{"kind":"spectrum","components":[]}', ["body", "spectrum", "components"]),
        ('{"kind":"unheard"}', ["body"]),
    ],
)
def test_faults_are_located(api: TestClient, body: str, where: list[Any]) -> None:
    answer = api.put(
        "/v1/textures/bad", content=body, headers={**NEW, "Content-Type": "application/json"}
    )
    assert answer.status_code == 422
    assert where in [fault["where"] for fault in answer.json()["errors"]]
    assert api.get("/v1/textures/bad").status_code == 404


def test_other_types_are_refused(api: TestClient) -> None:
    headers = {**NEW, "Content-Type": "application/xml"}
    answer = api.put("/v1/textures/x", content=b"<x/>", headers=headers)
    assert answer.status_code == 415
    assert "application/json" in answer.headers["accept"]
    for kind in ("audio/wav", "text/csv"):
        headers = {**NEW, "Content-Type": kind}
        answer = api.put("/v1/textures/x", content=b"", headers=headers)
        assert answer.status_code == 422
        assert answer.json()["errors"][0]["where"] == ["query", "recording_speed_mm_s"]


def test_recordings(api: TestClient, rng: np.random.Generator) -> None:
    samples = rng.normal(0.0, 0.05, 400)
    csv = "\n".join(f"{value:.9g}" for value in samples).encode()
    query = {"recording_speed_mm_s": 40.0, "sample_rate_hz": 20_000.0}
    headers = {**NEW, "Content-Type": "text/csv; charset=utf-8"}
    made = api.put("/v1/textures/rec", content=csv, params=query, headers=headers)
    assert made.status_code == 201, made.json()
    got = api.get("/v1/textures/rec").json()
    assert got["period_mm"] == pytest.approx(40.0 * 400 / 20_000.0)
    np.testing.assert_allclose(got["friction_n"], samples - samples.mean(), atol=1e-8)

    buffer = io.BytesIO()
    with wave.open(buffer, "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(20_000)
        file.writeframes((samples / samples.max() * 30_000).astype("<i2").tobytes())
    made = api.put(
        "/v1/textures/wav",
        content=buffer.getvalue(),
        params={"recording_speed_mm_s": 40.0, "scale_n": 0.2},
        headers={**NEW, "Content-Type": "audio/wav"},
    )
    assert made.status_code == 201, made.json()
    assert made.json()["kind"] == "profile"


LONG = keyframes((0, 0.5, 80), (12_000, 0.5, 80))


@pytest.mark.parametrize(
    ("kind", "content"),
    [
        ("haptics/x-ahap", ahap(continuous(0.0, 12.0), event("AudioCustom", 0.0))),
        ("haptics/x-haptic", haptic([(0.0, 0.5), (12.0, 0.5)])),
        ("haptics/hjif", hjif(band("VectorialWave", basis(0, LONG)))),
        ("haptics/hmpg", hmpg(json.loads(hjif(band("VectorialWave", basis(0, LONG)))))),
    ],
)
def test_effects(api: TestClient, kind: str, content: str | bytes) -> None:
    headers = {**NEW, "Content-Type": kind}
    refused = api.put("/v1/textures/long", content=content, headers=headers)
    assert refused.status_code == 422
    assert "give a part of it" in refused.json()["detail"]
    query = {"scale_n": 0.2, "part_from_s": 1.0}
    half = api.put("/v1/textures/half", content=content, params=query, headers=headers)
    assert half.json()["errors"][0]["where"] == ["query", "part_to_s"]
    query |= {"part_to_s": 3.0}
    made = api.put("/v1/textures/buzz", content=content, params=query, headers=headers)
    assert made.status_code == 201, made.json()
    if kind == "haptics/x-ahap":
        assert made.json()["notes"] == ["AudioCustom: left out, 1 of them"]
    assert api.get("/v1/textures/buzz").json()["period_s"] == pytest.approx(2.0)
    query = {"scale_n": 0.2, "recording_speed_mm_s": 20.0}
    made = api.put("/v1/textures/laid", content=content, params=query, headers=headers)
    assert made.status_code == 201, made.json()
    assert api.get("/v1/textures/laid").json()["period_mm"] == pytest.approx(240.0)


@pytest.mark.parametrize(
    ("kind", "content", "query"),
    [
        ("text/csv", b"1\n2\nnan\n", {"sample_rate_hz": 100.0}),
        ("text/csv", b"1\n2\n3\n", {}),
        ("text/csv", b"1\n2\n3\n", {"sample_rate_hz": "nan"}),
        ("text/csv", b"1\n2\n3\n", {"sample_rate_hz": -1.0}),
        ("text/csv", b"1\n2\n3\n", {"sample_rate_hz": 100.0, "scale_n": "1e999"}),
        ("text/csv", b"\xff\xfe\x00", {}),
        ("audio/wav", b"RIFFxxxx", {}),
        ("audio/wav", b"", {}),
        ("haptics/hjif", b"{}", {}),
        ("haptics/hmpg", b"{}", {}),
        ("haptics/x-ahap", b"\xff", {}),
        ("haptics/x-haptic", b"[" * 9_999, {}),
    ],
)
def test_bad_recordings_say_what_is_wrong(
    api: TestClient, kind: str, content: bytes, query: dict[str, Any]
) -> None:
    answer = api.put(
        "/v1/textures/bad",
        content=content,
        params={"recording_speed_mm_s": 40.0, **query},
        headers={**NEW, "Content-Type": kind},
    )
    assert answer.status_code == 422
    assert answer.json()["detail"]


def test_a_refused_recording_is_named_as_its_texture(api: TestClient) -> None:
    headers = {**NEW, "Content-Type": "text/csv"}
    query = {"recording_speed_mm_s": 40.0, "sample_rate_hz": 100.0}
    answer = api.put("/v1/textures/torn", content=b"1\nrough\n", params=query, headers=headers)
    assert "torn.csv" in answer.json()["detail"]
    answer = api.put("/v1/textures/nul", content=b"1\n2\n3\n", params=query, headers=headers)
    assert answer.status_code == 422
    assert "texture name 'nul'" in answer.json()["detail"]


def test_a_folder_that_may_not_be_written_is_said(
    api: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    def closed(path: Path, content: bytes) -> None:
        raise PermissionError(errno.EACCES, "Permission denied", str(path))

    monkeypatch.setattr(library_module, "replace_file", closed)
    answer = api.put("/v1/textures/sine", json=SINE, headers=NEW)
    assert (answer.status_code, answer.json()["code"]) == (500, "no_access")
    assert "sine.json (Permission denied)" in answer.json()["detail"]


def test_a_disk_that_takes_nothing_is_said(
    api: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(path: Path, content: bytes) -> None:
        raise OSError(errno.ENOSPC, "No space left on device", str(path))

    monkeypatch.setattr(library_module, "replace_file", full)
    answer = api.put("/v1/textures/sine", json=SINE, headers=NEW)
    assert (answer.status_code, answer.json()["code"]) == (507, "not_stored")
    assert "No space left" in answer.json()["detail"]
    assert api.get("/v1/textures/sine").status_code == 404


def test_a_table_in_mn_needs_its_scale(api: TestClient) -> None:
    table = "time [s],F [mN]\n0,10\n0.001,30\n0.002,10\n0.003,30\n"
    headers = NEW | {"Content-Type": "text/csv"}
    path = "/v1/textures/swipe?recording_speed_mm_s=40"
    told = api.put(path, content=table, headers=headers)
    assert told.status_code == 422
    assert "'mN': give scale_n" in told.json()["detail"]
    assert api.put(f"{path}&scale_n=0.001", content=table, headers=headers).status_code == 201
