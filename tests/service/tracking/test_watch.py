"""Alarms name the cause, are rare while the model is right, and wait for no good moment."""

import numpy as np
import pytest
from tests.service.tracking.slides import BANDS, PAPER, slide, speeds

from frictus_service.calibration.coordinates import Prior
from frictus_service.tracking import watch as watch_module
from frictus_service.tracking.law_estimate import Batch, LawEstimate, advanced, updated
from frictus_service.tracking.watch import ALARM, BEGIN_BATCHES, CAUSES, TOLERATED, Watch

Session = tuple[Watch, int | None]


def session(rng: np.random.Generator, true: list[np.ndarray]) -> Session:
    """Return the watch over PAPER's law after batches of true laws, and the first alarm's."""
    watch, estimate, alarm = Watch.begin(), LawEstimate.begin(Prior.weak(), BANDS), None
    for number, at in enumerate(true):
        batch = Batch.of(slide(rng, at, speeds(rng)), BANDS)
        known = advanced(estimate, 0.5, new_contact=False)
        if known.updates:
            watch = watch.seen(batch, PAPER, known)
        if alarm is None and watch.alarms:
            alarm = number
        estimate, _ = updated(known, batch)
    return watch, alarm


@pytest.mark.parametrize(
    ("off", "cause"),
    [
        ([0.0, 0.0, 0.3, 0.0], "gain"),
        ([0.0, 0.0, -0.4, 0.0], "gain"),
        ([0.7, 0.7, 0.0, 0.0], "cutoff"),
        ([-0.5, -0.5, 0.0, 0.0], "cutoff"),
        ([0.0, 0.0, 0.0, 60e-6], "delay"),
    ],
)
def test_a_wrong_model_is_named_within_six_seconds(
    off: list[float], cause: str, rng: np.random.Generator
) -> None:
    watch, alarm = session(rng, [PAPER + np.array(off)] * 12)
    assert watch.alarms == (cause,)
    assert alarm is not None


def test_errors_within_what_is_tolerated_raise_no_alarm(rng: np.random.Generator) -> None:
    for _ in range(3):
        size = rng.uniform(-0.8, 0.8, 3) * TOLERATED
        at = PAPER + np.array([size[1], size[1], size[0], size[2]])
        watch, alarm = session(rng, [at] * 30)
        assert alarm is None
        assert np.all(watch.log_evidence < ALARM)


def test_a_change_late_in_a_session_is_found(rng: np.random.Generator) -> None:
    changed = PAPER + np.array([0.7, 0.7, 0.0, 0.0])
    watch, alarm = session(rng, [PAPER] * 30 + [changed] * 30)
    assert "cutoff" in watch.alarms
    assert alarm is not None
    assert 30 <= alarm


def test_its_memory_is_bounded(
    rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(watch_module, "MOST", 3)
    batch = Batch.of(slide(rng, PAPER, [50.0, 60.0]), BANDS)
    estimate, _ = updated(LawEstimate.begin(Prior.weak(), BANDS), batch)
    watch = Watch.begin()
    for _ in range(BEGIN_BATCHES * 5):
        watch = watch.seen(batch, PAPER, estimate)
    assert watch.log_share.shape == (3,)
    assert watch.log_evidence.shape == (len(CAUSES),)
    # All shares that will ever be given sum to one at most.
    assert np.exp(watch.log_share).sum() <= 1.0
