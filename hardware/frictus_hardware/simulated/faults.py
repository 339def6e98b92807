"""Faults of a simulated rig: a plan of what goes wrong, and at which sample."""

from collections.abc import Iterable
from dataclasses import replace
from typing import Annotated, Final, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from frictus_hardware.arguments import StrictModel
from frictus_hardware.arrays import FloatArray
from frictus_hardware.base import TouchReport
from frictus_hardware.errors import (
    DeviceLostError,
    HardwareError,
    LinkLostError,
    SafetyError,
    SensorError,
    StreamLostError,
    TransientError,
)

ERRORS: dict[str, type[HardwareError]] = {
    "transient": TransientError,
    "stream_lost": StreamLostError,
    "device_lost": DeviceLostError,
    "link_lost": LinkLostError,
    "sensor": SensorError,
    "safety": SafetyError,
}
LASTING = (StreamLostError, DeviceLostError, LinkLostError)
"""After one of these every exchange fails until the rig is opened anew."""

FOR_GOOD = 1 << 62
RANGE: Final = {"force": 18.0, "accel": 200.0}
"""Ends of the ranges, N (ATI Nano43) and m/s² (ADXL358)."""


class _Planned(StrictModel):
    at_sample: int = Field(ge=0)


class _Momentary(_Planned):
    samples: int = Field(gt=0)


class _Spell(_Planned):
    samples: int = Field(default=FOR_GOOD, gt=0)

    def overlaps(self, first: int, n_samples: int) -> bool:
        """Whether it lasts during some of these samples."""
        return self.at_sample < first + n_samples and first < self.at_sample + self.samples


class Raised(_Planned):
    """The exchange that would sense `at_sample` raises an error instead."""

    kind: Literal["raise"] = "raise"
    error: Literal["transient", "stream_lost", "device_lost", "link_lost", "sensor", "safety"]


class LostSamples(_Momentary):
    """So many sensed samples are lost; as many output samples play zero."""

    kind: Literal["overrun"] = "overrun"


class EmptyOutput(_Momentary):
    """So many samples of the drive that is handed over do not reach the output."""

    kind: Literal["underrun"] = "underrun"


class LateBlock(_Momentary):
    """A drive is handed over so many samples late."""

    kind: Literal["late"] = "late"


class StuckTouch(_Spell):
    """The touch sensor repeats one position."""

    kind: Literal["touch_stuck"] = "touch_stuck"


class SilentTouch(_Spell):
    """The touch sensor reports nothing."""

    kind: Literal["touch_silent"] = "touch_silent"


class SensorFault(_Spell):
    """Force or acceleration fails in one of the ways in which sensors do.

    Attributes
    ----------
    sensor : {"force", "accel"}
        Which one.
    becomes : {"dead", "stuck", "saturated", "loose"}
        Zero; the last value; the end of the range, changing sides; or a tenth of what it was,
        under the rattle of a sensor that hangs on its cable.
    """

    kind: Literal["sensor"] = "sensor"
    sensor: Literal["force", "accel"]
    becomes: Literal["dead", "stuck", "saturated", "loose"]


class MonitorMismatch(_Spell):
    """The monitor reads `factor` times what is output."""

    kind: Literal["monitor"] = "monitor"
    factor: float


Fault = Annotated[
    Raised
    | LostSamples
    | EmptyOutput
    | LateBlock
    | StuckTouch
    | SilentTouch
    | SensorFault
    | MonitorMismatch,
    Field(discriminator="kind"),
]
_Momentaries = TypeVar("_Momentaries", LostSamples, EmptyOutput, LateBlock)
_Spells = TypeVar("_Spells", StuckTouch, SilentTouch, SensorFault, MonitorMismatch)


