"""Where in a band the drive of one window lies: mean and variance of its frequencies.

Of a window that is tapered, friction times the conjugate of the drive is, summed over a band,
the sum of a response over all frequencies, weighted by what they have in the band. What a
window's frequencies have of a texture's line is not alike in phase, so that these weights are
complex, and mean and variance, too: to second order the sum is the response at the mean, and
half of its curvature times the variance. With the real part of the mean alone, responses beside
a line are off by 0.1 to 1 %, always to the same side; a finger that keeps to one speed is then
taken for another, since nothing but these bands tells its cutoff from its delay.

How the drive turns from one sample to the next tells both, as the first two cumulants of these
weights (the mean alone: Auger and Flandrin 1995, reassignment).
"""

from typing import Final

import numpy as np

from frictus_hardware.arrays import ComplexArray, FloatArray
from frictus_service.discovery.evidence.bands import WINDOW_S, Bands
from frictus_service.discovery.evidence.window_spectra import LEAST_HZ

MOST_DECAY_HZ: Final = 1.0 / WINDOW_S
"""By a factor of 500 within a window; noise alone may say anything."""


def shifted(drive: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the drive of a window a sample earlier and a sample later, to be tapered as it is.

    Parameters
    ----------
    drive : ndarray, shape (n_samples,)
        What was before and after is taken to lie on a straight line, where the taper is nearly
        zero: a step there would be seen beside a line.
    """
    before, after = 2.0 * drive[0] - drive[1], 2.0 * drive[-1] - drive[-2]
    return np.append(before, drive[:-1]), np.append(drive[1:], after)


def frequencies(
    bands: Bands,
    power: FloatArray,
    earlier: ComplexArray,
    later: ComplexArray,
    rate_hz: float,
) -> tuple[ComplexArray, ComplexArray]:
    """Return mean and variance of the frequencies that have a part in each band.

    Parameters
    ----------
    bands : Bands
        Of the window.
    power : ndarray, shape (n_bands,)
        Of the drive.
    earlier, later : ndarray of complex, shape (n_bands,)
        Conjugate of the drive's spectrum times that of the drive as `shifted`, summed.
    rate_hz : float
        Samples per second.

    Returns
    -------
    mean_hz : ndarray of complex, shape (n_bands,)
        Imaginary part: what has a part in the band dies away so fast, over 2 pi; within
        `MOST_DECAY_HZ`. The centre of a band without power.
    variance_hz2 : ndarray of complex, shape (n_bands,)
        At most of a band that is wider by a window's frequency.
    """
    each = 1.0 / np.maximum(power, np.finfo(float).tiny)
    back, forth = (
        np.log(np.where(turned == 0.0, 1.0, turned * each)) for turned in (earlier, later)
    )
    per_radian_hz = rate_hz / (2.0 * np.pi)
    mean_hz = per_radian_hz * (forth - back) / 2j
    at_hz = np.where(power > 0.0, np.maximum(mean_hz.real, LEAST_HZ), bands.centre_hz)
    decay_hz = np.clip(mean_hz.imag, -MOST_DECAY_HZ, MOST_DECAY_HZ)
    variance_hz2 = -np.square(per_radian_hz) * (forth + back)
    most_hz2 = np.square((bands.lines + 1.0) / WINDOW_S)
    variance_hz2 *= most_hz2 / np.maximum(np.abs(variance_hz2), most_hz2)
    return at_hz + 1j * decay_hz, variance_hz2
