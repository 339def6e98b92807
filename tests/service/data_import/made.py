"""A recording of the twin, as a laboratory's programs would store it."""

from dataclasses import dataclass

import numpy as np
from tests.service.identification.trials import RATE_HZ, Made, trial

from frictus_hardware.arrays import FloatArray

TONES_HZ = (120.0, 350.0)


@dataclass(frozen=True)
class Swipes:
    """Back and forth over the screen; arrays of shape (n,), units of the study format."""

    time_s: FloatArray
    voltage_v: FloatArray
    force_x_n: FloatArray
    force_y_n: FloatArray
    force_z_n: FloatArray
    accel_m_s2: FloatArray
    x_mm: FloatArray
    y_mm: FloatArray
    position_t_s: FloatArray
    position_mm: FloatArray

    @property
    def rate_hz(self) -> float:
        """Samples per second."""
        return RATE_HZ

    @property
    def force_n(self) -> FloatArray:
        """All axes, shape (n, 3)."""
        return np.column_stack([self.force_x_n, self.force_y_n, self.force_z_n])


def swipes(
    rng: np.random.Generator,
    seconds: float = 2.5,
    tones_hz: tuple[float, ...] = TONES_HZ,
    speed_mm_s: float = 80.0,
) -> Swipes:
    """Simulate a recording of strokes of 60 mm."""
    made = Made(
        tones_hz, speed_mm_s=speed_mm_s, seconds=seconds, noise_n=0.001, noise_m_s2=0.05
    )
    found = trial(made, rng)
    time_s = np.arange(len(found.force_n)) / RATE_HZ
    voltage = np.zeros(time_s.size) if found.voltage_v is None else found.voltage_v
    assert found.accel_m_s2 is not None
    force_x_n, force_y_n, force_z_n = found.force_n.T
    return Swipes(
        time_s,
        voltage,
        force_x_n,
        force_y_n,
        force_z_n,
        found.accel_m_s2,
        np.interp(time_s, found.position_t_s, found.position_mm[:, 0]),
        np.interp(time_s, found.position_t_s, found.position_mm[:, 1]),
        found.position_t_s,
        found.position_mm,
    )
