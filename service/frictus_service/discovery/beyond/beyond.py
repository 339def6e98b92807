"""What is said of what no cause explains: a form, or a smooth discrepancy, or nothing.

A smooth discrepancy has octave bands, by the covariate that it follows. The factor ``1 + x sum
a_k B_k(f)`` of the response is linear in its weights, so that they follow from normal
equations; a normal prior holds those that the data do not show near 0 (Kennedy and O'Hagan
2001: a discrepancy beside a physical model).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy import stats

from frictus_hardware.arrays import ComplexArray, FloatArray
from frictus_hardware.physics.effects import extended
from frictus_hardware.physics.forms import BANDS_HZ, FORMS, QUALITY, band_names, band_pass
from frictus_service.discovery.beyond.characterise import (
    RESPONSE,
    Characterised,
    characterise,
    interval_of_mean,
)
from frictus_service.discovery.beyond.form_fit import Remainder
from frictus_service.discovery.beyond.grammar import BENT
from frictus_service.discovery.decision.decision import CLEARLY_BETTER, Decision
from frictus_service.discovery.decision.naming import CauseDecision
from frictus_service.discovery.inference.linearisation import Linearised, misfit
from frictus_service.discovery.problem.problem import DiscoveryProblem

PRIOR: Final = 0.1
"""Standard deviation of a weight before any data: a tenth of the response."""
STEP: Final = 0.01
FOLDS: Final = 4
COVARIATES: Final = {
    "none": "none",
    "speed": "speed",
    "force": "force",
    "minutes": "time",
    "direction": "direction",
    "position": "position",
}
"""From the covariate of a pattern to the word in an effect's id."""


@dataclass(frozen=True)
class SmoothDiscrepancy:
    """A smooth discrepancy.

    Attributes
    ----------
    covariate : str
        ``none``, or that of a pattern.
    weights : ndarray, shape (n_bands,)
        Of the octave bands.
    covariance : ndarray, shape (n_bands, n_bands)
        Of the weights, from how people scatter.
    n_units : int
        How many people, or blocks, it is fitted to.
    gain : ndarray, shape (n_units,)
        Nats by which each unit, held out, is more likely.
    """

    covariate: str
    weights: FloatArray
    covariance: FloatArray
    n_units: int
    gain: FloatArray

    @property
    def effect(self) -> str:
        """Id of its effect."""
        by = COVARIATES[self.covariate]
        return "empirical" if by == "none" else f"empirical_by_{by}"

    @property
    def values(self) -> dict[str, float]:
        """Parameters of its effect, within their ranges."""
        bands = FORMS[self.effect].parameters[1:]
        held = np.clip(self.weights, [b.low for b in bands], [b.high for b in bands])
        return {"strength": 1.0, **dict(zip(band_names(), held.tolist(), strict=True))}

    def at(self, tones_hz: FloatArray, x: float) -> tuple[ComplexArray, FloatArray, FloatArray]:
        """Return the logarithm of the factor, and half its 95 % interval in both parts.

        Parameters
        ----------
        tones_hz : ndarray, shape (n,)
        x : float
            Of the covariate, from -1 to 1; 1 where there is none.
        """
        bands = np.column_stack(
            [band_pass(float(f), 0.5 / QUALITY).frequency_response(tones_hz) for f in BANDS_HZ]
        )
        quantile = float(stats.t.ppf(0.975, self.n_units - 1))
        factor = 1.0 + x * bands @ self.weights
        slopes = x * bands / factor[:, np.newaxis]
        halves = [
            quantile * np.sqrt(np.einsum("ij,jk,ik->i", part, self.covariance, part))
            for part in (slopes.real, slopes.imag)
        ]
        return np.log(factor), halves[0], halves[1]


def fit_smooth(remainder: Remainder, covariate: str) -> SmoothDiscrepancy:
    """Return the smooth discrepancy by a covariate.

    Parameters
    ----------
    remainder : Remainder
        What a fitted model leaves.
    covariate : str
        A key of `COVARIATES`.
    """
    by = COVARIATES[covariate]
    effect = "empirical" if by == "none" else f"empirical_by_{by}"
    n_units = len(remainder.bases)
    rests = [remainder.rest(unit, effect, {}) for unit in range(n_units)]
    columns = [
        np.column_stack(
            [
                (rest - remainder.rest(unit, effect, {"strength": 1.0, name: STEP})) / STEP
                for name in band_names()
            ]
        )
        for unit, rest in enumerate(rests)
    ]
    gain = np.zeros(n_units)
    for fold in range(FOLDS):
        weights = _weights(columns, rests, [u for u in range(n_units) if u % FOLDS != fold])[0]
        for unit in range(fold, n_units, FOLDS):
            left = rests[unit] - columns[unit] @ weights
            gain[unit] = 0.5 * float(rests[unit] @ rests[unit] - left @ left)
    weights, covariance = _weights(columns, rests, range(n_units))
    return SmoothDiscrepancy(covariate, weights, covariance, n_units, gain)


