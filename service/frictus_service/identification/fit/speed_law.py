"""One participant's speed law: ``cutoff = cutoff_0 + slope |v|`` (paper, Equation 9)."""

from dataclasses import dataclass, replace

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_service.identification.fit.across_conditions import (
    Combination,
    ConditionEvidence,
    combine,
    settle,
)
from frictus_service.identification.fit.friction_fit import CUTOFF, GAIN

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
    sampling = variance - between
    spread = sampling**2 / trials + between**2 / evidence.degrees_of_freedom
    return float(variance**2 / spread)
