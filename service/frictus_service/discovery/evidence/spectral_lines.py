"""Which lines are fitted together in a trial, and which harmonics of its tones can be trusted.

A harmonic is told from other lines only where nothing else stands near it: another tone, a
product of other tones, an image of the carrier (V² has lines at |2 f_c ± f|, folded by the
sampling), a mains line.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from frictus_hardware.arrays import FloatArray
from frictus_service.identification.observation.tones import Tones

MAINS_HZ: Final = (50.0, 60.0)
FROM_MAINS_HZ: Final = 8.0
"""A mains line closer to a tone is not told from it."""
APART_HZ: Final = 20.0
"""From a harmonic to any other line."""
HIGHEST_SHARE: Final = 0.4
"""Of the sample rate: what lies above is not used."""
ORDERS: Final = (2, 3)


@dataclass(frozen=True, slots=True)
class Lines:
    """Frequencies that are fitted together, and which of them are what.

    Attributes
    ----------
    tones : Tones
        All lines: first the trial's tones, then the others.
    n_tones : int
        The first lines of all.
    harmonics : tuple of ndarray of int, shape (n_tones,)
        Places in `tones` of the harmonics of second and third order; -1 where there is none.
    mains : tuple of int
        Places of 50 and 60 Hz; -1 where there is none.
    """

    tones: Tones
    n_tones: int
    harmonics: tuple[NDArray[np.int64], NDArray[np.int64]]
    mains: tuple[int, int]


@lru_cache(maxsize=256)
def lines_of(tones_hz: tuple[float, ...], carrier_hz: float, sample_rate_hz: float) -> Lines:
    """Return the lines that a trial may show.

    Parameters
    ----------
    tones_hz : tuple of float
        Empty for a blank trial.
    carrier_hz, sample_rate_hz : float
        Of the rig.
    """
    own = np.array(tones_hz, dtype=np.float64)
    images = _images(own, carrier_hz, sample_rate_hz)
    fitted = list(tones_hz)

    def place(line_hz: float) -> int:
        fitted.append(line_hz)
        return len(fitted) - 1

    mains = [place(at) if _far(at, own, FROM_MAINS_HZ) else -1 for at in MAINS_HZ]
    around = np.concatenate([own, images, MAINS_HZ])
    made = _products(own)
    harmonics = []
    for order in ORDERS:
        at = [
            place(order * tone)
            if order * tone <= HIGHEST_SHARE * sample_rate_hz
            and _far(order * tone, around, APART_HZ)
            and _products_near(order * tone, made) == 1  # which is the harmonic itself
            else -1
            for tone in tones_hz
        ]
        harmonics.append(np.array(at, dtype=np.int64))
    if any(np.any(at >= 0) for at in harmonics):
        # They leak into harmonics unless they are fitted too.
        for image in images.tolist():
            if _far(image, np.array(fitted), APART_HZ):
                place(image)
    return Lines(
        Tones(tuple(fitted), sample_rate_hz),
        len(tones_hz),
        (harmonics[0], harmonics[1]),
        (mains[0], mains[1]),
    )


def _far(line_hz: float, others_hz: FloatArray, apart_hz: float) -> bool:
    return bool(np.all(np.abs(others_hz - line_hz) >= apart_hz))


def _images(tones_hz: FloatArray, carrier_hz: float, sample_rate_hz: float) -> FloatArray:
    """Return where the carrier's line of V² and its sidebands fold to."""
    if not tones_hz.size:
        return tones_hz
    lines = 2.0 * carrier_hz + np.concatenate([[0.0], tones_hz, -tones_hz])
    folded: FloatArray = np.abs(lines - sample_rate_hz * np.rint(lines / sample_rate_hz))
    return folded


def _products(tones_hz: FloatArray) -> FloatArray:
    """Return what squares and cubes make of tones: sums of two and of three of ±f, rising."""
    signed = np.concatenate([tones_hz, -tones_hz])
    two = np.add.outer(signed, signed).ravel()
    return np.sort(np.concatenate([two, np.add.outer(two, signed).ravel()]))


def _products_near(line_hz: float, made_hz: FloatArray) -> int:
    low, high = np.searchsorted(made_hz, (line_hz - APART_HZ, line_hz + APART_HZ))
    return int(high - low)
