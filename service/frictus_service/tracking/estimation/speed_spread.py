"""How much the speeds of a finger differ, beside the errors by which they are known.

Of a finger that keeps to one speed, windows differ by the errors of their speeds alone, and its
cutoff does not follow these: a law fitted to them says, ever more certainly, that the cutoff
depends on no speed at all. Regression on what is known with errors makes a slope too small by
their share of the variance (Carroll, Ruppert, Stefanski, Crainiceanu, Measurement Error in
Nonlinear Models, 2nd ed., 2006, section 1.1: attenuation).
"""

from dataclasses import dataclass
from typing import Final, Self

import numpy as np

from frictus_hardware.arrays import BoolArray, FloatArray

ERROR_MM_S: Final = 0.4
"""Standard deviation of the speed of a window, from touch reports in steps of 0.1 mm."""
STEADY_MM_S: Final = 1.5
"""Standard deviation of a finger's speeds below which they tell no slope."""
AROUND_MM_S: Final = 2.0 * STEADY_MM_S
"""Windows of a steady finger that are farther from its mean than this have their own speed."""


@dataclass(frozen=True, slots=True)
class SpeedSpread:
    """Of the speeds of all windows of a finger.

    Attributes
    ----------
    windows : int
        How many.
    mean_mm_s, variance : float
        Of their speeds, in mm/s and mm²/s².
    """

    windows: int = 0
    mean_mm_s: float = 0.0
    variance: float = 0.0

    def seen(self, speed_mm_s: FloatArray) -> Self:
        """Return that with further windows.

        Parameters
        ----------
        speed_mm_s : ndarray, shape (n_windows,)
            One at least.
        """
        windows = self.windows + speed_mm_s.size
        share = speed_mm_s.size / windows
        away = float(speed_mm_s.mean()) - self.mean_mm_s
        within = (1.0 - share) * self.variance + share * float(speed_mm_s.var())
        return type(self)(
            windows, self.mean_mm_s + share * away, within + share * (1.0 - share) * away**2
        )

    def keeping(self, speed_mm_s: FloatArray) -> BoolArray:
        """Return which windows have the one speed of a steady finger, (n_windows,).

        Parameters
        ----------
        speed_mm_s : ndarray, shape (n_windows,)
            As measured.
        """
        near: BoolArray = np.abs(speed_mm_s - self.mean_mm_s) < AROUND_MM_S
        return near & self.steady

    @property
    def steady(self) -> bool:
        """Whether the finger keeps to one speed; not known before it slid."""
        return self.windows > 0 and self.variance < STEADY_MM_S**2

    @property
    def attenuation(self) -> float:
        """By which share a slope may be too small; 0 of one speed, which tells none."""
        return ERROR_MM_S**2 / self.variance if self.windows and not self.steady else 0.0
