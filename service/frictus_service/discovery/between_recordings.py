"""Resonances over several recordings of one mount: what holds for another recording of it.

A mount is screwed anew, warms up, is struck elsewhere: its resonance differs from recording to
recording by more than within one. Random effect of the recording: its variance by restricted
likelihood, the interval of the mean by Student's t with the scale of Hartung and Knapp (2001),
never below what the recordings' own errors demand (Röver, Knapp and Friede 2015); the interval
of another recording after Higgins, Thompson and Spiegelhalter (2009), its own error included,
with n - 1 degrees of freedom.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_service.discovery.ring_down import SAME, Resonance, RingDownError

LEAST_RECORDINGS: Final = 2


@dataclass(frozen=True, slots=True)
class Between:
    """A quantity over recordings, 95 % intervals.

    Attributes
    ----------
    mean : float
        Of all recordings, in the quantity's own unit.
    standard_error : float
        Of the mean.
    ci : tuple of float
        Of the mean.
    another : tuple of float
        Within which one more recording's estimate lies, if it is as exact as these.
    sd : float
        Between recordings.
    """

    mean: float
    standard_error: float
    ci: tuple[float, float]
    another: tuple[float, float]
    sd: float


def between(values: FloatArray, errors: FloatArray) -> Between:
    """Return the mean of several recordings, and where another one would lie.

    Parameters
    ----------
    values, errors : ndarray, shape (n_recordings,)
        Of each recording, with the standard error within it; two at least.
    """
    from scipy import stats

    variance = between_variance(values, errors)
    total = np.square(errors) + variance
    if not total.all():  # equal values, one of them without any error
        total = np.ones_like(values)
    weight = 1.0 / total
    mean = float(weight @ values / weight.sum())
    scale = float(weight @ np.square(values - mean)) / (values.size - 1)
    error = float(np.sqrt(max(scale, 1.0 if errors.any() else 0.0) / weight.sum()))
    t = float(stats.t.ppf(0.975, values.size - 1))
    half, wide = t * error, t * float(np.sqrt(error**2 + variance + np.mean(np.square(errors))))
    return Between(
        mean, error, (mean - half, mean + half), (mean - wide, mean + wide), variance**0.5
    )


def between_variance(values: FloatArray, errors: FloatArray) -> float:
    """Return the variance between recordings that has the highest restricted likelihood.

    Parameters
    ----------
    values, errors : ndarray, shape (n_recordings,)
        Of each recording, with the standard error within it.
    """
    from scipy.optimize import minimize_scalar

    unit = float(np.ptp(values))
    if unit == 0.0:
        return 0.0
    own = np.square(errors / unit)

    def loss(sd: float) -> float:
        weight = 1.0 / np.maximum(own + sd**2, 1e-18)
        mean = weight @ values / weight.sum()
        squares = float(weight @ np.square((values - mean) / unit))
        return squares - float(np.log(weight).sum()) + float(np.log(weight.sum()))

    # The largest that fits is that of two values without errors: their range over sqrt(2).
    best = float(minimize_scalar(loss, bounds=(0.0, 1.0), method="bounded").x)
    return 0.0 if loss(0.0) <= loss(best) else (best * unit) ** 2


def between_recordings(recordings: Sequence[Sequence[Resonance]]) -> list[Resonance]:
    """Return the resonances that all recordings show, by rising frequency.

    Parameters
    ----------
    recordings : sequence of sequence of Resonance
        Of the same mount, two at least, each as `estimate_ring_down` returns it.

    Raises
    ------
    RingDownError
        If there are fewer than two recordings, or none of the resonances is in all of them.
    """
    if len(recordings) < LEAST_RECORDINGS:
        raise RingDownError(
            f"{len(recordings)} recordings; accepted: {LEAST_RECORDINGS} at least"
        )
    shared = [
        one for first in recordings[0] if (one := _partners(first, recordings)) is not None
    ]
    if not shared:
        raise RingDownError(
            f"no resonance is in all {len(recordings)} recordings within {SAME:.0%}: are they "
            "of the same mount and axis?"
        )
    return [_combined(each) for each in shared]


def _partners(
    first: Resonance, recordings: Sequence[Sequence[Resonance]]
) -> list[Resonance] | None:
    """Return one resonance in all recordings; None where it is not in one of them."""
    partners = [first]
    for other in recordings[1:]:
        nearest = min(other, key=lambda one: _apart(one, first))
        back = min(recordings[0], key=lambda one: _apart(one, nearest))
        if back is not first or _apart(nearest, first) > SAME:
            return None
        partners.append(nearest)
    return partners


def _apart(one: Resonance, other: Resonance) -> float:
    """Return the relative distance of two poles."""
    return float(
        np.hypot(
            one.frequency_hz / other.frequency_hz - 1.0, one.damping_ratio - other.damping_ratio
        )
    )


def _combined(same: Sequence[Resonance]) -> Resonance:
    hz = between(
        np.array([one.frequency_hz for one in same]),
        np.array([one.frequency_se_hz for one in same]),
    )
    # Damping by its logarithm: it is above zero, and so are its intervals.
    log = between(
        np.log([one.damping_ratio for one in same]),
        np.array([one.damping_ratio_se / one.damping_ratio for one in same]),
    )
    damping = float(np.exp(log.mean))
    return Resonance(
        frequency_hz=hz.mean,
        frequency_ci_hz=hz.ci,
        damping_ratio=damping,
        damping_ratio_ci=(float(np.exp(log.ci[0])), float(np.exp(log.ci[1]))),
        level_db=float(np.mean([one.level_db for one in same])),
        frequency_se_hz=hz.standard_error,
        damping_ratio_se=damping * log.standard_error,
        another_frequency_hz=hz.another,
        another_damping_ratio=(float(np.exp(log.another[0])), float(np.exp(log.another[1]))),
    )
