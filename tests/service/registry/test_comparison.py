"""Comparison of two models, against what can be worked out by hand; and the MATLAB file."""

import io
import json
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import loadmat

from frictus.model import Covariance, Effect, FirstOrderSpeedLaw, MassSpringDamper, Model
from frictus_service.errors import ComparisonError
from frictus_service.registry.comparison import compare
from frictus_service.registry.documents import Published, to_mat
from frictus_service.registry.store import Registry

MakeModel = Callable[..., Model]


@pytest.fixture
def publish(tmp_path: Path) -> Iterator[Callable[[Model], Published]]:
    with Registry(f"sqlite:///{tmp_path / 'registry.db'}") as registry:
        yield lambda model: registry.publish(model, "a", by="ann")


Publish = Callable[[Model], Published]


def test_a_model_does_not_differ_from_itself(publish: Publish, model: MakeModel) -> None:
    one = publish(model())
    found = compare(one, one)
    assert not found.provenance
    for difference in [*found.parameters.values(), *found.cutoff_hz]:
        assert difference.difference == 0.0
    assert found.parameters["gain_n"].z == 0.0


def test_differences_and_their_intervals(publish: Publish, model: MakeModel) -> None:
    a = publish(model(0.4))
    law = FirstOrderSpeedLaw(gain_n=0.43, cutoff_0_hz=380.0, slope_hz_per_mm_s=13.0)
    told = {**model().provenance, "seed": 8, "note": "again"}
    b = publish(model(base=law, provenance=told, skew_s=1e-4))
    found = compare(a, b)
    gain = found.parameters["gain_n"]
    error = math.sqrt(2 * 1e-4)
    assert gain.difference == pytest.approx(0.03)
    assert gain.relative == pytest.approx(0.075)
    assert gain.standard_error == pytest.approx(error)
    assert gain.z == pytest.approx(0.03 / error)
    assert gain.ci95 == pytest.approx((0.03 - 1.96 * error, 0.03 + 1.96 * error), rel=1e-3)
    assert found.parameters["skew_s"].difference == pytest.approx(1e-4)
    assert found.parameters["skew_s"].standard_error is None  # not in the covariance
    assert found.provenance == {"seed": (7, 8), "note": (None, "again")}
    for cutoff in found.cutoff_hz:
        speed = cutoff.speed_mm_s
        variance = 25.0 - 2 * 0.3 * speed + 0.01 * speed**2
        assert cutoff.a == pytest.approx(400.0 + 12.0 * speed)
        assert cutoff.difference == pytest.approx(-20.0 + speed)
        assert cutoff.standard_error == pytest.approx(math.sqrt(2 * variance))
    assert [c.speed_mm_s for c in found.cutoff_hz] == [20.0, 40.0, 60.0, 80.0, 100.0]
    assert compare(b, a).parameters["gain_n"].z == pytest.approx(-(gain.z or 0.0))


def test_interval_covers_draws(
    publish: Publish, model: MakeModel, rng: np.random.Generator
) -> None:
    """Two draws from one truth differ within the interval in 95 % of cases."""
    spread = np.array([[1e-4, 1e-3, 0.0], [1e-3, 25.0, -0.3], [0.0, -0.3, 0.01]])
    names = ["gain_n", "cutoff_0_hz", "slope_hz_per_mm_s"]
    carried = Covariance(parameters=names, matrix=spread.tolist())
    frame = publish(model(covariance=carried))
    inside = []
    for draws in rng.multivariate_normal([0.4, 400.0, 12.0], spread, (400, 2)):
        laws = [FirstOrderSpeedLaw(**dict(zip(names, draw, strict=True))) for draw in draws]
        a, b = (
            frame.model_copy(update={"model": model(base=law, covariance=carried)})
            for law in laws
        )
        ci95 = compare(a, b).cutoff_hz[4].ci95
        assert ci95 is not None
        inside.append(ci95[0] <= 0.0 <= ci95[1])
    assert 0.89 < np.mean(inside) < 0.9925  # of 400: one in a million outside, at each end


def test_without_covariance_there_is_no_interval(publish: Publish, model: MakeModel) -> None:
    found = compare(publish(model()), publish(model(0.5, covariance=None)))
    assert found.parameters["gain_n"].standard_error is None
    assert found.parameters["gain_n"].difference == pytest.approx(0.1)
    assert all(cutoff.z is None for cutoff in found.cutoff_hz)


def test_validity_and_effects(publish: Publish, model: MakeModel) -> None:
    effects = [Effect(id="x", parameters={"p": 1.0}), Effect(id="y"), Effect(id="z")]
    other = [Effect(id="x", parameters={"p": 2.0}), Effect(id="y"), Effect(id="w")]
    a = publish(model(effects=effects, validity={"speed_mm_s": (30.0, 90.0)}))
    b = publish(model(effects=other))
    found = compare(a, b)
    assert found.effects == {
        "w": "b",
        "x": "both, with other parameters",
        "y": "both",
        "z": "a",
    }
    within = {c.speed_mm_s: c.within_validity for c in found.cutoff_hz}
    assert within[20.0] == (False, True)
    assert within[40.0] == (True, True)
    assert within[100.0] == (False, True)


def mobility(model: MakeModel) -> Model:
    law = MassSpringDamper(mass_kg=1e-4, damping_n_s_m=0.0, stiffness_n_m=800.0)
    return model(response="mobility", base=law, covariance=None)


def test_mobility_is_compared_with_mobility_only(publish: Publish, model: MakeModel) -> None:
    skin = publish(mobility(model))
    found = compare(skin, skin)
    assert set(found.parameters) == {"mass_kg", "damping_n_s_m", "stiffness_n_m", "skew_s"}
    assert found.parameters["damping_n_s_m"].relative is None
    assert found.cutoff_hz == []
    with pytest.raises(ComparisonError, match="mobility"):
        compare(skin, publish(model()))


def read_mat(content: bytes) -> dict[str, Any]:
    file: Any = io.BytesIO(content)  # the types of some versions of scipy know paths alone
    read: dict[str, Any] = loadmat(file, simplify_cells=True)
    return read


def test_matlab_file_says_what_the_document_says(publish: Publish, model: MakeModel) -> None:
    one = publish(model(skew_s=1e-4, extra_of_a_newer_writer=[1, 2]))
    read = read_mat(to_mat(one))
    assert (read["name"], read["version"], read["law"]) == ("a", 1, "first_order_speed")
    assert read["parameters"] == {
        "gain_n": 0.4,
        "cutoff_0_hz": 400.0,
        "slope_hz_per_mm_s": 12.0,
    }
    np.testing.assert_array_equal(read["validity"]["speed_mm_s"], [20.0, 100.0])
    assert one.model.covariance is not None
    np.testing.assert_array_equal(read["covariance"], one.model.covariance.matrix)
    assert list(read["covariance_parameters"]) == one.model.covariance.parameters
    assert read["skew_s"] == 1e-4
    assert json.loads(read["provenance"]) == one.model.provenance
    assert Model.model_validate_json(read["document"]) == one.model
    assert read["etag"] == one.etag
    skin = read_mat(to_mat(publish(mobility(model))))
    assert skin["parameters"]["stiffness_n_m"] == 800.0
    assert skin["covariance"].size == 0
