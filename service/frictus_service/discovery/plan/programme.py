"""The trials of everybody in their order, and where in a trial the finger is for how long."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Final

import numpy as np

from frictus_hardware.physics.schedule import REFERENCE_POSITION_MM
from frictus_service.discovery.evidence.observation_table import LEAST_UNITS
from frictus_service.discovery.plan.documents import FactorialDesign
from frictus_service.identification.observation.tones import Tones

TYPICAL = 2
"""People of a design who are looked at: the others differ from them by the order alone."""


@dataclass(frozen=True, slots=True)
class PlannedTrial:
    """One trial.

    Attributes
    ----------
    speed_mm_s, force_n : float
        Targets.
    tones_hz : tuple of float
        Empty: without drive.
    drive_vpp : float
        0 without drive.
    seconds : float
        Length of the trial.
    minutes : float
        Since the session began.
    """

    speed_mm_s: float
    force_n: float
    tones_hz: tuple[float, ...]
    drive_vpp: float
    seconds: float
    minutes: float = 0.0


@dataclass(frozen=True, slots=True)
class Programme:
    """All trials.

    Attributes
    ----------
    people : tuple of tuple of PlannedTrial
        Trials of typical participants, in order.
    participants : int
        All; those who are not in `people` are like them.
    span_mm : float
        Of a stroke.
    trial_every_s : float
        From one beginning to the next.
    shuffled : bool
        The order is random, and what is added is shuffled in.
    done : bool
        The trials were run: what is added makes a session of its own.
    """

    people: tuple[tuple[PlannedTrial, ...], ...]
    participants: int
    span_mm: float
    trial_every_s: float
    shuffled: bool
    done: bool = False

    @property
    def finger_s(self) -> float:
        """Seconds on the finger, of all participants together."""
        own = [sum(trial.seconds for trial in trials) for trials in self.people]
        return self.participants * float(np.mean(own))

    @property
    def trials(self) -> tuple[PlannedTrial, ...]:
        """All that stand in it."""
        return tuple(trial for trials in self.people for trial in trials)

    def few(self) -> "Programme":
        """Return the programme with typical participants only, enough for averages."""
        kept = self.people if self.participants < LEAST_UNITS else self.people[:TYPICAL]
        return replace(self, people=kept)

    def with_more(
        self,
        more: Callable[[Sequence[PlannedTrial]], Sequence[PlannedTrial]],
        rng: np.random.Generator,
    ) -> "Programme":
        """Return the programme with further trials.

        Parameters
        ----------
        more : callable
            From a participant's trials to what is added.
        rng : numpy.random.Generator
            Of their order.
        """
        return replace(
            self, people=tuple(self._added(own, more(own), rng) for own in self.people)
        )

    def _added(
        self,
        own: tuple[PlannedTrial, ...],
        more: Sequence[PlannedTrial],
        rng: np.random.Generator,
    ) -> tuple[PlannedTrial, ...]:
        further = [more[k] for k in rng.permutation(len(more))]
        if self.done:
            return (*own, *timed(further, self.trial_every_s))
        both = [*own, *further]
        if self.shuffled:
            both = [both[k] for k in rng.permutation(len(both))]
        return timed(both, self.trial_every_s)

    def randomised(self, rng: np.random.Generator) -> "Programme":
        """Return the programme with everybody's trials in random order."""
        return replace(self, shuffled=True).with_more(lambda own: (), rng)


def timed(trials: Sequence[PlannedTrial], every_s: float) -> tuple[PlannedTrial, ...]:
    """Return trials that begin one after the other.

    Parameters
    ----------
    trials : sequence of PlannedTrial
        In order.
    every_s : float
        From one beginning to the next.
    """
    return tuple(
        replace(trial, minutes=place * every_s / 60.0) for place, trial in enumerate(trials)
    )


def programme_of(design: FactorialDesign, rng: np.random.Generator) -> Programme:
    """Return the trials of a design.

    Parameters
    ----------
    design : FactorialDesign
        Who does what, and how often.
    rng : numpy.random.Generator
        Of the order.
    """
    few = design.participants < LEAST_UNITS
    typical = design.participants if few else TYPICAL
    return Programme(
        people=tuple(_in_order(design, rng) for _ in range(typical)),
        participants=design.participants,
        span_mm=design.span_mm,
        trial_every_s=design.trial_every_s,
        shuffled=design.order == "random",
    )


def _in_order(design: FactorialDesign, rng: np.random.Generator) -> tuple[PlannedTrial, ...]:
    trials = [
        PlannedTrial(speed, force, tones, drive if tones else 0.0, design.seconds)
        for speed, force in product(design.speeds_mm_s, design.forces_n)
        for tones, drive in [
            *product(_together(design), design.drive_vpp),
            *design.blanks * [((), 0.0)],
        ]
    ]
    shuffled = [trials[k] for k in rng.permutation(len(trials))]
    if design.order == "speed blocks":
        place = {speed: k for k, speed in enumerate(design.speeds_mm_s)}
        shuffled.sort(key=lambda trial: place[trial.speed_mm_s])
    return timed(shuffled, design.trial_every_s)


def _together(design: FactorialDesign) -> list[tuple[float, ...]]:
    """Return the tones of as many trials as there are tones, each tone equally often."""
    tones = sorted(design.tones_hz)
    apart = len(tones) // design.tones_per_trial
    groups = [
        tuple(
            sorted(tones[(k + n * apart) % len(tones)] for n in range(design.tones_per_trial))
        )
        for k in range(len(tones))
    ]
    return design.repeats * groups


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
