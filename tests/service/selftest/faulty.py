"""A rig with something wrong in what it senses, and a virtual rig that nobody touches."""

from collections.abc import Callable
from dataclasses import replace
from types import TracebackType
from typing import Self

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_hardware.base import Backend, Exchange, RigInfo
from frictus_hardware.simulated.config import SimulatedConfig
from frictus_hardware.simulated.faults import Fault
from frictus_hardware.simulated.guided import ClientFinger
from frictus_hardware.simulated.rig import SimulatedRig

Spoil = Callable[[Exchange], Exchange]
RATE_HZ = 10_000.0
BLOCK = 200


def quiet_rig(*faults: Fault, **changes: object) -> SimulatedRig:
    """Return a rig on the virtual clock; nobody touches it."""
    config = SimulatedConfig(
        clock="virtual", sample_rate_hz=RATE_HZ, finger=ClientFinger(), faults=faults
    )
    return SimulatedRig(config.model_copy(update=changes))


class FaultyRig:
    """A backend whose exchanges are spoiled."""

    def __init__(self, inner: Backend, spoil: Spoil, simulated: bool = True) -> None:
        self.inner = inner
        self.simulated = simulated
        self.loudest_v = 0.0
        self._spoil = spoil

    @property
    def info(self) -> RigInfo:
        return replace(self.inner.info, simulated=self.simulated)

    @property
    def next_play_sample(self) -> int:
        return self.inner.next_play_sample

    def open(self) -> None:
        self.inner.open()

    def arm(self) -> None:
        self.inner.arm()

    def exchange(self, drive_v: FloatArray) -> Exchange:
        self.loudest_v = max(self.loudest_v, float(np.abs(drive_v).max()))
        return self._spoil(self.inner.exchange(drive_v))

    def stop(self, ramp_s: float) -> None:
        self.inner.stop(ramp_s)

    def health(self) -> str | None:
        return self.inner.health()

    def close(self) -> None:
        self.inner.close()

    def __enter__(self) -> Self:
        self.open()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()


def scaled(factor: float) -> Spoil:
    """The monitor reads so many times what it should."""
    return lambda got: replace(got, voltage_v=factor * got.voltage_v)


def late(samples: int) -> Spoil:
    """The monitor reads everything so many samples late."""
    queue = np.zeros(samples)

    def spoil(got: Exchange) -> Exchange:
        nonlocal queue
        heard = np.concatenate([queue, got.voltage_v])
        queue = heard[got.voltage_v.size :]
        return replace(got, voltage_v=heard[: got.voltage_v.size])

    return spoil


def deaf(rng: np.random.Generator, noise_v: float = 0.02) -> Spoil:
    """The monitor is not connected: it reads noise."""
    return lambda got: replace(got, voltage_v=rng.normal(0.0, noise_v, got.voltage_v.size))


def time_s(got: Exchange) -> FloatArray:
    return np.arange(got.first_sample, got.first_sample + got.applied_v.size) / RATE_HZ
