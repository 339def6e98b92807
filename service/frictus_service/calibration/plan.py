"""Which trial comes next; pure functions of what was done so far."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final, Protocol

import numpy as np

from frictus.messages import Excitation
from frictus_hardware.arrays import FloatArray
from frictus_service.calibration import design
from frictus_service.calibration.coordinates import Prior
from frictus_service.calibration.job import PaperProtocol, QuickProtocol

MULTISINE_TONES: Final = 12


@dataclass(frozen=True, slots=True)
class Ask:
    """What is asked of one trial.

    Attributes
    ----------
    speed_mm_s, force_n : float
        Targets.
    excitation : Excitation
        The tones to play.
    approach_s, record_s : float
        Sliding before the recording, and recorded.
    """

    speed_mm_s: float
    force_n: float
    excitation: Excitation
    approach_s: float
    record_s: float

    @property
    def tones_hz(self) -> tuple[float, ...]:
        """Frequencies of the tones."""
        return tuple(tone.hz for tone in self.excitation.tones)


@dataclass(frozen=True, slots=True)
class RecordedTrial:
    """A trial that was recorded.

    Attributes
    ----------
    id : str
        Of the trial.
    speed_mm_s, force_n : float
        As asked for.
    tones_hz : tuple of float
        Played at once, Hz.
    record_s : float
        Recorded per trial, s.
    rejected : str
        Why it may not be used; empty where it may.
    """

    id: str
    speed_mm_s: float
    force_n: float
    tones_hz: tuple[float, ...]
    record_s: float
    rejected: str = ""


class CalibrationProtocol(Protocol):
    """What a protocol makes of what was done so far."""

    def ask(self, done: Sequence[RecordedTrial], precision: float | None) -> Ask | None:
        """Return the next trial; None at the end.

        Parameters
        ----------
        done : sequence of RecordedTrial
            In order.
        precision : float or None
            What was reached; None where nothing can be said yet.
        """
        ...

    def planned(self, done: Sequence[RecordedTrial]) -> int | None:
        """Return how many trials there will be, done ones included, if that is known."""
        ...

    def break_s(self, done: Sequence[RecordedTrial]) -> float:
        """Return how long the participant rests before the next trial."""
        ...

    def left_out(self, done: Sequence[RecordedTrial]) -> tuple[str, ...]:
        """Return what will not be measured, since it was rejected too often."""
        ...


HOPELESS: Final = 8
"""Trials of which none was accepted: more would drive the finger for nothing."""


def is_hopeless(done: Sequence[RecordedTrial]) -> bool:
    """Return whether so many trials were recorded, and all rejected, that none is asked for.

    Parameters
    ----------
    done : sequence of RecordedTrial
        So far.
    """
    return len(done) >= HOPELESS and all(trial.rejected for trial in done)


Condition = tuple[float, float, float]
"""Tone in Hz, speed in mm/s, force in N."""


@dataclass(frozen=True)
class PaperPlan:
    """One tone per trial, all conditions in random order; what is rejected comes again.

    Attributes
    ----------
    protocol : PaperProtocol
        Tones, speeds, forces and repeats.
    seed : int
        Of everything random; the same seed gives the same result.
    """

    protocol: PaperProtocol
    seed: int

    @cached_property
    def order(self) -> tuple[Condition, ...]:
        """All conditions, shuffled."""
        protocol = self.protocol
        tones = protocol.tones_hz or tuple(design.paper_tones().tolist())
        every = [
            (tone, speed, force)
            for tone in tones
            for speed in protocol.speeds_mm_s
            for force in protocol.forces_n
        ]
        shuffled = np.random.default_rng(self.seed).permutation(len(every))
        return tuple(every[place] for place in shuffled)

    def remaining(self, done: Sequence[RecordedTrial]) -> tuple[Condition, ...]:
        """Return what is still to be measured, in order; rejected trials at the end."""
        return tuple(self._all_so_far(done)[len(done) :])

    def _all_so_far(self, done: Sequence[RecordedTrial]) -> list[Condition]:
        """Return the conditions in the order of the trials, those to be repeated appended."""
        asked = list(self.order)
        times: dict[Condition, int] = {}
        for place, trial in enumerate(done):
            condition = asked[place]
            times[condition] = times.get(condition, 0) + 1
            if trial.rejected and times[condition] <= self.protocol.max_repeats:
                asked.append(condition)
        return asked

    def ask(self, done: Sequence[RecordedTrial], precision: float | None) -> Ask | None:
        """See `CalibrationProtocol`."""
        left = self.remaining(done)
        if not left:
            return None
        tone, speed, force = left[0]
        protocol = self.protocol
        return Ask(speed, force, design.single(tone), protocol.approach_s, protocol.record_s)

    def planned(self, done: Sequence[RecordedTrial]) -> int | None:
        """See `CalibrationProtocol`."""
        return len(done) + len(self.remaining(done))

    def break_s(self, done: Sequence[RecordedTrial]) -> float:
        """See `CalibrationProtocol`."""
        due = len(done) > 0 and len(done) % self.protocol.trials_per_block == 0
        return self.protocol.break_s if due else 0.0

    def left_out(self, done: Sequence[RecordedTrial]) -> tuple[str, ...]:
        """See `CalibrationProtocol`."""
        asked = self._all_so_far(done)
        good = {asked[place] for place, trial in enumerate(done) if not trial.rejected}
        still = set(self.remaining(done))
        return tuple(
            f"{tone:.4g} Hz at {speed:g} mm/s and {force:g} N"
            for tone, speed, force in self.order
            if (tone, speed, force) not in good | still
        )


@dataclass(frozen=True)
class QuickPlan:
    """Multisines, slow and fast in turn, in ever new conditions, until it is precise enough.

    Attributes
    ----------
    protocol : QuickProtocol
        Speeds, precision asked for and largest number of trials.
    seed : int
        Of everything random; the same seed gives the same result.
    prior : Prior
        Shares the power among the tones.
    """

    protocol: QuickProtocol
    seed: int
    prior: Prior

    @cached_property
    def _power(self) -> FloatArray:
        tones = design.lines(MULTISINE_TONES)
        return design.powers(tones, self.prior, self.protocol.speeds_mm_s)

    @cached_property
    def _conditions(self) -> tuple[tuple[float, float], ...]:
        """Every speed with every force, in random order."""
        every = [
            (speed, force)
            for speed in self.protocol.speeds_mm_s
            for force in self.protocol.forces_n
        ]
        shuffled = np.random.default_rng(self.seed).permutation(len(every))
        return tuple(every[place] for place in shuffled)

    def ask(self, done: Sequence[RecordedTrial], precision: float | None) -> Ask | None:
        """See `CalibrationProtocol`."""
        protocol = self.protocol
        recorded_s = sum(trial.record_s for trial in done)
        if precision is not None and precision <= protocol.precision:
            return None
        if recorded_s + protocol.record_s > protocol.max_recorded_s + 1e-9:
            return None
        still = [condition for condition in self._conditions if self._open(done, condition)]
        if not still:
            return None
        good = [trial for trial in done if not trial.rejected]
        middle = (min(protocol.speeds_mm_s) + max(protocol.speeds_mm_s)) / 2.0

        def had(condition: tuple[float, float]) -> tuple[int, int]:
            """Return the valid trials at this end of the speeds, and in this condition."""
            fast = condition[0] > middle
            return sum((t.speed_mm_s > middle) == fast for t in good), len(_in(good, condition))

        speed, force = min(still, key=had)
        rng = np.random.default_rng([self.seed, len(done)])
        wave = design.multisine(rng, design.lines(MULTISINE_TONES), self._power)
        return Ask(speed, force, wave, protocol.approach_s, protocol.record_s)

    def _open(self, done: Sequence[RecordedTrial], condition: tuple[float, float]) -> bool:
        """Return whether a condition was not rejected too often in a row."""
        last = _in(done, condition)[-(self.protocol.max_repeats + 1) :]
        full = len(last) == self.protocol.max_repeats + 1
        return not (full and all(trial.rejected for trial in last))

    def planned(self, done: Sequence[RecordedTrial]) -> int | None:
        """See `CalibrationProtocol`."""
        return None

    def break_s(self, done: Sequence[RecordedTrial]) -> float:
        """See `CalibrationProtocol`."""
        return 0.0

    def left_out(self, done: Sequence[RecordedTrial]) -> tuple[str, ...]:
        """See `CalibrationProtocol`."""
        return tuple(
            f"more at {condition[0]:g} mm/s and {condition[1]:g} N"
            for condition in self._conditions
            if not self._open(done, condition)
        )


def _in(done: Sequence[RecordedTrial], condition: tuple[float, float]) -> list[RecordedTrial]:
    return [trial for trial in done if (trial.speed_mm_s, trial.force_n) == condition]


def plan_of(
    protocol: PaperProtocol | QuickProtocol, seed: int, prior: Prior
) -> CalibrationProtocol:
    """Return the plan of a protocol."""
    if isinstance(protocol, PaperProtocol):
        return PaperPlan(protocol, seed)
    return QuickPlan(protocol, seed, prior)
