"""Where in a trial the finger is for how long, and which tones that is enough for."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from frictus_hardware.physics.schedule import REFERENCE_POSITION_MM
from frictus_service.discovery.plan.programme import PlannedTrial
from frictus_service.identification.observation.tones import Tones

TURN_S: Final = 0.08
"""Before and after a reversal, which no sweep contains."""
GOLDEN: Final = 0.618
"""Part of a cycle by which trials begin apart from each other: as evenly as can be."""
INSTANTS: Final = 400


@dataclass(frozen=True, slots=True)
class StrokeThird:
    """A third of a stroke in one direction, all of a trial's taken together.

    Attributes
    ----------
    trial : int
        Number of the trial.
    direction : int
        +1 left to right, -1 right to left.
    seconds : float
        Of one passage.
    position_mm : float
        Its middle.
    """

    trial: int
    direction: int
    seconds: float
    position_mm: float


def stretches_of(trials: Sequence[PlannedTrial], span_mm: float) -> list[StrokeThird]:
    """Return the stretches of trials in which fingers go back and forth.

    Parameters
    ----------
    trials : sequence of PlannedTrial
        In order.
    span_mm : float
        Of a stroke, about the middle of the screen.
    """
    return [
        stretch
        for number, trial in enumerate(trials)
        for stretch in _of_trial(number, trial, span_mm)
    ]


def _of_trial(number: int, trial: PlannedTrial, span_mm: float) -> list[StrokeThird]:
    cycle_s = 2.0 * span_mm / trial.speed_mm_s
    time = trial.seconds * (np.arange(INSTANTS) + 0.5) / INSTANTS
    half = np.mod(2.0 * (GOLDEN * number + time / cycle_s), 2.0)  # there, and back from 1 on
    into = np.mod(half, 1.0)
    steady = np.minimum(into, 1.0 - into) * cycle_s / 2.0 > TURN_S
    if not steady.any():
        return []
    way = np.minimum(half, 2.0 - half)
    low, high = way[steady].min(), way[steady].max()
    third = np.clip(3.0 * (way - low) / max(high - low, 1e-9), 0, 2).astype(np.int64)
    cell = np.where(steady, third + 3 * (half >= 1.0), 6)
    count = np.bincount(cell, minlength=7)
    middle = np.bincount(cell, way, minlength=7) / np.maximum(count, 1)
    once_s = (high - low) * cycle_s / 6.0
    return [
        StrokeThird(
            number,
            1 if each < 3 else -1,
            min(float(count[each]) * trial.seconds / INSTANTS, once_s),
            REFERENCE_POSITION_MM + span_mm * (float(middle[each]) - 0.5),
        )
        for each in range(6)
        if count[each]
    ]


def tones_in(
    trials: Sequence[PlannedTrial], stretches: Sequence[StrokeThird], sample_rate_hz: float
) -> list[tuple[int, float]]:
    """Return numbers of stretches with the tones that they are long enough for.

    Parameters
    ----------
    trials : sequence of PlannedTrial
        In order.
    stretches : sequence of StrokeThird
        Time in each third of the stroke.
    sample_rate_hz : float
        Samples per second of the device's clock.
    """
    least_s = [
        Tones(trial.tones_hz, sample_rate_hz).least_s if trial.tones_hz else np.inf
        for trial in trials
    ]
    return [
        (number, tone_hz)
        for number, stretch in enumerate(stretches)
        if stretch.seconds >= least_s[stretch.trial]
        for tone_hz in trials[stretch.trial].tones_hz
    ]
