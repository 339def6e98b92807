"""From conditions to one participant: the speed law, averages and straight lines.

Averages and straight lines over one participant's conditions, with their uncertainty.

Conditions differ by more than their sampling errors, so both enter the weights; neither hangs
on a condition's own estimate, as a cutoff that came out low claims to be more certain.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy import stats

from frictus_hardware.arrays import FloatArray, IntArray
from frictus_service.identification.fit.grouped_errors import freedom_of_sum
from frictus_service.identification.fit.transfer_functions import CUTOFF, GAIN

_PASSES = 8
_LEAST_SHARE = 0.1


@dataclass(frozen=True, slots=True)
class ConditionEvidence:
    """What is known of one participant's conditions.

    Attributes
    ----------
    speed_mm_s : ndarray, shape (n_conditions,)
        Measured.
    value : ndarray, shape (n_conditions, p)
        Parameters, all positive.
    relative_variance : ndarray, shape (n_conditions, p)
        Of the parameters, typical of such a condition.
    influence : ndarray, shape (n_trials, p)
        Relative change of its condition's parameters that each trial causes.
    condition_of_trial : ndarray of int, shape (n_trials,)
    delay_s : float
        Shared by all conditions of a participant.
    delay_influence : ndarray, shape (n_trials,)
    delay_gradient : ndarray, shape (n_conditions, p)
        Relative change of the parameters per second of delay.
    rival_shift : ndarray, shape (n_conditions, p)
        Relative change of the parameters to a second solution that explains the data alike.
    rival_delay_shift_s : float
        Change of the delay to it.
    """

    speed_mm_s: FloatArray
    value: FloatArray
    relative_variance: FloatArray
    influence: FloatArray
    condition_of_trial: IntArray
    delay_s: float
    delay_influence: FloatArray
    delay_gradient: FloatArray
    rival_shift: FloatArray
    rival_delay_shift_s: float

    @property
    def degrees_of_freedom(self) -> float:
        """Of a straight line over the conditions; few conditions: of the trials in them."""
        n, p = self.value.shape
        left = n - 2 if n > 2 else self.condition_of_trial.size - p * n - 1
        return float(max(left, 1))


@dataclass(frozen=True, slots=True)
class Combination:
    """Linear combinations of conditions, the delay last.

    Attributes
    ----------
    value : ndarray, shape (q + 1,)
    covariance : ndarray, shape (q + 1, q + 1)
        Sampling error clustered by trial, plus what conditions differ by, plus the square of
        what a second solution differs by.
    degrees_of_freedom : ndarray, shape (q + 1,)
    """

    value: FloatArray
    covariance: FloatArray
    degrees_of_freedom: FloatArray

    @property
    def half_width(self) -> FloatArray:
        """Half of the 95 % intervals, by t."""
        factor = stats.t.ppf(0.975, self.degrees_of_freedom)
        half: FloatArray = factor * np.sqrt(np.diag(self.covariance))
        return half


@dataclass(frozen=True, slots=True)
class Line:
    """Weighted least squares as a linear map.

    Attributes
    ----------
    linear : ndarray, shape (k, n_conditions)
        Coefficients are this times the values.
    excess : float
        Variance of the values around the line beyond their sampling error.
    """

    linear: FloatArray
    excess: float


def combine(evidence: ConditionEvidence, maps: FloatArray, excess: FloatArray) -> Combination:
    """Return linear combinations of the conditions' parameters, and the delay.

    Parameters
    ----------
    evidence : ConditionEvidence
        Values of one participant's conditions.
    maps : ndarray, shape (q, n_conditions, p)
    excess : ndarray, shape (p,)
        Variance of each parameter between conditions.
    """
    relative = maps * evidence.value
    by_delay = np.append(np.einsum("qci,ci->q", relative, evidence.delay_gradient), 1.0)
    pulls = np.multiply.outer(evidence.delay_influence, by_delay)
    pulls[:, :-1] += np.einsum(
        "qti,ti->tq", relative[:, evidence.condition_of_trial], evidence.influence
    )
    covariance = pulls.T @ pulls
    # All conditions move to a second solution together.
    shift = np.einsum("qci,ci->q", relative, evidence.rival_shift)
    shift = np.append(shift, evidence.rival_delay_shift_s)
    covariance += np.outer(shift, shift)
    covariance[:-1, :-1] += np.einsum("qci,rci,i->qr", maps, maps, excess)
    value = np.append(relative.sum(axis=(1, 2)), evidence.delay_s)
    return Combination(value, covariance, np.full(value.size, evidence.degrees_of_freedom))


def levels(evidence: ConditionEvidence) -> Combination:
    """Return all parameters at the mean speed of the conditions, and the delay.

    Parameters
    ----------
    evidence : ConditionEvidence
        Values of one participant's conditions.
    """
    n, p = evidence.value.shape
    centred = evidence.speed_mm_s - evidence.speed_mm_s.mean()
    sloped = n > 2 and np.ptp(centred) > 0.2 * evidence.speed_mm_s.mean()
    design = np.column_stack([np.ones(n), centred])[:, : 2 if sloped else 1]
    maps, excess = np.zeros((p, n, p)), np.zeros(p)
    for i in range(p):
        line = settle(design, evidence, i)
        maps[i, :, i], excess[i] = line.linear[0], line.excess
    return combine(evidence, maps, excess)


def settle(design: FloatArray, evidence: ConditionEvidence, parameter: int) -> Line:
    """Fit one parameter of the conditions, weighted by sampling error and excess.

    Parameters
    ----------
    design : ndarray, shape (n_conditions, k)
    evidence : ConditionEvidence
        Values of one participant's conditions.
    parameter : int
        Column of `ConditionEvidence.value`.
    """
    value = evidence.value[:, parameter]
    linear = np.asarray(np.linalg.pinv(design), dtype=np.float64)
    excess = 0.0
    lowest = _LEAST_SHARE * float(np.median(value))
    for _ in range(_PASSES):
        fitted = np.maximum(design @ (linear @ value), lowest)
        sampling = evidence.relative_variance[:, parameter] * np.square(fitted)
        excess = _excess(design, value, linear, sampling)
        weighted = (design / (sampling + excess)[:, np.newaxis]).T
        linear = np.asarray(np.linalg.solve(weighted @ design, weighted), dtype=np.float64)
    return Line(linear, excess)


def _excess(
    design: FloatArray, value: FloatArray, linear: FloatArray, sampling: FloatArray
) -> float:
    """Return by how much residuals scatter beyond sampling; 0 where nothing is left to tell."""
    n, k = design.shape
    if n <= k:
        return 0.0
    rest = np.eye(n) - design @ linear
    residual = rest @ value
    expected = float(np.einsum("ij,ij,j->", rest, rest, sampling))
    each = float(np.einsum("ij,ij->", rest, rest))
    return max((float(residual @ residual) - expected) / each, 0.0)


NAMES = ("gain_n", "cutoff_0_hz", "slope_hz_per_mm_s", "skew_s")
"""Order of the estimates, as a model's covariance names them."""


