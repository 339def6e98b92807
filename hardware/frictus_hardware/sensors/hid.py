"""The wire to a touch sensor: feature reports over `hidapi`, opened again after it was lost."""

import importlib
import math
from collections.abc import Callable
from types import ModuleType
from typing import Final, Protocol, cast

from frictus_hardware.errors import ClosedError, DeviceLostError, DriverMissingError
from frictus_hardware.sensors.neonode import (
    Action,
    FingerLost,
    NeonodeReport,
    Reconnect,
    Send,
    Touchpad,
)

VENDOR_ID: Final = 0x1536
PRODUCT_ID: Final = 0x0101
TO_SENSOR: Final = 1
FROM_SENSOR: Final = 2
REPORT_BYTES: Final = 258
"""Report number and 257 bytes; a shorter report comes back at its own length."""
INPUT_BYTES: Final = 64
VENDOR_USAGE_PAGE: Final = 0xFF00
INSTALL: Final = 'uv pip install "frictus[hid]"'


class HidDevice(Protocol):
    """What is used of `hid.device`."""

    def open_path(self, path: bytes, /) -> None:
        """Raise OSError if it cannot be opened."""
        ...

    def read(self, max_length: int, timeout_ms: int, /) -> list[int]:
        """Wait for an input report; empty after the time."""
        ...

    def get_feature_report(self, report_num: int, max_length: int, /) -> list[int]:
        """Read a feature report; its number comes first."""
        ...

    def send_feature_report(self, data: bytes, /) -> int:
        """Write a feature report; -1 on failure."""
        ...

    def close(self) -> None:
        """Let go of the device."""
        ...


class HidPort:
    """A touch sensor as a pipe for bytes. To be used by one thread.

    Parameters
    ----------
    vendor_id, product_id : int
        As `lsusb` or the device manager shows them.
    serial_number : str or None
        None: the first that is found.
    """

    def __init__(
        self,
        vendor_id: int = VENDOR_ID,
        product_id: int = PRODUCT_ID,
        serial_number: str | None = None,
    ) -> None:
        self._ids = (vendor_id, product_id, serial_number)
        self._name = f"touch sensor {vendor_id:04x}:{product_id:04x}"
        self._device: HidDevice | None = None

    def open(self) -> None:
        """Open the sensor; one that is open is closed first.

        Raises
        ------
        DriverMissingError
            If the `hidapi` package is not installed.
        DeviceLostError
            If there is no such sensor, or it must not be opened.
        """
        self.close()
        hid = _hidapi()
        device = cast(HidDevice, hid.device())
        try:
            device.open_path(self._path(hid))
        except OSError as error:
            raise DeviceLostError(
                f"{self._name} cannot be opened: {error}. Plug it in, close other programs "
                "that use it, and on Linux allow access to it by a udev rule"
            ) from error
        self._device = device

    def send(self, data: bytes) -> None:
        """Write bytes.

        Parameters
        ----------
        data : bytes
            At most 257.

        Raises
        ------
        ClosedError
            If it is not open.
        DeviceLostError
            If it is gone; it is closed then.
        """
        device = self._require_open()
        try:
            written = device.send_feature_report(bytes([TO_SENSOR]) + data)
        except (OSError, ValueError) as error:
            raise self._lost(f"write failed: {error}") from error
        if written < 0:
            raise self._lost("write failed")

    def receive(self, timeout_s: float) -> bytes:
        """Wait for bytes; return none after the time, or if another report came.

        The sensor announces bytes by an input report. Nothing is read unannounced: that could
        be what was read before, and a finger that is gone would seem to stay.

        Parameters
        ----------
        timeout_s : float
            Rounded up to milliseconds, at least one.

        Raises
        ------
        ClosedError, DeviceLostError
            As `send`.
        """
        device = self._require_open()
        timeout_ms = max(1, math.ceil(timeout_s * 1000.0))
        try:
            announced = device.read(INPUT_BYTES, timeout_ms)
            if announced[:1] != [FROM_SENSOR]:
                return b""
            report = device.get_feature_report(FROM_SENSOR, REPORT_BYTES)
        except (OSError, ValueError) as error:
            raise self._lost(f"read failed: {error}") from error
        return bytes(report[1:])

    def close(self) -> None:
        """Let go of the sensor. Closing twice is harmless."""
        device, self._device = self._device, None
        if device is not None:
            device.close()

    def _path(self, hid: ModuleType) -> bytes:
        vendor_id, product_id, serial_number = self._ids
        found = [
            one
            for one in hid.enumerate(vendor_id, product_id)
            if serial_number in (None, one["serial_number"])
        ]
        if not found:
            raise OSError("it is not plugged in")
        # Windows lists the touch screen of the system and the pipe apart; the pipe is vendor's.
        found.sort(key=lambda one: one["usage_page"] < VENDOR_USAGE_PAGE)
        return cast(bytes, found[0]["path"])

    def _require_open(self) -> HidDevice:
        if self._device is None:
            raise ClosedError(f"{self._name} is not open")
        return self._device

    def _lost(self, why: str) -> DeviceLostError:
        self.close()
        return DeviceLostError(f"{self._name}: {why}; plug it in again")


