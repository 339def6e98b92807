"""A touchpad at its port: opened, read, and opened again after it was lost."""

from collections.abc import Callable
from typing import Protocol

from frictus_hardware.errors import DeviceLostError
from frictus_hardware.sensors.neonode import (
    Action,
    FingerLost,
    NeonodeReport,
    Reconnect,
    Send,
    Touchpad,
)


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
