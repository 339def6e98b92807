"""Psychometric functions: the probability of a response over the level of a stimulus.

Levels are positive and enter by their logarithm, so that one formula serves amplitudes in N and
differences in dB:

    p(x) = guess + (1 - guess - lapse) F(slope (log10 x - log10 threshold))

with F(z) = 1 - exp(-10^z) for a Weibull function (Watson 2017, Journal of Vision 17(3):10) and
F(z) = 1 / (1 + 10^-z) for a logistic one.
"""

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from frictus.errors import ArgumentError

FloatArray = NDArray[np.float64]
Family = Literal["weibull", "logistic"]

LAPSE_FLOOR: Final = 0.005
"""Least lapse rate that a fit or a procedure considers: with 0, a single slip of attention at a
high level would rule out every low threshold for good."""
_HALF: Final = {"weibull": float(np.log10(np.log(2.0))), "logistic": 0.0}
"""z at which F is 0.5."""


def probability(
    level: ArrayLike,
    threshold: ArrayLike,
    slope: ArrayLike,
    guess: ArrayLike,
    lapse: ArrayLike,
    family: Family = "weibull",
) -> FloatArray:
    """Return the probability of the response; the arguments broadcast.

    Parameters
    ----------
    level : array_like
        0 or above.
    threshold : array_like
        Level at which F is 1 - 1/e (Weibull) or 0.5 (logistic), above 0.
    slope : array_like
        Above 0.
    guess, lapse : array_like
        Probability at level 0, and 1 minus the one at the highest levels; 0 to 1.
    family : {'weibull', 'logistic'}
        The function F.

    Returns
    -------
    ndarray
        0 to 1, of the shape that the arguments broadcast to.
    """
    logarithm = np.log10(np.maximum(level, 1e-300))
    z = np.asarray(slope) * (logarithm - np.log10(threshold))
    rise = 10.0 ** np.clip(z, -300.0, 300.0)
    core = -np.expm1(-rise) if family == "weibull" else rise / (1.0 + rise)
    lower, upper = np.asarray(guess, float), 1.0 - np.asarray(lapse, float)
    return np.asarray(lower + (upper - lower) * core, dtype=np.float64)


def threshold_of(
    half_level: ArrayLike, slope: ArrayLike, family: Family = "weibull"
) -> FloatArray:
    """Return the threshold of the function whose F is 0.5 at a level.

    In a task of two alternatives that is the level of 75 % correct answers, lapses apart.

    Parameters
    ----------
    half_level : array_like
        Level at which F is 0.5, above 0.
    slope : array_like
        Above 0.
    family : {'weibull', 'logistic'}
        The function F.
    """
    return np.asarray(half_level) * 10.0 ** (-_HALF[family] / np.asarray(slope, np.float64))


@dataclass(frozen=True, slots=True)
class ParameterGrid:
    """Candidate psychometric functions and their prior probabilities.

    Attributes
    ----------
    thresholds, slopes, guesses, lapses : ndarray, shape (n_candidates,)
        Parameters of `probability`.
    prior : ndarray, shape (n_candidates,)
        Probabilities; they sum to 1.
    family : {'weibull', 'logistic'}
        The function F.
    """

    thresholds: FloatArray
    slopes: FloatArray
    guesses: FloatArray
    lapses: FloatArray
    prior: FloatArray
    family: Family = "weibull"

    @classmethod
    def of(
        cls,
        half_levels: ArrayLike,
        slopes: ArrayLike,
        guesses: ArrayLike,
        lapses: ArrayLike,
        family: Family = "weibull",
    ) -> "ParameterGrid":
        """Return all combinations, each as probable as the others.

        Parameters
        ----------
        half_levels : array_like
            Levels at which F is 0.5, above 0.
        slopes, guesses, lapses : array_like
            As in `probability`; the lapses at least `LAPSE_FLOOR`.
        family : {'weibull', 'logistic'}
            The function F.

        Raises
        ------
        ArgumentError
            If a value is out of range.
        """
        axes = [np.asarray(axis, float).ravel() for axis in (half_levels, slopes)]
        rates = [np.asarray(axis, float).ravel() for axis in (guesses, lapses)]
        if not all(axis.size and np.all(axis > 0.0) for axis in axes):
            raise ArgumentError("levels and slopes of a parameter grid are above 0")
        if not (np.all(rates[1] >= LAPSE_FLOOR) and np.all(rates[1] <= 0.5)):
            raise ArgumentError(
                f"lapse rates {rates[1]}: {LAPSE_FLOOR} to 0.5 are accepted; with 0 one slip "
                "of attention would rule out the true threshold"
            )
        if not (np.all(rates[0] >= 0.0) and np.all(rates[0] < 0.5 + 1e-9)):
            raise ArgumentError(f"guess rates {rates[0]}: 0 to 0.5 are accepted")
        half, slope, guess, lapse = (
            each.ravel() for each in np.meshgrid(*axes, *rates, indexing="ij")
        )
        return cls(
            threshold_of(half, slope, family),
            slope,
            guess,
            lapse,
            np.full(half.size, 1.0 / half.size),
            family,
        )

    def probabilities(self, levels: ArrayLike) -> FloatArray:
        """Return what each candidate predicts, shape (n_levels, n_candidates).

        Parameters
        ----------
        levels : array_like, shape (n_levels,)
            Above 0.
        """
        columns = np.asarray(levels, float)[:, np.newaxis]
        return probability(
            columns, self.thresholds, self.slopes, self.guesses, self.lapses, self.family
        )
