"""What is said at the end: why an interval grew, and how the law meets unseen trials."""

import itertools
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from tests.rig_status import rig_status

from frictus.model import Validity
from frictus_service.calibration import conclusion
from frictus_service.calibration import run as run_module
from frictus_service.calibration.conclusion import WIDER, conclude, why_wider
from frictus_service.calibration.coordinates import Prior
from frictus_service.calibration.folder import CalibrationFolder
from frictus_service.calibration.job import CalibrationSpec, PaperProtocol, QuickProtocol
from frictus_service.calibration.posterior import Posterior, estimate
from frictus_service.calibration.precision import Variation, draw, paper_asks
from frictus_service.calibration.run import CalibrationRun
from frictus_service.errors import EstimateError

from .test_posterior import STEADY, asks_of, somebody

SPEEDS = np.array([20.0, 25.0, 30.0, 90.0, 95.0, 100.0])


def width(found: Posterior) -> float:
    return float(np.max(found.relative_width(SPEEDS)))


@pytest.mark.parametrize(
    ("before", "after"), [(None, 0.1), (0.1, None), (None, None), (0.1, 0.05), (0.1, 0.109)]
)
def test_what_did_not_grow_is_not_explained(before: float | None, after: float | None) -> None:
    assert why_wider(before, after) == ""


def test_an_interval_that_grows_is_told_in_figures() -> None:
    assert why_wider(0.08, 0.125).startswith("the interval grew from 8.0% to 12.5%: ")


@pytest.mark.long
def test_where_an_interval_grows_the_finger_is_judged_to_wander_more(
    rng: np.random.Generator,
) -> None:
    grown = 0
    for _ in range(8):
        trials = draw(rng, somebody(rng), asks_of(rng, 16), Variation())
        found = [estimate(trials[:n], Prior.weak()) for n in range(4, 17)]
        for before, after in itertools.pairwise(found):
            if width(after) > WIDER * width(before):
                grown += 1
                assert after.mixture.wandering > before.mixture.wandering
    assert grown > 0


@pytest.mark.parametrize("kind", ["paper", "quick"])
def test_unseen_trials_are_met_by_the_estimate_that_made_the_model(
    kind: str, rng: np.random.Generator, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each protocol has its own; of the other one's errors nothing may be said."""
    other = {"paper": "_by_prior", "quick": "_by_analysis"}[kind]

    def refused(*_: object) -> None:
        raise AssertionError(f"{other} has no part in the {kind} protocol")

    monkeypatch.setattr(conclusion, other, refused)
    trials = draw(rng, somebody(rng), paper_asks()[::5], STEADY)
    protocol = {"paper": PaperProtocol(), "quick": QuickProtocol()}[kind]
    spec = CalibrationSpec(rig="rig1", participant="p", protocol=protocol, seed=1)
    (tmp_path / "study.h5").write_bytes(b"hashed, and not read")
    result = conclude(spec, trials, (), (), tmp_path / "study.h5", ())
    held = result.details["diagnostics"]["held_out"]
    assert held["in_sample_db"] < held["held_out_db"] < held["placeholder_db"]


def test_trials_of_too_few_tones_say_what_is_missing(
    rng: np.random.Generator, tmp_path: Path
) -> None:
    asks = paper_asks()
    two = sorted({ask.tones_hz for ask in asks})[6:8]
    trials = draw(rng, somebody(rng), [ask for ask in asks if ask.tones_hz in two], STEADY)
    spec = CalibrationSpec(rig="rig1", participant="p", protocol=PaperProtocol(), seed=1)
    (tmp_path / "study.h5").write_bytes(b"hashed, and not read")
    with pytest.raises(EstimateError, match=r"no speed law\. No .* three tones") as caught:
        conclude(spec, trials, (), (), tmp_path / "study.h5", ())
    assert "people in general" not in str(caught.value)


def test_trials_that_give_no_law_say_which_sensor_lies_otherwise(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    spec = CalibrationSpec(rig="rig", participant="p", seed=1)
    status: Any = SimpleNamespace(screen_mm=(70.0, 35.0), screen_peak_v=75.0, simulated=True)
    run = CalibrationRun(
        spec, CalibrationFolder.open(tmp_path / "it", spec), status, None, lambda _: None
    )
    monkeypatch.setattr(CalibrationFolder, "merge", lambda *_: [])
    run._sensors = {"seconds": 20.0}, ("the force sensor lies the other way round: turn it",)
    with pytest.raises(EstimateError, match=r"none of 0 trials.*lies the other way round"):
        run.conclude()
    run._sensors = None, ("whether the sensors lie as configured is unknown",)
    with pytest.raises(EstimateError, match="none of 0 trials") as caught:
        run.conclude()
    assert "unknown" not in str(caught.value)


@pytest.mark.parametrize(("simulated", "learned_from"), [(True, 2), (False, 1)])
def test_a_real_rig_learns_nothing_from_simulated_participants(
    simulated: bool,
    learned_from: int,
    rng: np.random.Generator,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    earlier = [
        estimate(draw(rng, somebody(rng), paper_asks()[::5], STEADY), Prior.weak()).model(
            name, Validity(), {"simulated": virtual}
        )
        for name, virtual in (("ann", False), ("virtual", True))
    ]
    spec = CalibrationSpec(rig="rig1", participant="p", prior=tuple(earlier), seed=1)
    kept = CalibrationFolder.open(tmp_path / "it", spec)
    run = CalibrationRun(spec, kept, rig_status(simulated=simulated), None, lambda _: None)
    trials = draw(rng, somebody(rng), paper_asks()[::5], STEADY)
    monkeypatch.setattr(CalibrationFolder, "merge", lambda *_: [])
    monkeypatch.setattr(CalibrationRun, "_observations", lambda _: trials)
    monkeypatch.setattr(run_module, "linearity_of", lambda _: (None, ()))
    monkeypatch.setattr(
        run_module, "StudyReader", lambda _: nullcontext(SimpleNamespace(trials=()))
    )
    kept.study.write_bytes(b"hashed, and not read")
    result = run.conclude()
    assert result.model.provenance["earlier_models"] == learned_from
    assert result.model.provenance["simulated"] is simulated
    said = [note for note in result.notes if "simulated participants" in note]
    assert len(said) == 2 - learned_from
