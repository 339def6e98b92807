"""A law is judged at the speed at which the drive of each band was felt."""

import numpy as np
import pytest

from frictus.aligned import AlignedSamples
from frictus.block import Flag
from frictus_hardware.arrays import FloatArray
from frictus_service.tracking.windows import LawWindow, WindowCutter

RATE_HZ = 20_000.0
PEAK_V = 75.0
PER_MM = 8.0
"""Wave number of a line."""


def window(drive: FloatArray, rng: np.random.Generator) -> LawWindow:
    """Return the one window of a slide from 60 to 85 mm/s."""
    time_s = np.arange(drive.size) / RATE_HZ
    speed = 60.0 + 250.0 * time_s
    x_mm = 60.0 * time_s + 125.0 * np.square(time_s)
    force = np.full((3, drive.size), 0.4) + 2e-3 * rng.standard_normal((3, drive.size))
    rows = {
        "force": force,
        "voltage": PEAK_V * np.sqrt(drive / 2.0)[np.newaxis],
        "render": np.vstack([x_mm, np.zeros(drive.size), speed]),
    }
    data = {name: each.astype(np.float32) for name, each in rows.items()}
    cutter = WindowCutter(RATE_HZ, PEAK_V, None)
    (found,) = cutter.take(AlignedSamples(1, 0, 0, RATE_HZ, 0, Flag(0), data))
    return found


@pytest.mark.parametrize("band_hz", [500.0, 560.0, 630.0])
def test_a_line_of_a_texture_is_in_a_band_while_the_finger_has_its_speed(
    band_hz: float, rng: np.random.Generator
) -> None:
    time_s = np.arange(2_000) / RATE_HZ
    x_mm = 60.0 * time_s + 125.0 * np.square(time_s)
    found = window(0.5 + 0.4 * np.cos(2.0 * np.pi * PER_MM * x_mm), rng)
    bands = WindowCutter(RATE_HZ, PEAK_V, None).bands
    assert found.band_speed_mm_s is not None
    at = int(np.argmin(np.abs(bands.centre_hz - band_hz)))
    assert found.band_speed_mm_s[at].real == pytest.approx(band_hz / PER_MM, abs=3.0)


def test_what_is_played_throughout_is_felt_at_the_mean_speed(rng: np.random.Generator) -> None:
    found = window(np.clip(0.5 + 0.1 * rng.standard_normal(2_000), 0.01, 0.99), rng)
    assert found.band_speed_mm_s is not None
    assert found.speed_mm_s == pytest.approx(72.5, abs=0.1)
    assert np.mean(found.band_speed_mm_s[-6:].real) == pytest.approx(72.5, abs=2.5)
