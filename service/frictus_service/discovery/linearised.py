"""The model about which everything is linear: fitted to each unit, and its derivatives.

Signatures are differences of the simulator's predictions: nobody writes one by hand.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from frictus_hardware.physics.effects import EFFECTS
from frictus_hardware.physics.linear import TransferFunction
from frictus_hardware.physics.simulator import Simulator
from frictus_service.discovery.candidates import Candidate
from frictus_service.discovery.generic import Pattern
from frictus_service.discovery.lines import MAINS_HZ
from frictus_service.discovery.own import (
    DEVIATING,
    LEANING,
    OWN,
    OWN_SCALED,
    QUIET,
    ResponseName,
)
from frictus_service.discovery.readings import Compared, Layout, accuracy_of, reduce, trials_of
from frictus_service.discovery.subjects import Subject, as_asked, within
from frictus_service.discovery.units import Unit, joint, mean_of_known, orthonormal
from frictus_service.discovery.whitening import Raw, Whitening, whiten

FloatArray = NDArray[np.float64]
Whiten = Callable[[Sequence[Layout], Sequence[Raw]], list[Whitening]]

ROUNDS: Final = 8
"""Of Gauss-Newton at most; without a power that outgrows its background, three do."""
SETTLED: Final = 1e-3
ASTRAY: Final = 0.01
"""By which what is left may grow in a step: people are drawn towards each other, too."""
LEAST_STEP: Final = 0.1
OWN_STEP: Final = 1e-3
MOST_CHANGE: Final = 0.7
"""Of the logarithm of an own parameter in one round."""


@dataclass(frozen=True, slots=True)
class Linearised:
    """The units about the model, and the model.

    Attributes
    ----------
    units : tuple of Unit
        The chosen effects are back in the readings: their coefficients are the whole ones.
    own : ndarray, shape (n_units, n_own)
        Logarithms of what everybody has of their own, less the base model's.
    chosen : tuple of int
    coefficients : ndarray, shape (n_units, n_chosen)
        Of the chosen effects: the unit's own, or means over units of what is the rig's.
    whitenings : tuple of Whitening
        Of each unit.
    """

    units: tuple[Unit, ...]
    own: FloatArray
    chosen: tuple[int, ...]
    coefficients: FloatArray
    whitenings: tuple[Whitening, ...]


@dataclass(frozen=True, slots=True)
class Ground:
    """What a discovery stands on.

    Attributes
    ----------
    base : Simulator
    nominal_mount : TransferFunction or None
        The study's.
    response : {'friction', 'mobility'}
    subjects : tuple of Subject
    candidates : tuple of Candidate
    patterns : tuple of Pattern
    range_mm_s : tuple of float
        Speeds at which the base model was found.
    whiten : callable
        From layouts and raw units to whitenings; by what the readings themselves say of their
        scatter, unless it is known.
    """

    base: Simulator
    nominal_mount: TransferFunction | None
    response: ResponseName
    subjects: tuple[Subject, ...]
    candidates: tuple[Candidate, ...]
    patterns: tuple[Pattern, ...]
    range_mm_s: tuple[float, float] = (20.0, 100.0)
    whiten: Whiten = whiten

    def linearise(
        self,
        chosen: Sequence[int],
        wanted: Sequence[int] | None = None,
        patterns: Sequence[Pattern] | None = None,
        start: Linearised | None = None,
    ) -> Linearised:
        """Fit own parameters and chosen effects, and return the units about that.

        Parameters
        ----------
        chosen : sequence of int
            Candidates.
        wanted : sequence of int or None
            Candidates whose signatures the units have; None: all.
        patterns : sequence of Pattern or None
            Likewise.
        start : Linearised or None
            With fewer effects, from which the fit begins.
        """
        own = np.zeros((len(self.subjects), len(OWN[self.response])))
        leans = np.zeros((len(self.subjects), len(self.leaning)))
        if start is not None:
            own = start.own
            leans = np.array([whitening.leans for whitening in start.whitenings])
        leaned = [each for each in self.leaning if each not in chosen]
        places = [self.leaning.index(each) for each in leaned]
        there = [*chosen, *leaned]  # effects about which all is linear
        at = np.hstack([np.zeros((len(self.subjects), len(chosen))), leans[:, places]])
        for _ in range(ROUNDS):
            before = at
            units, whitenings = self._about(own, there, at, len(chosen), there, ())
            coefficients = self._settled(joint(units, range(len(chosen))), chosen)
            leans = np.array([whitening.leans[places] for whitening in whitenings])
            at = np.hstack([coefficients, leans])
            steps = np.array(
                [_own_step(*each, own.shape[1]) for each in zip(units, at, strict=True)]
            )
            steps = np.clip(steps, -MOST_CHANGE, MOST_CHANGE)
            share = self._eased(own, steps, there, before, at, units, whitenings)
            own = own + share * steps
            at = before + share * (at - before)
            at[:, : len(chosen)] = self._settled(at[:, : len(chosen)], chosen)
            change = np.abs(at - before)[:, : len(chosen)]
            small = np.all(change <= SETTLED * np.abs(at[:, : len(chosen)]))
            if small and np.all(np.abs(steps) < SETTLED):
                break
        wanted = range(len(self.candidates)) if wanted is None else wanted
        patterns = self.patterns if patterns is None else patterns
        units, whitenings = self._about(own, there, at, len(chosen), wanted, patterns)
        return Linearised(units, own, tuple(chosen), at[:, : len(chosen)], whitenings)

    def _eased(
        self,
        own: FloatArray,
        steps: FloatArray,
        there: Sequence[int],
        before: FloatArray,
        at: FloatArray,
        units: Sequence[Unit],
        whitenings: Sequence[Whitening],
    ) -> FloatArray:
        """Return how much of its step each unit goes, so that it leaves no more than before.

        Halves until it does: what is far from linear leads a whole step astray.

        Returns
        -------
        ndarray, shape (n_units, 1)
        """
        shares = np.ones((len(self.subjects), 1))
        for place, (subject, unit, whitening) in enumerate(
            zip(self.subjects, units, whitenings, strict=True)
        ):
            free = orthonormal(unit.own[:, own.shape[1] :])

            def left(
                share: float,
                place: int = place,
                subject: Subject = subject,
                whitening: Whitening = whitening,
                free: FloatArray = free,
            ) -> float:
                here = before[place] + share * (at[place] - before[place])
                rest = self.rest(subject, own[place] + share * steps[place], there, here)
                whitened = whitening(reduce(subject.layout, rest))
                return float(np.sum(np.square(whitened - free @ (free.T @ whitened))))

            most = left(0.0) * (1.0 + ASTRAY)
            while left(float(shares[place, 0])) > most and shares[place, 0] > LEAST_STEP:
                shares[place] /= 2.0
        return shares

    def designed(self, model: Linearised) -> tuple[Unit, ...]:
        """Return the units as the design alone makes them.

        Fingers move as they were asked to, and are the same in every condition. What speeds
        that wander within a trial tell besides rests on the form of a law being exact.

        Parameters
        ----------
        model : Linearised
        """
        asked = replace(self, subjects=tuple(as_asked(subject) for subject in self.subjects))
        return asked._alike(model, deviating=False).units

    def alike(self, model: Linearised) -> Linearised:
        """Return a model whose units are as they were if people did not differ in its causes.

        Parameters
        ----------
        model : Linearised
        """
        return self._alike(model, deviating=True)

    def _alike(self, model: Linearised, *, deviating: bool) -> Linearised:
        def whitened(_: Sequence[Layout], raws: Sequence[Raw]) -> list[Whitening]:
            return [
                Whitening.of(raw, each.weight, each.deviation * deviating)
                for raw, each in zip(raws, model.whitenings, strict=True)
            ]

        wanted = range(len(self.candidates))
        chosen, at = model.chosen, model.coefficients
        ground = replace(self, whiten=whitened)
        about = ground._about(model.own, chosen, at, len(chosen), wanted, self.patterns)
        return replace(model, units=about[0], whitenings=about[1])

    def _settled(self, found: FloatArray, chosen: Sequence[int]) -> FloatArray:
        """Return coefficients to go on with: each unit's own only where people differ."""
        if not chosen:
            return found
        mean = mean_of_known(found)
        scopes = [EFFECTS[self.candidates[effect].effect].scope for effect in chosen]
        own = np.array([scope == "participant" for scope in scopes]) & np.isfinite(found)
        settled = np.where(own, found, mean)
        return np.where(self._positive(chosen), np.maximum(settled, 0.0), settled)

    @property
    def leaning(self) -> list[int]:
        """Candidates in which people differ by chance."""
        return [k for k, each in enumerate(self.candidates) if each.effect in LEANING]

    def _positive(self, chosen: Sequence[int]) -> NDArray[np.bool_]:
        return np.array([self.candidates[effect].positive for effect in chosen], dtype=np.bool_)

    def simulator(
        self, own: FloatArray, chosen: Sequence[int], coefficients: FloatArray
    ) -> Simulator:
        """Return the base model with own parameters and effects.

        Parameters
        ----------
        own : ndarray, shape (n_own,)
        chosen : sequence of int
        coefficients : ndarray, shape (n_chosen,)
        """
        simulator = OWN_SCALED[self.response](self.base, own)
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

    def misfit(self, model: Linearised, ruler: Linearised) -> float:
        """Return the sum of squares that a model leaves, whitened as about another.

        Parameters
        ----------
        model : Linearised
        ruler : Linearised
            The same for all models that are compared.
        """
        total = 0.0
        for place, (subject, whitening) in enumerate(
            zip(self.subjects, ruler.whitenings, strict=True)
        ):
            rest = self.rest(subject, model.own[place], model.chosen, model.coefficients[place])
            left = whitening(reduce(subject.layout, rest))
            own = orthonormal(ruler.units[place].own)
            total += float(np.sum(np.square(left - own @ (own.T @ left))))
        return total

    def columns(
        self,
        model: Linearised,
        made: Callable[[int], Sequence[Compared]],
    ) -> list[tuple[FloatArray, FloatArray]]:
        """Return further columns of each unit, whitened, and how accurate they are.

        Parameters
        ----------
        model : Linearised
        made : callable
            From the number of a unit to columns.
        """
        found = []
        for place, (subject, whitening) in enumerate(
            zip(self.subjects, model.whitenings, strict=True)
        ):
            raw = [reduce(subject.layout, each) for each in made(place)]
            columns = np.array(raw).T
            accuracy = _as_accurate(columns, accuracy_of(subject.layout))
            found.append((whitening(columns), accuracy))
        return found

    def signature(self, model: Linearised, unit: int, effect: int) -> Compared:
        """Return by what a candidate changes a unit's prediction, per unit of coefficient."""
        subject, own, at = self.subjects[unit], model.own[unit], model.coefficients[unit]
        here = self.simulator(own, model.chosen, at)
        stronger, step = self._stronger(effect, own, model.chosen, at)
        seen = self._compared(subject, here, own)
        return (self._compared(subject, stronger, own) - seen) / step

    def _stronger(
        self, effect: int, own: FloatArray, there: Sequence[int], at: FloatArray
    ) -> tuple[Simulator, float]:
        """Return a simulator in which a candidate is one step stronger, and the step."""
        candidate = self.candidates[effect]
        step = candidate.step**2 if candidate.squared else candidate.step
        if effect not in there:
            return candidate.extend(self.simulator(own, there, at), step), step
        moved = at.copy()
        moved[list(there).index(effect)] += step
        return self.simulator(own, there, moved), step

    def _about(
        self,
        own: FloatArray,
        there: Sequence[int],
        at: FloatArray,
        n_chosen: int,
        wanted: Sequence[int],
        patterns: Sequence[Pattern],
    ) -> tuple[tuple[Unit, ...], tuple[Whitening, ...]]:
        """Return the units about given parameters, with wanted candidates, and whitenings.

        Parameters
        ----------
        own : ndarray, shape (n_units, n_own)
        there : sequence of int
            Effects in the simulator: the chosen ones, and then what people lean to besides.
        at : ndarray, shape (n_units, n_there)
        n_chosen : int
        wanted : sequence of int
        patterns : sequence of Pattern
        """
        raw = [
            self._signatures(subject, values, there, row, n_chosen, wanted)
            for subject, values, row in zip(self.subjects, own, at, strict=True)
        ]
        whitenings = self.whiten([s.layout for s in self.subjects], [each for each, _ in raw])
        positive = self._positive(wanted)
        squared = np.array([self.candidates[each].squared for each in wanted], dtype=np.bool_)
        # Where a power is in the model already, its signature levels off: it was seen before.
        passed = [each in there and self.candidates[each].squared for each in wanted]
        units = []
        for subject, (each, effects), whitening in zip(
            self.subjects, raw, whitenings, strict=True
        ):
            generic = [reduce(subject.layout, pattern.of(subject)) for pattern in patterns]
            columns = np.array(generic).reshape(len(generic), each.readings.size).T
            units.append(
                Unit(
                    whitening(each.readings),
                    whitening(each.own),
                    whitening(effects),
                    whitening(columns),
                    np.where(passed, 0.0, _as_accurate(effects, each.accuracy)),
                    _as_accurate(columns, each.accuracy),
                    positive,
                    squared,
                )
            )
        return tuple(units), tuple(whitenings)

    def _signatures(
        self,
        subject: Subject,
        own: FloatArray,
        there: Sequence[int],
        at: FloatArray,
        n_chosen: int,
        wanted: Sequence[int],
    ) -> tuple[Raw, FloatArray]:
        """Return readings with all that is fitted to them, and signatures of wanted effects.

        The effects that are in the simulator are in the readings; nothing is whitened.
        """
        chosen = there[:n_chosen]
        here = self.simulator(own, there, at)
        seen = self._compared(subject, here, own)

        def change(simulator: Simulator, own: FloatArray, step: float) -> FloatArray:
            moved = self._compared(subject, simulator, own)
            return reduce(subject.layout, (moved - seen) / step)

        mine = []
        for k in range(own.size):
            moved = own.copy()
            moved[k] += OWN_STEP
            mine.append(change(self.simulator(moved, there, at), moved, OWN_STEP))
        mine.extend(reduce(subject.layout, each) for each in _background(subject))
        # Whether the law goes on beyond the speeds at which it was found, nobody knows.
        held = self._compared(within(subject, self.range_mm_s), here, own)
        mine.append(reduce(subject.layout, held - seen))
        signatures = {}
        for effect in {*wanted, *there}:
            stronger, step = self._stronger(effect, own, there, at)
            signatures[effect] = change(stronger, own, step)
        readings = reduce(subject.layout, subject.measured - seen)

        def columns(effects: Sequence[int]) -> FloatArray:
            blank = np.zeros((readings.size, 0))
            return np.column_stack([blank, *(signatures[effect] for effect in effects)])

        raw = Raw(
            readings + columns(there) @ at,
            np.column_stack(mine),
            columns(chosen),
            _by_condition(subject, mine[: DEVIATING[self.response]]),
            DEVIATING[self.response],
            columns(self.leaning),
            np.array([effect not in self.leaning for effect in chosen], dtype=np.bool_),
            accuracy_of(subject.layout),
        )
        return raw, columns(wanted)

    def _compared(self, subject: Subject, simulator: Simulator, own: FloatArray) -> Compared:
        """Return what a simulator predicts, in the form of the data."""
        at_rows = simulator.predict(subject.rows, self.nominal_mount)
        at_trials = simulator.predict(subject.trials, self.nominal_mount)
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


def _by_condition(subject: Subject, signatures: Sequence[FloatArray]) -> FloatArray:
    """Return the signatures of each condition alone, kinds alternating, (n, n_conditions k)."""
    condition = subject.condition[trials_of(subject.layout)]
    columns = [
        np.where(condition == each, signature, 0.0)
        for each in np.unique(condition)
        for signature in signatures
    ]
    return np.column_stack(columns)


def _as_accurate(columns: FloatArray, accuracy: FloatArray) -> FloatArray:
    """Return the coefficient at which the largest change of a column is as accuracy is."""
    largest = np.max(np.abs(columns) / accuracy[:, np.newaxis], axis=0, initial=0.0)
    least = np.sqrt(np.finfo(float).tiny)  # so that sums over units stay finite
    coefficient: FloatArray = 1.0 / np.maximum(largest, least)
    return coefficient


def _own_step(unit: Unit, coefficients: FloatArray, n_own: int) -> FloatArray:
    """Return by how much the own parameters of a unit are off."""
    readings = unit.readings - unit.effects @ coefficients
    found = np.linalg.lstsq(unit.own, readings, rcond=None)[0]
    return np.asarray(found[:n_own], dtype=np.float64)
