"""What the mount makes of signals."""

import numpy as np

from frictus_hardware.physics.linear import Mount
from frictus_service.identification.observation.through_mount import (
    RINGS_S,
    ThroughMount,
)

RATE_HZ = 20_000.0
MOUNT = Mount().lateral
STILL = MOUNT.frequency_response(np.zeros(1)).real[0]


def test_in_a_long_spectrum_it_is_the_mount(rng: np.random.Generator) -> None:
    """At 10 s a window is long beside what rings, so that spectra divide."""
    frequency_hz = np.array([100.0, 500.0, 950.0, 1_300.0, 2_000.0])
    given = rng.standard_normal((200_000, 1))
    through = ThroughMount(MOUNT, RATE_HZ)
    passed = np.concatenate([through.take(part) for part in np.split(given, 20)])
    at, taper = np.rint(frequency_hz * 10.0).astype(int), np.hanning(len(given))
    before, after = (np.fft.rfft(taper * each[:, 0])[at] for each in (given, passed))
    left = through.remainder(frequency_hz)
    assert np.all(np.abs(np.abs(left) - 1.0) < 0.04)
    expected = MOUNT.frequency_response(frequency_hz)
    np.testing.assert_allclose(after * left / before, expected, rtol=5e-3)


def test_before_it_began_everything_stood(rng: np.random.Generator) -> None:
    through = ThroughMount(MOUNT, RATE_HZ)
    np.testing.assert_allclose(through.take(np.full((50, 2), 0.7)), 0.7 * STILL, rtol=1e-9)
    through.take(rng.uniform(size=(100, 2)))
    through.begin()
    np.testing.assert_allclose(through.take(np.full((50, 2), 0.2)), 0.2 * STILL, rtol=1e-9)


def test_after_a_gap_nothing_is_known_while_it_rings(rng: np.random.Generator) -> None:
    given = rng.standard_normal((20_000, 2))
    whole = ThroughMount(MOUNT, RATE_HZ).take(given)
    gap = given.copy()
    gap[5_000:5_010, 1] = np.nan
    through = ThroughMount(MOUNT, RATE_HZ)
    found = np.concatenate([through.take(part) for part in np.split(gap, 25)])
    np.testing.assert_array_equal(found[:, 0], whole[:, 0])
    rings = round(RINGS_S * RATE_HZ)
    np.testing.assert_array_equal(
        np.flatnonzero(np.isnan(found[:, 1])), np.arange(5_000, 5_010 + rings)
    )
    after = slice(5_010 + rings, None)
    assert np.std(found[after, 1] - whole[after, 1]) < 0.01 * np.std(whole[after, 1])


def test_without_a_mount_nothing_is_changed(rng: np.random.Generator) -> None:
    given = rng.standard_normal((100, 1))
    through = ThroughMount(None, RATE_HZ)
    assert through.take(given) is given
    np.testing.assert_array_equal(through.remainder(np.array([40.0])), 1.0)
