"""Laws of a session: what a model renders by, what a person feels by, and how far apart."""

from functools import lru_cache
from typing import Final

import numpy as np

from frictus.model import FirstOrderSpeedLaw, Model
from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.friction import FrictionLaw
from frictus_hardware.simulated.config import SimulatedParticipant
from frictus_service.calibration import coordinates
from frictus_service.fidelity.preview import NOMINAL_HZ

SPEEDS_MM_S: Final = np.array([20.0, 40.0, 60.0, 80.0, 100.0])
FREQUENCY_HZ: Final = np.array(NOMINAL_HZ)


def error_db(at: FloatArray, true: FloatArray) -> float:
    """Return the error of a rendering that undoes a law which is not the true one.

    Parameters
    ----------
    at, true : ndarray, shape (4,)
        In `calibration.coordinates`; their delays do not count.

    Returns
    -------
    float
        dB rms over third octaves at 20 to 100 mm/s.
    """
    return _error_db(tuple(at.tolist()), tuple(true.tolist()))


@lru_cache(maxsize=64)
def _error_db(at: tuple[float, ...], true: tuple[float, ...]) -> float:
    """Return `error_db`; over a session most moments have the laws of the one before."""
    ratio = 0.0
    for one, sign in ((np.array(true), 1.0), (np.array(at), -1.0)):
        cutoff = coordinates.cutoff_hz(one, SPEEDS_MM_S)[:, np.newaxis]
        size = np.exp(one[2]) * cutoff / np.hypot(cutoff, FREQUENCY_HZ)
        ratio = ratio + sign * 20.0 * np.log10(size)
    return float(np.sqrt(np.mean(np.square(ratio))))


def model_of(person: SimulatedParticipant) -> Model:
    """Return a person's true law as a model.

    Parameters
    ----------
    person : SimulatedParticipant
        Of the simulated population.
    """
    gain, cutoff, slope = values_of(person.law)
    law = FirstOrderSpeedLaw(gain_n=gain, cutoff_0_hz=cutoff, slope_hz_per_mm_s=slope)
    return Model(base=law, provenance={"source": "the twin's own"})


def law_of(model: Model) -> FrictionLaw:
    """Return the law of a model.

    Parameters
    ----------
    model : Model
        Of a first-order law.
    """
    base = model.base
    assert isinstance(base, FirstOrderSpeedLaw)
    return FrictionLaw(base.gain_n, base.cutoff_0_hz, base.slope_hz_per_mm_s)


def values_of(law: FrictionLaw) -> tuple[float, float, float]:
    """Return gain, cutoff at rest and slope of a law.

    Parameters
    ----------
    law : FrictionLaw
        Of first order.
    """
    return law.gain_n, law.cutoff_0_hz, law.slope_hz_per_mm_s
