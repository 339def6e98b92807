"""Copies and overlaps of samples are noticed; other recordings are not."""

from dataclasses import replace

import numpy as np

from frictus_service.discovery.one_recording.windows import SeenSamples
from frictus_service.study.trial import Trial, TrialInfo

RATE_HZ = 20_000.0


def trial(name: str, force_n: np.ndarray) -> Trial:
    info = TrialInfo(
        name, "P01", 1, 0, 60.0, 0.4, (), 0.0, RATE_HZ, "2026-01-05T10:00:00+00:00"
    )
    force = np.column_stack([force_n, np.zeros_like(force_n), np.full(force_n.shape, 0.4)])
    return Trial(info, None, force, None, None, np.zeros((0, 2)), np.zeros(0))


def quantised(rng: np.random.Generator, seconds: float = 2.0) -> np.ndarray:
    """Return noise in steps of a converter, about as coarse as it is large."""
    return np.round(rng.standard_normal(int(seconds * RATE_HZ)) / 0.5) * 1e-3


def test_another_recording_is_new(rng: np.random.Generator) -> None:
    seen = SeenSamples()
    assert not seen.repeated(trial("A", quantised(rng)))
    assert not seen.repeated(trial("B", quantised(rng)))


def test_a_copy_under_another_name_is_refused(rng: np.random.Generator) -> None:
    seen, force = SeenSamples(), quantised(rng)
    assert not seen.repeated(trial("A", force))
    told = seen.repeated(replace(trial("B", force)))
    assert "trial B holds 2 s of trial A" in told


def test_windows_that_overlap_are_refused_wherever_they_begin(rng: np.random.Generator) -> None:
    seen, force = SeenSamples(), quantised(rng, 4.0)
    start = int(rng.integers(20_000, 38_000))
    assert not seen.repeated(trial("A", force[:40_000]))
    assert "trial A" in seen.repeated(trial("B", force[start : start + 40_000]))


def test_windows_side_by_side_are_not(rng: np.random.Generator) -> None:
    seen, force = SeenSamples(), quantised(rng, 4.0)
    assert not seen.repeated(trial("A", force[:40_000]))
    assert not seen.repeated(trial("B", force[40_000:]))


def test_a_channel_that_rests_repeats_nothing(rng: np.random.Generator) -> None:
    seen = SeenSamples()
    resting = np.zeros(40_000)
    resting[:8_000] = quantised(rng, 0.4)
    assert not seen.repeated(trial("A", resting))
    resting[:8_000] = quantised(rng, 0.4)
    assert not seen.repeated(trial("B", resting))
    assert not seen.repeated(trial("C", np.zeros(10)))
