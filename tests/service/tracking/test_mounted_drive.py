"""A mount that rings is in the drive as it is in the friction."""

import numpy as np
import pytest

from frictus.aligned import AlignedSamples
from frictus.block import Flag
from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.linear import Mount
from frictus_service.tracking.mounted_drive import MountedDrive
from frictus_service.tracking.windows import WindowCutter

RATE_HZ = 20_000.0
PEAK_V = 75.0
MOUNT = Mount().lateral
GAIN_N = 0.5


def noise(n_samples: int, edge_hz: float, rng: np.random.Generator) -> FloatArray:
    """Return noise that ends at a frequency, as what a texture plays does."""
    spectrum = np.fft.rfft(rng.standard_normal(n_samples))
    spectrum[np.fft.rfftfreq(n_samples, 1.0 / RATE_HZ) > edge_hz] = 0.0
    drive = np.fft.irfft(spectrum, n_samples)
    clipped: FloatArray = np.clip(0.5 + 0.12 * drive / drive.std(), 0.0, 1.0)
    return clipped


def test_what_is_left_to_the_spectra_is_smooth(rng: np.random.Generator) -> None:
    """At 10 s a window is long beside what rings, so that spectra divide."""
    drive = noise(200_000, 2_500.0, rng)
    frequency_hz = np.array([100.0, 500.0, 950.0, 1_300.0, 2_000.0])
    mounted = MountedDrive(MOUNT, RATE_HZ, frequency_hz)
    assert np.all(np.abs(np.abs(mounted.remainder) - 1.0) < 0.03)
    passed = np.concatenate([mounted.take(part) for part in np.split(drive, 20)])
    at = np.rint(frequency_hz * 10.0).astype(int)
    taper = np.hanning(drive.size)
    given, found = (np.fft.rfft(taper * (each - each.mean()))[at] for each in (drive, passed))
    expected = (
        MOUNT.frequency_response(frequency_hz)
        * MountedDrive(None, RATE_HZ, frequency_hz).remainder
    )
    np.testing.assert_allclose(found * mounted.remainder / given, expected, rtol=2e-3)


def test_before_it_began_the_drive_stood(rng: np.random.Generator) -> None:
    mounted = MountedDrive(MOUNT, RATE_HZ, np.array([100.0]))
    still = MOUNT.frequency_response(np.zeros(1)).real[0]
    np.testing.assert_allclose(mounted.take(np.full(50, 0.7)), 0.7 * still, rtol=1e-9)
    mounted.take(rng.uniform(size=100))
    mounted.begin()
    np.testing.assert_allclose(mounted.take(np.full(50, 0.2)), 0.2 * still, rtol=1e-9)


@pytest.mark.parametrize("edge_hz", [740.0, 1_060.0, 1_200.0, 1_500.0])
def test_where_the_drive_ends_beside_a_resonance_friction_is_right(
    edge_hz: float, rng: np.random.Generator
) -> None:
    """Divided out of the spectra, the mount would leave 0.5 to 5 % at these edges."""
    drive = noise(200_000, edge_hz, rng)
    frequency_hz = np.linspace(0.0, RATE_HZ / 2.0, drive.size // 2 + 1)
    reaching = MOUNT.frequency_response(frequency_hz)
    reaching *= MountedDrive(None, RATE_HZ, frequency_hz).remainder
    felt = np.fft.irfft(GAIN_N * np.fft.rfft(drive) * reaching, drive.size)
    x_mm = 10.0 + 60.0 * np.arange(drive.size) / RATE_HZ
    rows = {
        "force": np.vstack([felt, np.zeros(drive.size), np.full(drive.size, 0.4)]),
        "voltage": PEAK_V * np.sqrt(drive / 2.0)[np.newaxis],
        "render": np.vstack([x_mm, np.zeros(drive.size), np.full(drive.size, 60.0)]),
    }
    data = {name: each.astype(np.float32) for name, each in rows.items()}
    cutter = WindowCutter(RATE_HZ, PEAK_V, MOUNT)
    found = cutter.take(AlignedSamples(1, 0, 0, RATE_HZ, 0, Flag(0), data))[4:]
    power = np.sum([each.drive_power for each in found], axis=0)
    cross = np.sum([each.cross for each in found], axis=0)
    heard = power / cutter.bands.lines > 1e-3 * np.max(power / cutter.bands.lines)
    np.testing.assert_allclose(cross[heard] / power[heard], GAIN_N, rtol=2.5e-3)
