"""Fits the dose and the shape of a form to what a model leaves of many people: a trust region.

The readings, their whitening and what is everybody's own are those of the catalogue's
estimator; the form extends the base model, so that it predicts what the twin would do.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Final

import numpy as np
from scipy import stats
from scipy.optimize import least_squares

from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.effects import FORMS, extended
from frictus_service.discovery.beyond.grammar import Form
from frictus_service.discovery.evidence.residuals import accuracy_of, reduce
from frictus_service.discovery.inference.linear_model import telling_of
from frictus_service.discovery.inference.linearisation import Linearised, misfits
from frictus_service.discovery.inference.predictive_density import LEAST_TELLING
from frictus_service.discovery.problem.problem import DiscoveryProblem
from frictus_service.discovery.projection import (
    ROUNDING,
    inverse_of,
    orthogonal_to,
    orthonormal,
)

ROUNDS: Final = 60
SETTLED: Final = 1e-5
"""Share of the sum of squares, or of the parameters, below which a step is none."""
RIDGE: Final = 1e-6
NEAR: Final = 0.2
"""Of half a parameter's interval: by so much it, and its interval, may differ."""
LOGARITHMIC: Final = frozenset(
    {"frequency_hz", "damping", "delay_s", "corner_hz", "width_mm_s", "width_n", "softness"}
)
"""Parameters that are fitted on a log scale."""


@dataclass(frozen=True)
class Remainder:
    """What a fitted model leaves of each unit, whitened, what is everybody's own projected out.

    Attributes
    ----------
    problem : DiscoveryProblem
        Data, base model and candidates.
    model : Linearised
        Fitted without the form.
    bases : tuple of ndarray
        Orthonormal, of what is each unit's own and of the causes in the model.
    scales : tuple of float
        By which the readings of each unit are divided: rms of what is left, 1 at least. A unit
        whose noise is larger than the model of noise says would outweigh all others, and gain
        or lose more nats than there are readings.
    """

    problem: DiscoveryProblem
    model: Linearised
    bases: tuple[FloatArray, ...]
    scales: tuple[float, ...]

    @classmethod
    def of(cls, problem: DiscoveryProblem, model: Linearised) -> "Remainder":
        """Return the remainder of a model whose units have the chosen effects."""
        chosen = list(model.chosen)
        columns = [np.column_stack([u.own, u.effects[:, chosen]]) for u in model.units]
        bases = tuple(orthonormal(each) for each in columns)
        plain = cls(problem, model, bases, (1.0,) * len(bases))
        rests = [plain.rest(unit, "", {}) for unit in range(len(bases))]
        scales = [max(1.0, float(np.sqrt(np.mean(rest**2)))) for rest in rests]
        return replace(plain, scales=tuple(scales))

    def rest(self, unit: int, effect: str, values: Mapping[str, float]) -> FloatArray:
        """Return what is left of a unit beside a form, what is its own projected out.

        Parameters
        ----------
        unit : int
            Its number.
        effect : str
            Id of the form.
        values : mapping
            Its parameters; empty: the model without the form.
        """
        return orthogonal_to(self.bases[unit], self.whitened(unit, effect, values))

    def whitened(self, unit: int, effect: str, values: Mapping[str, float]) -> FloatArray:
        """Return what is left of a unit beside a form, with what is its own."""
        problem, model = self.problem, self.model
        if values:
            base = extended(problem.base, [(effect, values)])
            problem = replace(problem, base=base)
        subject = problem.subjects[unit]
        left = problem.rest(subject, model.own[unit], model.chosen, model.coefficients[unit])
        return model.whitenings[unit](reduce(subject.layout, left)) / self.scales[unit]

    def misfit(self, problem: DiscoveryProblem, model: Linearised) -> float:
        """Return the sum of squares that another model leaves, units divided by their scales.

        Parameters
        ----------
        problem : DiscoveryProblem
            The same data; another base model.
        model : Linearised
            Fitted to it.
        """
        return float((misfits(problem, model, self.model) / np.square(self.scales)).sum())

    def accuracy(self, unit: int) -> FloatArray:
        """Return what measuring is accurate to, whitened, of each reading."""
        accuracy = accuracy_of(self.problem.subjects[unit].layout)
        return self.model.whitenings[unit].weight * accuracy / self.scales[unit]


