"""Log likelihood ratios of every cause, from sums of score and information.

One process begins every ten seconds, and each has a share of the chance of an alarm.
"""

from dataclasses import dataclass, replace
from typing import Final, Self

import numpy as np
from scipy.special import log_ndtr

from frictus_hardware.arrays import FloatArray
from frictus_service.tracking.evidence.mains_line import AMPLITUDES_N
from frictus_service.tracking.evidence.signatures import (
    EFFECT_CAUSES,
    LAW_CAUSES,
    LAW_SIZES,
    PATTERN_SIZE,
    PATTERNS,
    SHAPED,
    SIZES,
)

UNMODELLED: Final = 0.0015
"""Relative error of the response, rms over bands, that lasts and that no cause has: a window is
not infinitely long, the speed changes within it, and a mount rings."""

_EDGE: Final = np.array(
    [SIZES[name].tolerated / SIZES[name].expected for name in EFFECT_CAUSES]
)
_LAW_EDGE: Final = np.array([size.tolerated / size.expected for size in LAW_SIZES])
_FOLLOWS_SPEED: Final = np.array([name == "speed_dependent_cutoff" for name in LAW_CAUSES])
_PATTERN_EDGE: Final = PATTERN_SIZE.tolerated / PATTERN_SIZE.expected


@dataclass(frozen=True, slots=True)
class Sums:
    """Score and information of each process so far.

    Attributes
    ----------
    score, information : ndarray, shapes (n_begun, d) and (n_begun, d, d)
        Of effects, against any law.
    law_score, law_information : ndarray, shapes (n_begun, n_law, d + 1) and so on
        Of effects and, last, of each of `LAW_CAUSES`, against the model in force.
    pattern_score, pattern_information : ndarray, shape (n_begun, n_patterns)
    mains : ndarray, shape (n_begun, 2, n_amplitudes)
        Log likelihood ratios.
    certainty : ndarray, shape (n_begun,)
        Of all responses: inverse relative variances.
    log_share : ndarray, shape (n_begun, n_causes)
        Of the chance of an alarm, that each process has, by cause: `LAW_CAUSES`, effects, the
        mains and what is unknown. -inf: what it has seen was of another finger or model.
    """

    score: FloatArray
    information: FloatArray
    law_score: FloatArray
    law_information: FloatArray
    pattern_score: FloatArray
    pattern_information: FloatArray
    mains: FloatArray
    certainty: FloatArray
    log_share: FloatArray

    @classmethod
    def zeros(cls, count: int) -> Self:
        """Return the sums of so many processes that begin.

        Parameters
        ----------
        count : int
            Of processes.
        """
        d, patterns, law = len(EFFECT_CAUSES), len(PATTERNS), len(LAW_CAUSES)
        shapes: tuple[tuple[int, ...], ...] = (
            (d,),
            (d, d),
            (law, d + 1),
            (law, d + 1, d + 1),
            (patterns,),
            (patterns,),
            (2, AMPLITUDES_N.size),
            (),
            (law + d + 2,),
        )
        return cls(*(np.zeros((count, *shape)) for shape in shapes))

    def arrays(self) -> tuple[FloatArray, ...]:
        """Return all of them, in order."""
        return tuple(getattr(self, name) for name in self.__slots__)

    def log_evidence(self) -> FloatArray:
        """Return log share times ratio, shape (n_begun, n_causes)."""
        slack = self.slack(_diagonal(self.information)) * SHAPED
        effects = log_ratio(self.score, _diagonal(self.information), _EDGE, slack)
        known = self.law_information[..., -1, -1]
        law = log_ratio(
            self.law_score[..., -1], known, _LAW_EDGE, self.slack(known) * _FOLLOWS_SPEED
        )
        unknown = _mean(self.patterns())
        mains = _mean(self.mains.reshape(self.mains.shape[0], -1))
        each: FloatArray = np.column_stack([law, effects, mains, unknown]) + self.log_share
        return each

    def patterns(self) -> FloatArray:
        """Return the log likelihood ratio of each pattern, shape (n_begun, n_patterns)."""
        information = self.pattern_information
        return log_ratio(
            self.pattern_score, information, _PATTERN_EDGE, self.slack(information)
        )

    def slack(self, information: FloatArray) -> FloatArray:
        """Return how large a score errors of `UNMODELLED` can make at most (Cauchy-Schwarz).

        Parameters
        ----------
        information : ndarray, shape (n_begun, d)
            Of each deviation.
        """
        both = self.certainty[:, np.newaxis] * np.maximum(information, 0.0)
        bound: FloatArray = UNMODELLED * np.sqrt(both)
        return bound


def with_another(sums: Sums, begun: int) -> Sums:
    """Return the sums with those of a process that begins.

    Parameters
    ----------
    sums : Sums
        Of those that have begun.
    begun : int
        Its number in the session, from 1.
    """
    # The shares 6 / (pi k)^2 of all that will ever begin sum to 1.
    share = np.log(6.0) - 2.0 * np.log(np.pi * begun)
    fresh = Sums.zeros(1)
    fresh = replace(fresh, log_share=fresh.log_share + share)
    both = zip(sums.arrays(), fresh.arrays(), strict=True)
    return Sums(*(np.concatenate(pair) for pair in both))


def log_ratio(
    score: FloatArray,
    information: FloatArray,
    edge: FloatArray | float,
    slack: FloatArray | float = 0.0,
) -> FloatArray:
    """Return the log of the likelihood ratio, averaged over both signs and half-normal sizes.

    Parameters
    ----------
    score, information : ndarray
        Of a deviation per its expected size.
    edge : float or ndarray
        Of what is tolerated, likewise.
    slack : float or ndarray
        Part of the score that may be an error that lasts.
    """
    information = np.maximum(information, 0.0)
    width = 1.0 + information
    sides = np.stack([score, -score]) - edge * information - slack
    each = 0.5 * np.square(sides) / width + log_ndtr(sides / np.sqrt(width))
    ratio: FloatArray = np.logaddexp.reduce(each, axis=0) - 0.5 * np.log(width)
    return ratio


def _mean(log_ratios: FloatArray) -> FloatArray:
    """Return the log of the mean of ratios, shape (n_begun,)."""
    mean: FloatArray = np.logaddexp.reduce(log_ratios, axis=1) - np.log(log_ratios.shape[1])
    return mean


def _diagonal(matrices: FloatArray) -> FloatArray:
    return np.diagonal(matrices, axis1=-2, axis2=-1)
