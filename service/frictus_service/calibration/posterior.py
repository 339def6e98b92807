"""From trials to one person's speed law with its covariance, the cutoff's variability included.

What the cutoff's wandering about the law costs: a mixture over its size.

From one condition or trial to the next the finger is not quite the same; how much so is not
known, and two of them do not tell it. Every size is tried and weighed by how well it explains
what was measured.

From trials, whatever tones they play, to one person's speed law with its uncertainty.

Gauss-Newton on the relative residual of every row, in which the gain of a stretch of a stroke
is a real number added to all its tones: tones that are played together share it and it drops
out of their ratios, on which the cutoff hangs; tones of different trials do not. Noise
is judged by the scatter within trials, the wandering of the finger by that between conditions.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from scipy import optimize, stats

from frictus.model import Model, Validity
from frictus_hardware.arrays import FloatArray
from frictus_service.calibration import coordinates
from frictus_service.calibration.coordinates import Prior
from frictus_service.calibration.score_information import (
    Data,
    GainScatter,
    scores,
    spread_of,
    start,
)
from frictus_service.errors import ContradictionError, EstimateError
from frictus_service.identification.observation.response import TrialObservations

SIZES: Final = np.concatenate([[0.0], np.geomspace(0.0005, 0.5, 25)])
"""Standard deviations of ln cutoff about the law."""
EXPECTED: Final = 0.05
"""Half of the people are taken to wander less (half-Cauchy prior)."""
UNDETERMINED: Final = (
    "the trials do not determine gain, cutoff at two speeds and delay: measure at two speeds "
    "and three tones at least, or give a prior"
)
ENDS: Final = np.array([[1.0, 0.9], [0.9, 1.0]])
"""Correlation of the wandering of the law's two ends. Below 1, so that the slope is taken from
far speeds, and not from conditions whose speeds differ little."""


@dataclass(frozen=True, slots=True)
class Mixture:
    """Normal distributions of a person's `coordinates`, one per size of the wandering.

    Attributes
    ----------
    weights : ndarray, shape (n,)
    means : ndarray, shape (n, 4)
    covariances : ndarray, shape (n, 4, 4)
    """

    weights: FloatArray
    means: FloatArray
    covariances: FloatArray

    @property
    def mean(self) -> FloatArray:
        """Mean of the whole, shape (4,)."""
        mean: FloatArray = self.weights @ self.means
        return mean

    @property
    def covariance(self) -> FloatArray:
        """Covariance of the whole, shape (4, 4)."""
        away = self.means - self.mean
        spread = np.einsum("ki,kj->kij", away, away) + self.covariances
        whole: FloatArray = np.einsum("k,kij->ij", self.weights, spread)
        return whole

    @property
    def wandering(self) -> float:
        """Mean size of the wandering."""
        return float(self.weights @ SIZES)

    def half_width(self, contrast: FloatArray) -> float:
        """Return half of the central 95 % interval of a combination of parameters.

        Parameters
        ----------
        contrast : ndarray, shape (4,)
        """
        away = (self.means - self.mean) @ contrast
        scale = np.sqrt(np.einsum("i,kij,j->k", contrast, self.covariances, contrast))

        def outside(half: float) -> float:
            both = stats.norm.sf((half - away) / scale) + stats.norm.sf((half + away) / scale)
            return float(self.weights @ both) - 0.05

        reach = float(np.max(np.abs(away) + 5.0 * scale))
        return float(optimize.brentq(outside, 0.0, reach))


def mixture(
    at: FloatArray,
    score: FloatArray,
    own: FloatArray,
    pull: FloatArray,
    information: FloatArray,
    away: FloatArray,
) -> Mixture:
    """Weigh every size of the wandering by how well it explains the groups of trials.

    Parameters
    ----------
    at : ndarray, shape (4,)
        Where score and information were taken; the law is linear about it.
    score : ndarray, shape (n_groups, 4)
    own : ndarray, shape (n_groups, 4, 4)
        Information of each group of trials that wander together, without wandering.
    pull : ndarray, shape (4,)
        Score of the prior.
    information : ndarray, shape (4, 4)
        Of the prior; zero without one.
    away : ndarray, shape (4, 4)
        How far from the prior's mean a person is taken to be, for the intervals: mean square.
    """
    log_weights, means, covariances = [], [], []
    for size in SIZES:
        evidence, softer, weaker = wandered(score, own, float(size))
        data = weaker.sum(axis=0)
        root = root_of_inverse(data + information)
        covariance = root @ root.T
        total = softer.sum(axis=0) + pull
        means.append(at + covariance @ total)
        covariances.append(covariance @ (data + information @ away @ information) @ covariance)
        explained = 0.5 * total @ covariance @ total + np.linalg.slogdet(root)[1]
        log_weights.append(evidence + explained - np.log1p((size / EXPECTED) ** 2))
    weights = np.exp(np.array(log_weights) - max(log_weights)) * np.gradient(SIZES)
    return Mixture(weights / weights.sum(), np.array(means), np.array(covariances))


def wandered(
    score: FloatArray, own: FloatArray, size: float
) -> tuple[float, FloatArray, FloatArray]:
    """Return the evidence, scores and information of groups whose cutoff wanders by a size.

    Parameters
    ----------
    score : ndarray, shape (n_groups, 4)
    own : ndarray, shape (n_groups, 4, 4)
    size : float
        Standard deviation of ln cutoff between groups.
    """
    spread = size**2 * ENDS
    growth = np.eye(2) + spread @ own[:, :2, :2]
    share = np.linalg.solve(growth, np.broadcast_to(spread, growth.shape))
    taken = np.einsum("gia,gab->gib", own[:, :, :2], share)
    along = np.einsum("ga,gab,gb->", score[:, :2], share, score[:, :2])
    evidence = 0.5 * float(along - np.sum(np.linalg.slogdet(growth)[1]))
    softer = score - np.einsum("gib,gb->gi", taken, score[:, :2])
    weaker = own - np.einsum("gib,gbj->gij", taken, own[:, :2, :])
    return evidence, softer, weaker


def root_of_inverse(information: FloatArray) -> FloatArray:
    """Return R with ``R R' = information^-1``.

    Raises
    ------
    EstimateError
        If the information leaves a parameter open.
    """
    scale = np.sqrt(np.maximum(np.diag(information), np.finfo(float).tiny))
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    if not values[0] > 1e-9:
        raise EstimateError(UNDETERMINED)
    root: FloatArray = (vectors / np.sqrt(values)) / scale[:, np.newaxis]
    return root


STRANGE: Final = float(stats.chi2.ppf(0.9999, coordinates.SIZE))
"""Squared distance from the prior beyond which it is not believed to speak of this person."""
FEWEST_CONDITIONS: Final = 6
"""From this many on, the trials of a condition are taken to wander together."""
UNKNOWN: Final = 1.0
"""A cutoff whose logarithm is not known better than this is not determined."""
_STEPS: Final = 60


@dataclass(frozen=True, slots=True)
class Posterior:
    """One person's law.

    Attributes
    ----------
    mixture : Mixture
        Of the person's `coordinates`. With a prior, its covariances are those of the error for
        a person whose cutoffs lie two standard deviations from the population.
    trials_used, trials_left_out : int
        How many.
    spread : GainScatter
        Of the gain, between trials and within.
    note : str
        Of the prior.
    """

    mixture: Mixture
    trials_used: int
    trials_left_out: int
    spread: GainScatter
    note: str

    @property
    def parameters(self) -> FloatArray:
        """The estimate, in `coordinates`, shape (4,)."""
        return self.mixture.mean

    @property
    def covariance(self) -> FloatArray:
        """Covariance of its error, shape (4, 4)."""
        return self.mixture.covariance

    def cutoff_hz(self, speed_mm_s: FloatArray) -> FloatArray:
        """Return the cutoff at each speed, Hz."""
        return coordinates.cutoff_hz(self.parameters, speed_mm_s)

    def relative_width(self, speed_mm_s: FloatArray) -> FloatArray:
        """Return half of the 95 % interval of the cutoff over its value, at each speed.

        Parameters
        ----------
        speed_mm_s : ndarray, shape (n,)
        """
        gradients = coordinates.cutoff_gradient(self.parameters, np.asarray(speed_mm_s, float))
        return np.array([self.mixture.half_width(gradient) for gradient in gradients])

    def interval_hz(self, speed_mm_s: FloatArray) -> FloatArray:
        """Return the 95 % interval of the cutoff at each speed, shape (n, 2), Hz."""
        half = self.relative_width(speed_mm_s)
        factors: FloatArray = np.exp(np.outer(half, (-1.0, 1.0)))
        return self.cutoff_hz(speed_mm_s)[:, np.newaxis] * factors

    def model(self, participant: str, validity: Validity, provenance: dict[str, Any]) -> Model:
        """Return the law as a document, with the covariance of its parameters.

        Parameters
        ----------
        participant : str
            Pseudonym.
        validity : Validity
            Speeds and forces at which the law holds.
        provenance : dict
            What is said of it besides what the estimate knows itself.

        Raises
        ------
        EstimateError
            If the cutoff, continued to rest, is not positive: no such model can be stored.
        """
        known = {
            "prior": self.note,
            "trials": self.trials_used,
            "trials_left_out": self.trials_left_out,
            "cutoff_spread_about_law": self.mixture.wandering,
            "gain_spread_between_trials": self.spread.trial,
            "gain_spread_within_trials": self.spread.segment,
        }
        return coordinates.document(
            self.parameters, self.covariance, participant, validity, known | provenance
        )


def estimate(observations: Sequence[TrialObservations], prior: Prior | None) -> Posterior:
    """Estimate one person's speed law.

    Parameters
    ----------
    observations : sequence of TrialObservations
        Of one person, one tone per trial or many; the invalid ones are left out and counted.
    prior : Prior or None
        None: the trials alone. A prior that the trials contradict is dropped, and `note` says
        so: that of another rig's delay, say.

    Raises
    ------
    EstimateError
        If no trial is valid, if they are of several people, or do not determine the law.
    """
    data = Data.of(observations)
    left_out = len(observations) - data.n_trials
    try:
        return _fit(data, left_out, prior)
    except ContradictionError:
        if prior is None:
            raise
    note = f"dropped, as the trials contradict it ({prior.note})"
    return replace(_fit(data, left_out, None), note=note)


def _fit(data: Data, left_out: int, prior: Prior | None) -> Posterior:
    nothing = np.zeros((coordinates.SIZE, coordinates.SIZE))
    information = nothing if prior is None else prior.information
    mean = (prior or Prior.weak()).mean
    at, spread, weights = start(data, mean), GainScatter(), np.ones(data.tone_hz.size)
    for _ in range(3):  # scatter from the fit, weights from the scatter: twice is enough
        at = _settle(data, at, spread, weights, mean, information)
        spread, weights = spread_of(data, at)
    at = _settle(data, at, spread, weights, mean, information)
    pull = information @ (mean - at)
    if (mean - at) @ pull > STRANGE:
        raise ContradictionError("the person is too far from what the prior says")
    score, own = _together(data, *scores(data, at, spread, weights))
    away = nothing if prior is None else prior.far_away
    mixed = mixture(at, score, own, pull, information, away)
    if not np.all(np.diag(mixed.covariance)[:2] < UNKNOWN**2):
        raise EstimateError(UNDETERMINED)
    note = "none" if prior is None else prior.note
    return Posterior(mixed, data.n_trials, left_out, spread, note)


def _together(data: Data, score: FloatArray, own: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return score and information of what wanders together: conditions, or else trials."""
    n = int(data.condition_of_trial.max()) + 1
    if n < FEWEST_CONDITIONS:
        return score, own
    scores_of, own_of = np.zeros((n, *score.shape[1:])), np.zeros((n, *own.shape[1:]))
    np.add.at(scores_of, data.condition_of_trial, score)
    np.add.at(own_of, data.condition_of_trial, own)
    return scores_of, own_of


def _settle(
    data: Data,
    at: FloatArray,
    spread: GainScatter,
    weights: FloatArray,
    mean: FloatArray,
    information: FloatArray,
) -> FloatArray:
    """Return where Gauss-Newton ends from `at`, with spread and weights fixed.

    The expected wandering is let in: without it the fit would bend to what is only wandering.
    """
    limit = np.array([0.5, 0.5, 0.5, 50e-6])
    for turn in range(_STEPS):
        raw = _together(data, *scores(data, at, spread, weights))
        _, score, own = wandered(*raw, EXPECTED)
        total = own.sum(axis=0) + information
        root = root_of_inverse(total)
        step = root @ (root.T @ (score.sum(axis=0) + information @ (mean - at)))
        step /= max(1.0, float(np.max(np.abs(step) / limit)))
        at = at + (step if turn < _STEPS // 3 else 0.5 * step)
        if step @ total @ step < 1e-4:
            return at
    raise ContradictionError(
        "the fit does not settle: the trials contradict each other; repeat them"
    )