@dataclass(frozen=True)
class FittedForm:
    """A form with its parameters.

    Attributes
    ----------
    form : Form
        Of the grammar.
    values : dict
        The dose, then the shapes, and what is held.
    half_width : dict
        Of the 95 % interval of each fitted parameter, from how people scatter; of a parameter
        on a log scale, of the logarithm.
    cost : float
        Sum of squares left, over the units that were fitted.
    """

    form: Form
    values: dict[str, float]
    half_width: dict[str, float]
    cost: float

    def interval(self, name: str) -> tuple[float, float]:
        """Return the 95 % interval of a fitted parameter, within its bounds."""
        value, half = self.values[name], self.half_width[name]
        bounds = next(p for p in FORMS[self.form.id].parameters if p.name == name)
        ends = (value - half, value + half)
        if name in LOGARITHMIC:
            ends = (value * float(np.exp(-half)), value * float(np.exp(min(half, 20.0))))
        return max(ends[0], bounds.low), min(ends[1], bounds.high)

    def is_near(self, other: "FittedForm") -> bool:
        """Return whether another fit has the same parameters and intervals, within `NEAR`.

        An interval that is still wide because the fit is poor must not end the search.
        """
        return all(
            abs(_on_scale(name, self.values[name]) - _on_scale(name, other.values[name]))
            <= NEAR * half
            and abs(half - other.half_width[name]) <= NEAR * half
            for name, half in self.half_width.items()
        )


def _on_scale(name: str, value: float) -> float:
    """Return a parameter on the scale on which it is fitted."""
    return float(np.log(value)) if name in LOGARITHMIC else value


def fit_form(
    remainder: Remainder,
    form: Form,
    begin: Mapping[str, float],
    units: Sequence[int],
) -> FittedForm:
    """Return a form fitted to some units, all with the same parameters.

    Parameters
    ----------
    remainder : Remainder
        What the model leaves.
    form : Form
        Of the grammar.
    begin : mapping
        The dose and the shapes to begin with; what else is in it is held.
    units : sequence of int
        Numbers of those that are fitted.
    """
    names = (form.dose, *form.shapes)
    bounds = {p.name: (p.low, p.high) for p in FORMS[form.id].parameters}
    steps = {p.name: p.step for p in FORMS[form.id].parameters}
    begin = {name: float(np.clip(value, *bounds[name])) for name, value in begin.items()}
    held = {name: value for name, value in begin.items() if name not in names}

    def plain(x: FloatArray) -> dict[str, float]:
        return {
            name: float(np.clip(np.exp(at) if name in LOGARITHMIC else at, *bounds[name]))
            for name, at in zip(names, x, strict=True)
        } | held

    @lru_cache(maxsize=1)  # the slopes at a point are asked for right after what is left there
    def left_at_values(*at: float) -> list[FloatArray]:
        values = dict(zip(names, at, strict=True)) | held
        return [remainder.rest(unit, form.id, values) for unit in units]

    def left(values: Mapping[str, float]) -> list[FloatArray]:
        return left_at_values(*(values[name] for name in names))

    def jacobian(values: dict[str, float]) -> list[FloatArray]:
        rests, columns = left(values), []
        for name in names:
            step = steps[name] * (-1.0 if values[name] + steps[name] > bounds[name][1] else 1.0)
            moved = left({**values, name: values[name] + step})
            slope = values[name] / step if name in LOGARITHMIC else 1.0 / step
            columns.append([slope * (b - a) for a, b in zip(moved, rests, strict=True)])
        return [np.column_stack(each) for each in zip(*columns, strict=True)]

    def left_at(x: FloatArray) -> FloatArray:
        return np.concatenate(left(plain(x)))

    def jacobian_at(x: FloatArray) -> FloatArray:
        return -np.concatenate(jacobian(plain(x)))

    low, high = np.array([[_on_scale(n, b) for b in bounds[n]] for n in names]).T
    found = least_squares(
        left_at,
        np.array([_on_scale(name, begin[name]) for name in names]),
        jacobian_at,
        (low, high),
        x_scale="jac",
        ftol=SETTLED,
        xtol=SETTLED,
        gtol=np.finfo(float).eps,  # no slope at all: where a form does nothing, it stays
        max_nfev=ROUNDS,
    )
    values = plain(found.x)
    rests = left(values)
    slopes = jacobian(values)
    half = half_widths(slopes, rests, [remainder.accuracy(u) for u in units])
    mean, half[0] = _mean_dose(values[form.dose], slopes, rests, float(half[0]))
    values = {**values, form.dose: float(np.clip(mean, *bounds[form.dose]))}
    cost = _squares(left(values))
    return FittedForm(form, values, dict(zip(names, half.tolist(), strict=True)), cost)


