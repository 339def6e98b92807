"""A law is estimated right where what is played ends beside a resonance of the mount."""

import numpy as np
import pytest

from frictus.aligned import AlignedSamples
from frictus.block import Flag
from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.linear import Mount
from frictus_service.calibration import coordinates
from frictus_service.identification.observation.response import hold
from frictus_service.tracking.estimation.batch import Batch
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


def part_of(drive: FloatArray, at: FloatArray | None = None) -> AlignedSamples:
    """Return what a rig publishes of a slide at 60 mm/s whose friction follows the drive.

    By a law, or `GAIN_N` at all frequencies.
    """
    frequency_hz = np.linspace(0.0, RATE_HZ / 2.0, drive.size // 2 + 1)
    reaching = MOUNT.frequency_response(frequency_hz) * hold(frequency_hz, RATE_HZ)
    law = GAIN_N if at is None else coordinates.response(at, np.array([60.0]), frequency_hz)
    felt = np.fft.irfft(law * np.fft.rfft(drive) * reaching, drive.size)
    x_mm = 10.0 + 60.0 * np.arange(drive.size) / RATE_HZ
    rows = {
        "force": np.vstack([felt, np.zeros(drive.size), np.full(drive.size, 0.4)]),
        "voltage": PEAK_V * np.sqrt(drive / 2.0)[np.newaxis],
        "render": np.vstack([x_mm, np.zeros(drive.size), np.full(drive.size, 60.0)]),
    }
    data = {name: each.astype(np.float32) for name, each in rows.items()}
    return AlignedSamples(1, 0, 0, RATE_HZ, 0, Flag(0), data)


@pytest.mark.parametrize("edge_hz", [740.0, 1_060.0, 1_200.0, 1_500.0])
def test_where_the_drive_ends_beside_a_resonance_friction_is_right(
    edge_hz: float, rng: np.random.Generator
) -> None:
    """Divided out of the spectra, the mount would leave 0.5 to 5 % at these edges."""
    cutter = WindowCutter(RATE_HZ, PEAK_V, MOUNT)
    found = cutter.take(part_of(noise(200_000, edge_hz, rng)))[4:]
    power = np.sum([each.drive_power for each in found], axis=0)
    cross = np.sum([each.cross for each in found], axis=0)
    heard = power / cutter.bands.lines > 1e-3 * np.max(power / cutter.bands.lines)
    np.testing.assert_allclose(cross[heard] / power[heard], GAIN_N, rtol=2.5e-3)


@pytest.mark.parametrize("line_hz", [93.0, 105.0, 238.0, 528.0])
def test_a_line_between_the_frequencies_of_the_windows_is_at_its_own(line_hz: float) -> None:
    """By the windows' frequencies, a law beside it would be off by up to 10 %."""
    drive = 0.5 + 0.4 * np.cos(2.0 * np.pi * line_hz * np.arange(200_000) / RATE_HZ)
    cutter = WindowCutter(RATE_HZ, PEAK_V, MOUNT)
    found = cutter.take(part_of(drive))[4:]
    density = found[0].drive_power / cutter.bands.lines
    heard = density > 1e-3 * density.max()
    assert np.count_nonzero(heard) >= 2
    for each in found:
        assert each.frequency_hz is not None
        np.testing.assert_allclose(each.frequency_hz[heard].real, line_hz, atol=0.2)
        response = each.cross[heard] / each.drive_power[heard]
        np.testing.assert_allclose(response, GAIN_N, rtol=2e-3)


def test_a_line_that_does_not_last_through_a_window_has_its_response(
    rng: np.random.Generator,
) -> None:
    """With the real part of its frequency alone, 0.1 to 0.5 % are left beside the line."""
    at = coordinates.from_law(0.5, 280.0, 0.0, 0.0)
    time_s = np.arange(1_200_000) / RATE_HZ
    wobble = np.convolve(rng.standard_normal(time_s.size), np.ones(1_000) / 15.0, "same")
    drive = 0.5 + 0.4 * np.cos(2.0 * np.pi * np.cumsum(50.0 + wobble) / RATE_HZ)
    cutter = WindowCutter(RATE_HZ, PEAK_V, MOUNT)
    windows = cutter.take(part_of(drive, at))[4:-4]
    batch = Batch.of(windows, cutter.bands)
    rows = batch.rows(np.full(cutter.bands.centre_hz.size, 1e-6), at)
    power = batch.drive_power[batch.heard]
    law = coordinates.response(at, rows.speed_mm_s, rows.tone_hz)
    beside = (rows.nominal_hz == 70.0) | (rows.nominal_hz == 80.0)
    assert np.count_nonzero(beside) > 100
    left = np.sum((rows.response / law - 1.0) * power, where=beside)
    assert abs(left / np.sum(power, where=beside)) < 3e-5


@pytest.mark.parametrize("rate_hz", [5_000.0, 20_000.0])
@pytest.mark.parametrize("line_hz", [93.3, 1_403.7, 1_903.3])
def test_a_line_is_found_up_to_half_of_the_sample_rate(line_hz: float, rate_hz: float) -> None:
    time_s = np.arange(round(rate_hz)) / rate_hz
    drive = 0.5 + 0.4 * np.cos(2.0 * np.pi * line_hz * time_s)
    still = np.zeros(time_s.size)
    rows = {
        "force": np.vstack([0.5 * drive, still, still + 0.4]),
        "voltage": PEAK_V * np.sqrt(drive / 2.0)[np.newaxis],
        "render": np.vstack([10.0 + 60.0 * time_s, still, still + 60.0]),
    }
    data = {name: each.astype(np.float32) for name, each in rows.items()}
    found = WindowCutter(rate_hz, PEAK_V, None).take(
        AlignedSamples(1, 0, 0, rate_hz, 0, Flag(0), data)
    )
    assert found
    for each in found:
        assert each.frequency_hz is not None
        strongest = np.argmax(each.drive_power)
        assert each.frequency_hz[strongest].real == pytest.approx(line_hz, abs=0.1)


def test_a_voltage_that_is_no_number_spoils_no_later_window(rng: np.random.Generator) -> None:
    part = part_of(noise(20_000, 1_500.0, rng))
    part.data["voltage"][0, 7_500] = np.nan
    cutter = WindowCutter(RATE_HZ, PEAK_V, MOUNT)
    found = cutter.take(part)
    refused = cutter.refused["samples are not numbers"]
    assert 3 <= refused <= 5  # those that hold it, or what of it still rings
    assert len(found) == 19 - refused
    assert all(np.isfinite(each.cross).all() for each in found)


def test_a_finger_that_is_off_the_screen_for_a_part_of_a_window_is_no_weaker_one(
    rng: np.random.Generator,
) -> None:
    """It hops for 30 ms three times a second, and feels nothing of the drive meanwhile."""
    part = part_of(noise(60_000, 1_500.0, rng))
    off = np.arange(60_000) % 6_660 < 600
    part.data["force"][:, off] = 0.0
    cutter = WindowCutter(RATE_HZ, PEAK_V, MOUNT)
    found = cutter.take(part)
    assert cutter.refused["no finger presses"] >= 9
    assert len({each.contact for each in found}) >= 9
    # Its first windows after a hop still have what the mount rings by.
    gains = [np.abs(each.cross).sum() / each.drive_power.sum() for each in found]
    np.testing.assert_allclose(gains, GAIN_N, rtol=0.05)


def test_a_motion_that_reports_do_not_tell_is_not_called_slow(
    rng: np.random.Generator,
) -> None:
    part = part_of(noise(60_000, 1_500.0, rng))
    part.data["render"][:, :20_000] = 0.0  # as where reports make no smooth path
    part.data["render"][2, 30_000:40_000] = 0.0  # at rest
    cutter = WindowCutter(RATE_HZ, PEAK_V, MOUNT)
    found = cutter.take(part)
    assert cutter.refused == {
        "touch reports tell no smooth motion": 20,
        "slower than 10 or faster than 150 mm/s": 11,
    }
    assert len(found) == 59 - 31