class FaultPlan:
    """The faults to come. Errors and momentary faults happen once, spells as long as they say.

    Parameters
    ----------
    faults : iterable of Fault
        By time.
    """

    def __init__(self, faults: Iterable[Fault] = ()) -> None:
        self._faults: tuple[Fault, ...] = tuple(faults)
        self._stuck: TouchReport | None = None
        self._last: dict[tuple[str, int], FloatArray] = {}

    def add(self, fault: Fault) -> None:
        """Plan one more; from any thread."""
        self._faults = (*self._faults, fault)

    def raise_due(self, end: int) -> None:
        """Raise the first error planned before a sample, and forget it.

        Raises
        ------
        HardwareError
            Of the planned class.
        """
        for fault in self._faults:
            if isinstance(fault, Raised) and fault.at_sample < end:
                self._forget(fault)
                raise ERRORS[fault.error](f"injected at sample {fault.at_sample}")

    def take(self, kind: type[_Momentaries], end: int) -> int:
        """Return the samples of the momentary faults due before a sample, and forget them."""
        samples = 0
        for fault in self._faults:
            if isinstance(fault, kind) and fault.at_sample < end:
                self._forget(fault)
                samples += fault.samples
        return samples

    def touches(
        self, reports: tuple[TouchReport, ...], first: int, n_samples: int
    ) -> tuple[TouchReport, ...]:
        """Return the reports that a faulty sensor makes of those of a block."""
        if self._during(SilentTouch, first, n_samples):
            return ()
        if not self._during(StuckTouch, first, n_samples):
            self._stuck = None
            return reports
        if self._stuck is None and reports:
            self._stuck = reports[0]
        stuck = self._stuck
        return tuple(
            replace(report, x_mm=stuck.x_mm, y_mm=stuck.y_mm) for report in reports if stuck
        )

    def monitored(self, voltage_v: FloatArray, first: int) -> FloatArray:
        """Return what a faulty monitor reads of a block's volts."""
        for fault in self._during(MonitorMismatch, first, voltage_v.size):
            since = np.arange(first, first + voltage_v.size) - fault.at_sample
            wrong = (since >= 0) & (since < fault.samples)
            voltage_v = np.where(wrong, fault.factor * voltage_v, voltage_v)
        return voltage_v

    def sensed(
        self, sensor: Literal["force", "accel"], values: FloatArray, first: int
    ) -> FloatArray:
        """Return what a faulty sensor makes of a block's values, shape (n_samples, 3)."""
        for fault in self._during(SensorFault, first, values.shape[0]):
            if fault.sensor != sensor:
                continue
            since = np.arange(first, first + values.shape[0]) - fault.at_sample
            wrong = (since >= 0) & (since < fault.samples)
            last = values[int(np.argmax(wrong))].copy()
            stuck = self._last.setdefault((sensor, fault.at_sample), last)
            faulty = {
                "dead": np.zeros(3),
                "stuck": stuck,
                "saturated": RANGE[sensor]
                * np.where(since % 60 < 30, 1.0, -1.0)[:, np.newaxis],
                "loose": 0.1 * values + _rattle(since)[:, np.newaxis],
            }[fault.becomes]
            values = np.where(wrong[:, np.newaxis], faulty, values)
        return values

    def saturates(self, sensor: Literal["force", "accel"], first: int, n_samples: int) -> bool:
        """Return whether a sensor is at the end of its range during a block."""
        return any(
            fault.sensor == sensor and fault.becomes == "saturated"
            for fault in self._during(SensorFault, first, n_samples)
        )

    def _during(self, kind: type[_Spells], first: int, n_samples: int) -> list[_Spells]:
        if not self._faults:
            return []
        return [
            fault
            for fault in self._faults
            if isinstance(fault, kind) and fault.overlaps(first, n_samples)
        ]

    def _forget(self, gone: Fault) -> None:
        self._faults = tuple(fault for fault in self._faults if fault is not gone)


def _rattle(since: NDArray[np.int64]) -> FloatArray:
    """Return m/s² or N of a loose sensor without any rhythm, a function of the sample alone."""
    rattle: FloatArray = np.sin(0.003 * since) * np.sin(
        0.2 * since + 3.0 * np.sin(0.0017 * since)
    )
    return 4.0 * rattle