def _mean_dose(
    dose: float, slopes: Sequence[FloatArray], rests: Sequence[FloatArray], least: float
) -> tuple[float, float]:
    """Return the mean of people's own doses, each of whom counts once, and half its interval.

    Those count who show something of the dose: at one speed, a switch at another shows nothing.

    Parameters
    ----------
    dose : float
        That all have in common in the fit.
    slopes, rests : sequence of ndarray
        Of each unit; the dose is the first parameter.
    least : float
        Half the interval at least.
    """
    shown = np.array([j[:, 0] @ j[:, 0] for j in slopes])
    telling = telling_of(shown[:, np.newaxis])[:, 0]
    if telling.sum() < LEAST_TELLING:
        return dose, least
    along = np.array([j[:, 0] @ r for j, r in zip(slopes, rests, strict=True)])
    own = dose + along[telling] / shown[telling]
    half = float(stats.t.ppf(0.975, own.size - 1) * own.std(ddof=1) / np.sqrt(own.size))
    return float(own.mean()), max(half, least)


def _squares(rests: Sequence[FloatArray]) -> float:
    return float(sum(rest @ rest for rest in rests))


def _gram(slopes: Sequence[FloatArray]) -> FloatArray:
    gram: FloatArray = np.sum([each.T @ each for each in slopes], axis=0)
    return gram + RIDGE * np.diag(np.maximum(np.diagonal(gram), 1e-12))


def half_widths(
    slopes: Sequence[FloatArray],
    rests: Sequence[FloatArray],
    accuracies: Sequence[FloatArray],
) -> FloatArray:
    """Return the half width of the 95 % interval of each parameter.

    People differ, and readings of one go together: each unit is left out in turn, by one step
    (jackknife; CR3 of Bell and McCaffrey 2002). It is never less than what noise alone makes;
    and what measuring is wrong by is the same for all, whatever their number.

    Parameters
    ----------
    slopes : sequence of ndarray, shape (n, k)
        Of what is predicted of each unit, whitened, by parameter.
    rests : sequence of ndarray, shape (n,)
        What is left of each.
    accuracies : sequence of ndarray, shape (n,)
        What measuring is accurate to.
    """
    n, whole = len(slopes), _gram(slopes)
    moved = np.array(
        [
            inverse_of(whole - j.T @ j, ROUNDING) @ j.T @ rest
            for j, rest in zip(slopes, rests, strict=True)
        ]
    )
    jackknife = (n - 1) / n * np.sum(np.square(moved), axis=0)
    variance = np.maximum(jackknife, np.diagonal(inverse_of(whole, ROUNDING)))
    shown = np.concatenate(
        [np.abs(j) / a[:, np.newaxis] for j, a in zip(slopes, accuracies, strict=True)]
    ).max(axis=0)
    quantile = float(stats.t.ppf(0.975, max(n - 1, 1)))
    half: FloatArray = np.hypot(
        quantile * np.sqrt(variance), 0.5 / np.maximum(shown, np.finfo(float).tiny)
    )
    return half