def _hidapi() -> ModuleType:
    try:
        module = importlib.import_module("hid")
    except ImportError as error:
        raise DriverMissingError(
            f"the touch sensor needs the hidapi package ({error}): {INSTALL}"
        ) from error
    if not hasattr(module, "device"):
        raise DriverMissingError(
            f"the module hid in {module.__file__} is not that of hidapi: "
            f"uv pip uninstall hid, then {INSTALL}"
        )
    return module


class Port(Protocol):
    """What a touchpad is behind; `frictus_hardware.sensors.hid.HidPort` is one.

    Each of them may raise `DeviceLostError`.
    """

    def open(self) -> None:
        """Open, or open anew."""
        ...

    def send(self, data: bytes) -> None:
        """Write bytes."""
        ...

    def receive(self, timeout_s: float) -> bytes:
        """Wait for bytes; none after the time."""
        ...

    def close(self) -> None:
        """Close; twice is harmless."""
        ...


class TouchLink:
    """Runs a touchpad. To be used by one thread; `touchpad` may be looked at by others.

    Parameters
    ----------
    touchpad : Touchpad
        The protocol of the sensor.
    port : Port
        Closed.
    clock : callable
        Monotonic seconds, `time.monotonic` on a rig.
    wait : callable
        Lets seconds pass while there is no sensor; `threading.Event.wait` can be ended early.
    """

    def __init__(
        self,
        touchpad: Touchpad,
        port: Port,
        clock: Callable[[], float],
        wait: Callable[[float], object],
    ) -> None:
        self.touchpad = touchpad
        self._port = port
        self._clock = clock
        self._wait = wait
        self._open = False

    def start(self) -> None:
        """Open the port. A sensor that is not there is tried again by `poll`.

        Raises
        ------
        DriverMissingError
            If the package of the port is not installed.
        """
        self._carry_out(self._reopen())

    def poll(self, timeout_s: float) -> tuple[NeonodeReport | FingerLost, ...]:
        """Wait for what the sensor has to tell, and do what it needs.

        Parameters
        ----------
        timeout_s : float
            At most 0.1.

        Returns
        -------
        told : tuple of Report or Lost
            Oldest first; why there is none is in `touchpad.fault`.
        """
        actions: tuple[Action, ...] = ()
        if self._open:
            try:
                data = self._port.receive(timeout_s)
            except DeviceLostError as error:
                actions += self._lost(error)
            else:
                actions += self.touchpad.received(data, self._clock())
        else:
            self._wait(timeout_s)
        return self._carry_out(actions + self.touchpad.tick(self._clock()))

    def close(self) -> None:
        """Close the port."""
        self._open = False
        self._port.close()

    def _carry_out(self, actions: tuple[Action, ...]) -> tuple[NeonodeReport | FingerLost, ...]:
        told: list[NeonodeReport | FingerLost] = []
        waiting = list(actions)
        while waiting:
            match waiting.pop(0):
                case Send(data):
                    waiting += self._send(data)
                case Reconnect():
                    waiting += self._reopen()
                case NeonodeReport() | FingerLost() as one:
                    told.append(one)
        return tuple(told)

    def _send(self, data: bytes) -> tuple[Action, ...]:
        if not self._open:
            return ()
        try:
            self._port.send(data)
        except DeviceLostError as error:
            return self._lost(error)
        return ()

    def _reopen(self) -> tuple[Action, ...]:
        try:
            self._port.open()
        except DeviceLostError as error:
            return self._lost(error)
        self._open = True
        return self.touchpad.connected(self._clock())

    def _lost(self, error: DeviceLostError) -> tuple[Action, ...]:
        self._open = False
        return self.touchpad.disconnected(str(error), self._clock())
