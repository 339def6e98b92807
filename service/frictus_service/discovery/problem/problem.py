"""The regression problem of a discovery: measured units, a base model and its predictions.

Signatures are finite differences of the simulator's predictions; none is written by hand.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from frictus_hardware.arrays import BoolArray, FloatArray, IntArray
from frictus_hardware.physics.linear import TransferFunction
from frictus_hardware.physics.simulator import Simulator, predict
from frictus_service.discovery.evidence.background import MAINS_HZ
from frictus_service.discovery.evidence.evidence_rows import Subject, within
from frictus_service.discovery.evidence.residuals import (
    Compared,
    accuracy_of,
    reduce,
    trials_of,
)
from frictus_service.discovery.problem.base_models import (
    DEVIATING,
    NUISANCE_SCALED,
    QUIET,
    RANDOM_EFFECTS,
    ResponseName,
)
from frictus_service.discovery.problem.candidates import Candidate, Pattern

NUISANCE_STEP: Final = 1e-3


@dataclass(frozen=True, slots=True)
class UnwhitenedUnit:
    """A unit before it is whitened; first axis the readings.

    Attributes
    ----------
    readings : ndarray, shape (n,)
    own : ndarray, shape (n, n_own)
    chosen : ndarray, shape (n, n_chosen)
        Signatures of the effects in the model.
    deviating : ndarray, shape (n, n_deviating)
        Signatures of what deviates in each condition; of `n_kinds` kinds, which alternate.
    condition : ndarray of int, shape (n_conditions,)
        Number of each of these conditions; -1: it is no other unit's.
    n_kinds : int
        How many kinds deviate per condition.
    random_effects : ndarray, shape (n, n_random)
        Signatures of effects in which people may differ.
    common : ndarray of bool, shape (n_chosen,)
        Those of the chosen effects in which they may not.
    accuracy : ndarray, shape (n,)
        Of each reading at best.
    """

    readings: FloatArray
    own: FloatArray
    chosen: FloatArray
    deviating: FloatArray
    condition: IntArray
    n_kinds: int
    random_effects: FloatArray
    common: BoolArray
    accuracy: FloatArray


@dataclass(frozen=True, slots=True)
class DiscoveryProblem:
    """Data, base model and candidate effects of a discovery.

    Attributes
    ----------
    base : Simulator
        The base model.
    nominal_mount : TransferFunction or None
        The study's.
    response : {'friction', 'mobility'}
    subjects : tuple of Subject
        One for each unit.
    candidates : tuple of Candidate
        Parameters of effects that are tried.
    patterns : tuple of Pattern
        That any misfit may show as.
    range_mm_s : tuple of float
        Speeds at which the base model was found.
    differing : frozenset of str
        Effects in which units differ by chance: people do, folds of one recording do not.
    people : bool
        Units are people, and not blocks of trials of the same people: what a condition has in
        all of them is no chance.
    """

    base: Simulator
    nominal_mount: TransferFunction | None
    response: ResponseName
    subjects: tuple[Subject, ...]
    candidates: tuple[Candidate, ...]
    patterns: tuple[Pattern, ...]
    range_mm_s: tuple[float, float] = (20.0, 100.0)
    differing: frozenset[str] = RANDOM_EFFECTS
    people: bool = True

    @property
    def random_effects(self) -> list[int]:
        """Candidates in which units differ by chance."""
        return [k for k, each in enumerate(self.candidates) if each.effect in self.differing]

    def limits(self, chosen: Sequence[int]) -> tuple[FloatArray, FloatArray]:
        """Return least and largest coefficients about which candidates can be linear."""
        limits = np.array([self.candidates[effect].limits for effect in chosen])
        low, high = limits.reshape(-1, 2).T
        return low, high

    def positive(self, chosen: Sequence[int]) -> NDArray[np.bool_]:
        """Return which candidates cannot be negative."""
        return np.array([self.candidates[effect].positive for effect in chosen], dtype=np.bool_)

    def simulator(
        self, own: FloatArray, chosen: Sequence[int], coefficients: FloatArray
    ) -> Simulator:
        """Return the base model with own parameters and effects.

        Parameters
        ----------
        own : ndarray, shape (n_own,)
        chosen : sequence of int
            Candidates in the model.
        coefficients : ndarray, shape (n_chosen,)
        """
        simulator = NUISANCE_SCALED[self.response](self.base, own)
        for effect, coefficient in zip(chosen, coefficients, strict=True):
            simulator = self.candidates[effect].extend(simulator, float(coefficient))
        return simulator

    def predicted(
        self,
        subject: Subject,
        own: FloatArray,
        chosen: Sequence[int],
        coefficients: FloatArray,
    ) -> Compared:
        """Return what the model with these parameters predicts for a subject."""
        return self._compared(subject, self.simulator(own, chosen, coefficients), own)

    def rest(
        self,
        subject: Subject,
        own: FloatArray,
        chosen: Sequence[int],
        coefficients: FloatArray,
    ) -> Compared:
        """Return what was measured less what the model predicts."""
        return subject.measured - self.predicted(subject, own, chosen, coefficients)

    def signature(
        self,
        subject: Subject,
        own: FloatArray,
        chosen: Sequence[int],
        coefficients: FloatArray,
        effect: int,
    ) -> Compared:
        """Return by what a candidate changes a prediction, per unit of coefficient."""
        here = self.simulator(own, chosen, coefficients)
        stronger, step = self._stronger(effect, here, own, chosen, coefficients)
        seen = self._compared(subject, here, own)
        return (self._compared(subject, stronger, own) - seen) / step

    def _stronger(
        self,
        effect: int,
        here: Simulator,
        own: FloatArray,
        there: Sequence[int],
        at: FloatArray,
    ) -> tuple[Simulator, float]:
        """Return a simulator in which a candidate is a step stronger, and the step."""
        candidate = self.candidates[effect]
        step = candidate.step**2 if candidate.squared else candidate.step
        if effect not in there:
            return candidate.extend(here, step), step
        moved = at.copy()
        moved[list(there).index(effect)] += step
        return self.simulator(own, there, moved), step

    def unwhitened(
        self,
        subject: Subject,
        own: FloatArray,
        there: Sequence[int],
        at: FloatArray,
        n_chosen: int,
        wanted: Sequence[int],
    ) -> tuple[UnwhitenedUnit, FloatArray]:
        """Return a unit linearised about given parameters, before its readings are whitened.

        Parameters
        ----------
        subject : Subject
            The evidence of one unit.
        own : ndarray, shape (n_own,)
            Nuisance parameters.
        there : sequence of int
            Effects in the simulator: the chosen ones, and then the random effects.
        at : ndarray, shape (n_there,)
            Their coefficients.
        n_chosen : int
            How many of the effects are in the model.
        wanted : sequence of int

        Returns
        -------
        UnwhitenedUnit
            The effects that are in the simulator are in its readings.
        ndarray, shape (n, n_wanted)
            Signatures of the wanted effects.
        """
        chosen, random = there[:n_chosen], self.random_effects
        here = self.simulator(own, there, at)
        seen = self._compared(subject, here, own)

        def change(simulator: Simulator, own: FloatArray, step: float) -> FloatArray:
            moved = self._compared(subject, simulator, own)
            return reduce(subject.layout, (moved - seen) / step)

        mine = []
        for k in range(own.size):
            moved = own.copy()
            moved[k] += NUISANCE_STEP
            mine.append(change(self.simulator(moved, there, at), moved, NUISANCE_STEP))
        mine.extend(reduce(subject.layout, each) for each in _background(subject))
        # Whether the law goes on beyond the speeds at which it was found, nobody knows.
        held = self._compared(within(subject, self.range_mm_s), here, own)
        mine.append(reduce(subject.layout, held - seen))
        signatures = {}
        for effect in {*wanted, *there, *random}:
            stronger, step = self._stronger(effect, here, own, there, at)
            signatures[effect] = change(stronger, own, step)
        readings = reduce(subject.layout, subject.measured - seen)

        def columns(effects: Sequence[int]) -> FloatArray:
            blank = np.zeros((readings.size, 0))
            return np.column_stack([blank, *(signatures[effect] for effect in effects)])

        condition, deviating = _by_condition(subject, mine[: DEVIATING[self.response]])
        raw = UnwhitenedUnit(
            readings + columns(there) @ at,
            np.column_stack(mine),
            columns(chosen),
            deviating,
            condition if self.people else np.full(condition.size, -1),
            DEVIATING[self.response],
            columns(random),
            np.array([effect not in random for effect in chosen], dtype=np.bool_),
            accuracy_of(subject.layout),
        )
        return raw, columns(wanted)

    def _compared(self, subject: Subject, simulator: Simulator, own: FloatArray) -> Compared:
        """Return what a simulator predicts, in the form of the data."""
        at_rows = predict(simulator, subject.rows, self.nominal_mount)
        at_trials = predict(simulator, subject.trials, self.nominal_mount)
        response = at_rows.friction if self.response == "friction" else at_rows.mobility
        quiet = subject.quiet_n2
        if self.response == "friction":
            quiet = quiet * float(np.exp(own[QUIET]))
        line50, line60 = (
            sum(
                hum.amplitude_n**2
                for hum in simulator.hum
                if abs(hum.frequency_hz - line) < 1.0
            )
            for line in MAINS_HZ
        )
        everywhere = np.full(at_trials.low_n2.shape, 0.5)
        return Compared(
            size=np.log(np.abs(response)),
            phase=np.angle(response),
            second=np.column_stack([at_rows.second.real, at_rows.second.imag]),
            third=np.column_stack([at_rows.third.real, at_rows.third.imag]),
            line50=line50 * everywhere,
            line60=line60 * everywhere,
            low=np.log(quiet + at_trials.low_n2),
        )


def _background(subject: Subject) -> list[Compared]:
    """Return what the low frequencies of every finger do: more when it presses."""
    force = np.log(np.maximum(subject.trials.circumstances.normal_force_n, 1e-3) / 0.4)
    return [replace(Compared.zeros(subject.tone.size, force.size), low=force)]


def _by_condition(
    subject: Subject, signatures: Sequence[FloatArray]
) -> tuple[IntArray, FloatArray]:
    """Return the conditions, and the signatures of each alone, kinds alternating, (n, m k)."""
    condition = subject.condition[trials_of(subject.layout)]
    numbers = np.unique(condition)
    columns = [
        np.where(condition == each, signature, 0.0)
        for each in numbers
        for signature in signatures
    ]
    return numbers, np.column_stack(columns)


def as_accurate(columns: FloatArray, accuracy: FloatArray) -> FloatArray:
    """Return the coefficient at which the largest change of a column is as accuracy is.

    NaN of a column that is empty: no coefficient shows.
    """
    largest = np.max(np.abs(columns) / accuracy[:, np.newaxis], axis=0, initial=0.0)
    coefficient = np.full(largest.shape, np.nan)
    shown = largest > np.sqrt(np.finfo(float).tiny)  # of which the square is known, too
    np.divide(1.0, largest, out=coefficient, where=shown)
    return coefficient
