"""What the carrier does to the drive: V^2, hold and aliases, against analytic results."""

import numpy as np
import pytest

from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.screen import Screen, drive_fraction_of, screen_voltage

RATE = 20_000.0
TONES_HZ = np.geomspace(30.0, 2000.0, 15)


def fitted(signal: FloatArray, frequency_hz: float) -> complex:
    """Complex amplitude at a tone by least squares, with a constant."""
    turned = 2.0 * np.pi * frequency_hz * np.arange(signal.size) / RATE
    design = np.column_stack([np.cos(turned), np.sin(turned), np.ones(signal.size)])
    cosine, sine, _ = np.linalg.lstsq(design, signal, rcond=None)[0]
    return complex(cosine, -sine)


@pytest.mark.parametrize("tone_hz", TONES_HZ)
def test_baseband_of_v_squared_is_the_drive(tone_hz: float, rng: np.random.Generator) -> None:
    phase = rng.uniform(0.0, 2.0 * np.pi)
    turned = 2.0 * np.pi * tone_hz * np.arange(200_000) / RATE + phase
    drive = 0.5 + 0.5 * np.cos(turned)
    voltage = screen_voltage(Screen(), drive, 0, RATE)
    seen = fitted(drive_fraction_of(Screen(), voltage), tone_hz)
    assert abs(seen - 0.5 * np.exp(1j * phase)) <= 8e-4 * 0.5


def test_carrier_line_folds_to_6_khz_and_stays_out_of_the_tactile_band() -> None:
    voltage = screen_voltage(Screen(), np.full(20_000, 0.5), 0, RATE)
    lines = np.abs(np.fft.rfft(drive_fraction_of(Screen(), voltage))) / 10_000.0
    assert lines[6_000] == pytest.approx(0.5, rel=1e-9)  # 14 kHz, sampled at 20 kHz
    lines[[0, 6_000]] = 0.0
    assert np.max(lines) < 1e-9


def test_message_is_shifted_by_the_size_of_its_minimum() -> None:
    # |min V_m|, not min |V_m|: that is 0 for a sine, and leaves half of it under the root
    # negative.
    message = 0.5 * np.sin(2.0 * np.pi * 100.0 * np.arange(2_000) / RATE)
    with pytest.raises(ValueError, match=r"\[0, 1\]"):
        screen_voltage(Screen(), message + np.min(np.abs(message)), 0, RATE)
    shifted = np.clip(message + np.abs(np.min(message)), 0.0, 1.0)
    voltage = screen_voltage(Screen(), shifted, 0, RATE)
    assert np.max(np.abs(voltage)) <= 75.0
    carrier = np.square(np.cos(2.0 * np.pi * 7_000.0 * np.arange(2_000) / RATE))
    np.testing.assert_allclose(
        drive_fraction_of(Screen(), voltage), 2.0 * shifted * carrier, atol=1e-12
    )


def test_carrier_is_continuous_over_blocks_and_days(rng: np.random.Generator) -> None:
    drive = rng.random(1_000)
    whole = screen_voltage(Screen(), drive, 0, RATE)
    split = int(rng.integers(1, 999))
    parts = [
        screen_voltage(Screen(), drive[:split], 0, RATE),
        screen_voltage(Screen(), drive[split:], split, RATE),
    ]
    np.testing.assert_array_equal(np.concatenate(parts), whole)
    later = 30 * 24 * 3600 * int(RATE)  # whole cycles
    np.testing.assert_array_equal(screen_voltage(Screen(), drive, later, RATE), whole)
