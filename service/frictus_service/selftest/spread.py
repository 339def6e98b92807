"""The mean of repeated estimates, and how well it is known."""

import math

import numpy as np
from scipy.special import stdtrit

from frictus_hardware.arrays import FloatArray


def mean_and_half(values: FloatArray) -> tuple[float, float]:
    """Return the mean of independent estimates and half of its 95 % interval.

    Parameters
    ----------
    values : ndarray, shape (n_estimates,)
        Two or more.
    """
    spread = float(np.std(values, ddof=1))
    return float(np.mean(values)), half_width(spread / math.sqrt(values.size), values.size - 1)


def half_width(standard_error: float, degrees_of_freedom: int) -> float:
    """Return half of the 95 % interval of Student's t."""
    return standard_error * float(stdtrit(degrees_of_freedom, 0.975))