@dataclass(frozen=True, slots=True)
class SpeedLaw:
    """A speed law.

    Attributes
    ----------
    estimates : Combination
        In the order of `NAMES`; the gain is the mean over conditions.
    excess_hz : float
        Standard deviation of the conditions' cutoffs around the law beyond sampling error.
    """

    estimates: Combination
    excess_hz: float

    @property
    def slope_hz_per_mm_s(self) -> float:
        """The slope."""
        return float(self.estimates.value[2])

    def cutoff_hz(self, speed_mm_s: FloatArray) -> FloatArray:
        """Return the cutoff at each speed, Hz."""
        line: FloatArray = self.estimates.value[1] + self.slope_hz_per_mm_s * speed_mm_s
        return line


def estimate(evidence: ConditionEvidence) -> SpeedLaw:
    """Estimate the speed law from conditions at two speeds at least.

    Parameters
    ----------
    evidence : ConditionEvidence
        Its parameters are gain (N) and cutoff (Hz).
    """
    n = evidence.speed_mm_s.size
    # Around the mean speed intercept and slope do not share their errors.
    centre = float(np.mean(evidence.speed_mm_s))
    design = np.column_stack([np.ones(n), evidence.speed_mm_s - centre])
    line = settle(design, evidence, CUTOFF)
    # A gain that leans with speed has its mean at the mean speed, and does not scatter for it.
    gain = settle(design[:, : 2 if n > 2 else 1], evidence, GAIN)
    maps = np.zeros((3, n, 2))
    maps[0, :, GAIN] = gain.linear[0]
    maps[1:, :, CUTOFF] = np.array([[1.0, -centre], [0.0, 1.0]]) @ line.linear
    found = combine(evidence, maps, np.array([gain.excess, line.excess]))
    between = gain.excess * float(np.square(gain.linear[0]).sum())
    freedom = found.degrees_of_freedom.copy()
    freedom[0] = _freedom_of_gain(evidence, found.covariance[0, 0], between)
    return SpeedLaw(replace(found, degrees_of_freedom=freedom), float(np.sqrt(line.excess)))


def _freedom_of_gain(evidence: ConditionEvidence, variance: float, between: float) -> float:
    """Return the degrees of freedom of a variance made of two (Satterthwaite).

    Every trial says how large the response is, and they scatter alike: there are as many as
    trials are left after the fit. Of how conditions differ, the conditions alone tell.
    """
    if not variance > 0.0:
        return evidence.degrees_of_freedom
    n, p = evidence.value.shape
    trials = max(evidence.condition_of_trial.size - n * p, 1)
    known = evidence.degrees_of_freedom
    return float(freedom_of_sum(variance - between, trials, between, known))
