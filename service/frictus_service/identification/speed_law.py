"""One participant's speed law: ``cutoff = cutoff_0 + slope |v|`` (paper, Equation 9)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from frictus_service.identification.combination import (
    Combination,
    Evidence,
    combine,
    settle,
)
from frictus_service.identification.friction_fit import CUTOFF, GAIN

FloatArray = NDArray[np.float64]

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


def estimate(evidence: Evidence) -> SpeedLaw:
    """Estimate the speed law from conditions at two speeds at least.

    Parameters
    ----------
    evidence : Evidence
        Its parameters are gain (N) and cutoff (Hz).
    """
    n = evidence.speed_mm_s.size
    # Around the mean speed intercept and slope do not share their errors.
    centre = float(np.mean(evidence.speed_mm_s))
    design = np.column_stack([np.ones(n), evidence.speed_mm_s - centre])
    line = settle(design, evidence, CUTOFF)
    gain = settle(np.ones((n, 1)), evidence, GAIN)
    maps = np.zeros((3, n, 2))
    maps[0, :, GAIN] = gain.linear[0]
    maps[1:, :, CUTOFF] = np.array([[1.0, -centre], [0.0, 1.0]]) @ line.linear
    return SpeedLaw(
        combine(evidence, maps, np.array([gain.excess, line.excess])),
        float(np.sqrt(line.excess)),
    )
