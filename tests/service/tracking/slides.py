"""Windows of a finger whose law is known, drawn line by line without a twin."""

from collections.abc import Sequence

import numpy as np

from frictus_hardware.arrays import ComplexArray, FloatArray
from frictus_service.calibration import coordinates
from frictus_service.discovery.evidence.broadband import Bands
from frictus_service.tracking.windows import LawWindow

BANDS = Bands.of(2000, 20_000.0, None)
PAPER = coordinates.from_law(0.39, 385.68, 13.811, 0.0)
STEP = 1000
"""Samples from one window to the next."""


def slide(
    rng: np.random.Generator,
    at: FloatArray,
    speeds_mm_s: Sequence[float],
    contact: int = 0,
    first_sample: int = 0,
    noise_n: float = 2e-3,
) -> list[LawWindow]:
    """Return windows at given speeds of a law in `coordinates`, with white noise of the force.

    They follow as half overlapping ones do, but are drawn independently.
    """
    windows = []
    frequency = BANDS.frequency_hz
    for number, speed in enumerate(speeds_mm_s):
        drive = 2.0 * _normal(rng, frequency.size)
        cutoff = float(coordinates.cutoff_hz(at, np.array([speed]))[0])
        law = (
            np.exp(at[2] - 2j * np.pi * frequency * at[3]) * cutoff / (cutoff + 1j * frequency)
        )
        felt = law * drive + noise_n * _normal(rng, frequency.size)
        power, cross, friction = (
            BANDS.total(spectrum[np.newaxis])
            for spectrum in (np.abs(drive) ** 2, drive.conj() * felt, np.abs(felt) ** 2)
        )
        first = first_sample + number * STEP
        windows.append(LawWindow(first, contact, speed, 0.4, power.real, cross, friction.real))
    return windows


def speeds(rng: np.random.Generator) -> list[float]:
    """Return the speeds of the windows of a batch, 20 to 100 mm/s."""
    drawn: list[float] = rng.uniform(20.0, 100.0, 10).tolist()
    return drawn


def _normal(rng: np.random.Generator, size: int) -> ComplexArray:
    both = rng.standard_normal((2, size)) / np.sqrt(2.0)
    normal: ComplexArray = both[0] + 1j * both[1]
    return normal
