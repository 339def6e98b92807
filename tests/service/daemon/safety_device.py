"""The smallest device, in virtual time, with what a search of the safety does to it."""

import threading
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from frictus_hardware.arguments import ramp_samples, require_drive
from frictus_hardware.arrays import FloatArray
from frictus_hardware.base import Exchange, Opened, RigInfo, TouchReport
from frictus_hardware.errors import HardwareError
from frictus_hardware.output import RETURN_S, OutputQueue
from frictus_hardware.simulated.faults import ERRORS

from .safety_events import SENSED

RATE_HZ: Final = 1_000.0


class Device(Opened):
    """A backend in virtual time with what a test does to it; its output is a real queue."""

    def __init__(self, block_samples: int) -> None:
        self.block_samples = block_samples
        self.info = RigInfo(
            "model", True, "simulated", RATE_HZ, block_samples, 75.0, (70.0, 35.0), 0.0
        )
        self.finger = "finger back"
        self.wrong: str | None = None
        self.happens = "nothing"
        self.meanwhile: Any = None
        self.began = 0
        self.refused = 0
        self._begin()

    def _begin(self) -> None:
        self.now = 0
        self.armed = False
        self.voltage_v = np.zeros(0)
        self.queue = OutputQueue(8 * self.block_samples, False, ramp_samples(RETURN_S, RATE_HZ))
        self.queue.write(0, np.zeros(self.info.lead_samples), 0)

    def monotonic_ns(self) -> int:
        return round(1e9 * (self.began + self.now) / RATE_HZ)

    @property
    def next_play_sample(self) -> int:
        return self.now + self.info.lead_samples

    def open(self) -> None:
        self.began += self.now + self.block_samples
        self._begin()

    def close(self) -> None:
        self.queue.ramp(self.now, 0)
        self.armed = False

    def arm(self) -> None:
        self.armed = True

    def stop(self, ramp_s: float) -> None:
        if self.armed:
            self.queue.ramp(self.now, ramp_samples(ramp_s, RATE_HZ))
        self.armed = False

    def health(self) -> str | None:
        return self.wrong

    def exchange(self, drive_v: FloatArray) -> Exchange:
        happens, n = self.happens, self.block_samples
        if happens in ERRORS:
            raise ERRORS[happens](happens)
        if happens == "loop exception":
            raise ZeroDivisionError(happens)
        try:
            require_drive(drive_v, n, armed=self.armed)
        except HardwareError:
            self.refused += 1
            raise
        if self.meanwhile is not None:
            self.meanwhile()
        lost = n if happens == "overrun" else 0
        lost_v = self.queue.read(self.now, lost)
        self.now += lost
        play = self.next_play_sample
        late, applied = self.queue.write(play, drive_v, play + n * (happens == "underrun"))
        volts = self.queue.read(self.now, n)
        self.voltage_v = np.concatenate([self.voltage_v, lost_v, volts])
        first, self.now = self.now, self.now + n
        force = np.full((n, 3), 0.0)
        force[:, 2] = SENSED.get(happens, {}).get("force_n", 0.4)
        return Exchange(
            first_sample=first,
            force_n=force,
            accel_m_s2=np.zeros((n, 3)),
            voltage_v=volts * SENSED.get(happens, {}).get("monitor", 1.0),
            touches=self._touches(),
            applied_v=applied,
            play_sample=play,
            clipped_samples=0,
            margin_samples=self.info.lead_samples,
            underrun_samples=late + lost,
            overrun_samples=lost,
        )

    def _touches(self) -> tuple[TouchReport, ...]:
        if self.finger == "finger silent":
            return ()
        return (TouchReport(self.now - 1.0, 35.0, 17.0, self.finger == "finger back"),)


@dataclass
class Punctuality:
    """Says that a block was late where the test says so."""

    device: Device

    def note(self, *_block: object) -> int:
        return int(self.device.happens == "deadline")

    def restart(self) -> None:
        """Nothing is remembered."""


class OneTry(threading.Event):
    """Ends a wait for the device after one opening."""

    waits = 0

    def wait(self, timeout: float | None = None) -> bool:
        self.waits += 1
        return self.waits > 1
