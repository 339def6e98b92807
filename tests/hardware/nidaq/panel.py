"""A touch sensor behind `fake_hid`: whoever connects sets it up and gets its frames."""

import os
import socket
import sys
import threading
from pathlib import Path
from types import TracebackType
from typing import Self

from tests.hardware.sensors.frames import DOWN, ENABLED, MODE_SET, MOVE, UP, touch_frame

from frictus_hardware.sensors.timing import TICKS_PER_S, WRAP

FAKE_HID = Path(__file__).with_name("fake_hid")
ADDRESS = "FRICTUS_FAKE_TOUCH"


class Panel:
    """Listens on loopback while its context lasts; processes spawned meanwhile find it."""

    def __init__(self) -> None:
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._wire: socket.socket | None = None
        self._enabled = False
        self._touched = False
        self._serving = threading.Thread(target=self._serve, daemon=True)

    def show(self, time_s: float, x_mm: float, y_mm: float, in_contact: bool) -> None:
        """Send a report of the finger, if there is one or has just been one.

        `time_s` is the sensor's own: its counter goes with the report.
        """
        wire, was = self._wire, self._touched
        self._touched = in_contact
        if wire is None or not self._enabled or not (in_contact or was):
            return
        event = (MOVE if was else DOWN) if in_contact else UP
        ticks = round(time_s * TICKS_PER_S) % WRAP
        data = touch_frame([(1, event, round(10.0 * x_mm), round(10.0 * y_mm))], ticks)
        try:
            wire.sendall(bytes([len(data)]) + data)
        except OSError:
            self._wire = None  # its reader is gone; the next one connects anew

    def __enter__(self) -> Self:
        self._serving.start()
        sys.path.insert(0, str(FAKE_HID))  # a spawned process takes the path over
        os.environ[ADDRESS] = f"127.0.0.1:{self._listener.getsockname()[1]}"
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        del os.environ[ADDRESS]
        sys.path.remove(str(FAKE_HID))
        self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        self._serving.join()

    def _serve(self) -> None:
        while True:
            try:
                wire, _ = self._listener.accept()
            except OSError:
                return  # closed
            with wire:
                self._answer(wire)

    def _answer(self, wire: socket.socket) -> None:
        self._enabled, self._touched = False, False
        self._wire = wire
        try:
            while size := wire.recv(1):
                request = wire.recv(size[0])
                enable = request[8] == ENABLED[8]
                reply = ENABLED if enable else MODE_SET
                wire.sendall(bytes([len(reply)]) + reply)
                self._enabled = self._enabled or enable
        except OSError:
            pass  # the reader is gone
        self._wire = None