def _weights(
    columns: Sequence[FloatArray], rests: Sequence[FloatArray], units: Sequence[int]
) -> tuple[FloatArray, FloatArray]:
    """Return weights and their covariance: the sandwich of the units' scores."""
    gram = np.sum([columns[u].T @ columns[u] for u in units], axis=0)
    along = np.sum([columns[u].T @ rests[u] for u in units], axis=0)
    inverse = np.linalg.inv(gram + np.eye(len(gram)) / PRIOR**2)
    weights: FloatArray = inverse @ along
    scores = np.array([columns[u].T @ (rests[u] - columns[u] @ weights) for u in units])
    n = len(units)
    covariance = inverse @ (scores.T @ scores) @ inverse * n / max(n - 1, 1)
    floor = np.maximum(np.diagonal(inverse) - np.diagonal(covariance), 0.0)
    return weights, covariance + np.diag(floor)


@dataclass(frozen=True)
class Beyond:
    """What lies beyond the catalogue.

    Attributes
    ----------
    problem : DiscoveryProblem
        With the form, or the smooth discrepancy, in its base model.
    form : Characterised or None
        None where none may be named.
    smooth : SmoothDiscrepancy or None
        None where nothing is left of the response.
    """

    problem: DiscoveryProblem
    form: Characterised | None = None
    smooth: SmoothDiscrepancy | None = None

    @property
    def smooth_in_model(self) -> bool:
        """Whether the smooth discrepancy predicts where no form does."""
        return (
            self.form is None
            and self.smooth is not None
            and interval_of_mean(self.smooth.gain)[0] > 0.0
        )

    @property
    def effect(self) -> tuple[str, Mapping[str, float]] | None:
        """The effect that enters the extended model."""
        if self.form is not None:
            return self.form.fitted.form.id, self.form.fitted.values
        if self.smooth is not None and self.smooth_in_model:
            return self.smooth.effect, self.smooth.values
        return None


def look_beyond(problem: DiscoveryProblem, found: Decision, flips: FloatArray) -> Beyond:
    """Return what describes what the causes of a decision leave.

    Parameters
    ----------
    problem : DiscoveryProblem
        Data, base model and candidates.
    found : Decision
        About the base model.
    flips : ndarray, shape (n_flips, n_units)
    """
    located = [each for each in found.unexplained if each.pattern.channel in RESPONSE]
    # Where a cause is there in another shape, the cause may leave little of it.
    bent = any(_effect(problem, each) in BENT for each in found.named if each.is_family)
    if problem.response != "friction" or not (located or bent):
        return Beyond(problem)
    smooth = _smooth(problem, found.extended, [each.pattern.covariate for each in located])
    form = _form(problem, found, flips)
    beyond = Beyond(problem, form, smooth)
    if beyond.effect is None:
        return beyond
    base = extended(problem.base, [beyond.effect])
    return replace(beyond, problem=replace(problem, base=base))


def _form(
    problem: DiscoveryProblem, found: Decision, flips: FloatArray
) -> Characterised | None:
    """Return the form beside the causes, or one that alone explains as much as they and it.

    A power law and what bends it back below a threshold are together what bends above it: that
    is the simpler thing to say. They leave less nevertheless where people differ in the power
    law, as only a cause has a size for each person; so of causes in another shape the form that
    is that shape needs only to leave nothing that all show alike.
    """
    beside = characterise(problem, found.extended, flips)
    if not found.effects:
        return beside
    alone = characterise(problem, found.base, flips, shown=True)  # by the causes
    if alone is None:
        return beside
    form = alone.fitted.form
    in_model = [each for each in found.named if each.candidate in found.effects]
    if alone.share >= 1.0 and all(
        each.is_family and _effect(problem, each) in form.shape_of for each in in_model
    ):
        return alone
    ruler = found.extended
    most = (
        misfit(problem, ruler, ruler) - CLEARLY_BETTER
        if beside is None
        else misfit(beside.problem, beside.model, ruler) + CLEARLY_BETTER
    )
    return alone if misfit(alone.problem, alone.model, ruler) <= most else beside


def beside_form(beyond: Beyond, first: Decision, found: Decision) -> Decision:
    """Return what was found beside a form, with the causes of which it is the shape.

    Parameters
    ----------
    beyond : Beyond
        With a form.
    first : Decision
        Without the form. A cause of another shape than the catalogue's keeps its name where the
        form may be that shape, and its size is that of the form; one that only stood in for the
        form goes.
    found : Decision
        Beside the form. A cause that shows beside its own bend is of another shape, too.
    """
    assert beyond.form is not None
    shape_of = beyond.form.fitted.form.shape_of
    there = {each.candidate for each in found.named}
    beside = [
        replace(each, verdict="family")
        if _effect(beyond.problem, each) in shape_of & BENT
        else each
        for each in found.named
    ]
    kept = [
        replace(each, in_model=False)
        for each in first.named
        if each.is_family
        and each.candidate not in there
        and _effect(beyond.problem, each) in shape_of
    ]
    return replace(found, named=(*beside, *kept))


def _effect(problem: DiscoveryProblem, named: CauseDecision) -> str:
    return problem.candidates[named.candidate].effect


def _smooth(
    problem: DiscoveryProblem, model: Linearised, covariates: Sequence[str]
) -> SmoothDiscrepancy | None:
    """Return the smooth discrepancy by whichever located covariate predicts best."""
    remainder = Remainder.of(problem, model)
    known = [each for each in dict.fromkeys(covariates) if each in COVARIATES]
    fitted = [fit_smooth(remainder, each) for each in known]
    return max(fitted, key=lambda each: float(each.gain.sum()), default=None)
