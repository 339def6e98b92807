"""Frequencies and speeds that windows of a spectrum have parts of."""

import numpy as np

from frictus_service.discovery.evidence.bands import Bands
from frictus_service.discovery.evidence.window_spectra import (
    LEAST_HZ,
    Channels,
    frequency_hz,
    spectra_of,
)
from frictus_service.identification.observation.response import Instrument
from frictus_service.identification.observation.sweeps import SweepThird

RATE_HZ = 20_000.0


def test_what_turns_backwards_is_at_the_least_frequency() -> None:
    """Noise turns by anything; at 0 Hz a drive that leaks gives nothing, of which no ln is."""
    turns = np.exp(2j * np.pi * np.array([-0.1, 0.0, 0.1]))
    np.testing.assert_allclose(frequency_hz(turns, RATE_HZ), [LEAST_HZ, LEAST_HZ, 2_000.0])


def test_speeds_while_noise_is_played_have_a_mean_and_a_spread(
    rng: np.random.Generator,
) -> None:
    """Of a finger that speeds up evenly: the middle, and the width over the root of twelve."""
    n, window = 60_000, 2_000
    noise = rng.standard_normal((n, 1))
    speed_mm_s = np.linspace(40.0, 80.0, n)
    channels = Channels(np.hstack([noise, 0.0 * noise]), noise, noise, None, speed_mm_s)
    bands = Bands.of(window, RATE_HZ, None)
    ones = np.ones(bands.frequency_hz.size, dtype=np.complex128)
    segment = SweepThird(0, 1, 0, 0.0, n / RATE_HZ, 60.0, (1.0, 0.0), 35.0)
    spectra = spectra_of(
        channels, segment, RATE_HZ, window, bands, Instrument(ones, ones, ones)
    )
    assert spectra is not None
    mean_mm_s, spread_mm_s = spectra.speed(bands)
    wide = bands.lines > 10
    np.testing.assert_allclose(mean_mm_s[wide], 60.0, atol=2.0)
    np.testing.assert_allclose(spread_mm_s[wide], 40.0 / np.sqrt(12.0), rtol=0.15)
