"""The touch sensor: late, coarse and slow, as the real one is."""

from collections import deque
from dataclasses import dataclass

import numpy as np
from pydantic import Field

from frictus_hardware.arguments import NonNegative, Positive, StrictModel
from frictus_hardware.base import TouchReport
from frictus_hardware.simulated.motion import FingerMotion


class TouchConfig(StrictModel):
    """Settings of the touch sensor.

    Attributes
    ----------
    rate_hz : float
        Reports per second, whether the finger touches or not.
    resolution_mm : float
        Positions are rounded to it; 0 for none.
    latency_s : float
        From measurement to arrival.
    declared_latency_s : float or None
        What the rig declares, and takes off the arrival. None: the true latency.
    """

    rate_hz: Positive = 60.0
    resolution_mm: NonNegative = 0.1
    latency_s: float = Field(default=0.030, ge=0.0, le=1.0)
    declared_latency_s: float | None = Field(default=None, ge=0.0, le=1.0)

    @property
    def declared_s(self) -> float:
        """Declared age of a report when it arrives."""
        return self.latency_s if self.declared_latency_s is None else self.declared_latency_s


@dataclass(frozen=True, slots=True)
class _Pending:
    arrival_sample: float
    x_mm: float
    y_mm: float
    in_contact: bool


class TouchSensor:
    """Scans a finger at a fixed rate; a report arrives one latency after its scan.

    Parameters
    ----------
    config : TouchConfig
        Rate, latency and resolution.
    sample_rate_hz : float
        Samples per second of the device's clock.
    """

    def __init__(self, config: TouchConfig, sample_rate_hz: float) -> None:
        self._resolution_mm = config.resolution_mm
        self._period = sample_rate_hz / config.rate_hz
        self._latency = config.latency_s * sample_rate_hz
        self._declared = config.declared_s * sample_rate_hz
        self._scans = 0
        self._pending: deque[_Pending] = deque()

    def step(self, first_sample: int, motion: FingerMotion) -> tuple[TouchReport, ...]:
        """Scan during a block, and return the reports that arrive during it, oldest first.

        Parameters
        ----------
        first_sample : int
            Blocks must follow one another.
        motion : FingerMotion
            The finger at each sample of the block.
        """
        end = first_sample + motion.in_contact.size
        while (scan := int(np.ceil(self._scans * self._period))) < end:
            self._scan(scan, motion, scan - first_sample)
            self._scans += 1
        arrived = []
        while self._pending and self._pending[0].arrival_sample < end:
            report = self._pending.popleft()
            arrived.append(
                TouchReport(
                    measured_sample=report.arrival_sample - self._declared,
                    x_mm=report.x_mm,
                    y_mm=report.y_mm,
                    in_contact=report.in_contact,
                )
            )
        return tuple(arrived)

    def _scan(self, sample: int, motion: FingerMotion, row: int) -> None:
        x, y = (self._round(float(value)) for value in motion.position_mm[row])
        self._pending.append(
            _Pending(sample + self._latency, x, y, bool(motion.in_contact[row]))
        )

    def _round(self, value_mm: float) -> float:
        if self._resolution_mm == 0.0:
            return value_mm
        return round(value_mm / self._resolution_mm) * self._resolution_mm
