"""A simulated device in a process of its own.

As an NI device does, it outlives the process that drives it and then holds its last output
value, until somebody resets it. Start it with ``python -m frictus_hardware.simulated.device``.
"""

import argparse
import sys
import threading
from collections.abc import Callable
from multiprocessing import AuthenticationError
from multiprocessing.connection import (
    Connection,
    Listener,
    answer_challenge,
    deliver_challenge,
)
from typing import Any

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_hardware.base import Exchange
from frictus_hardware.errors import ClosedError, ConfigError, DeviceLostError, HardwareError
from frictus_hardware.output import DeviceOutput
from frictus_hardware.simulated.config import SimulatedConfig
from frictus_hardware.simulated.rig import SimulatedRig

HISTORY_S = 5.0
"""How much of its output the device remembers."""


class Device:
    """The device itself. Its calls may come from any thread; one client at a time owns it."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._rig: SimulatedRig | None = None
        self._owner: object | None = None

    def open(self, owner: object, config: SimulatedConfig) -> None:
        """Start the sample clock for a new owner.

        Raises
        ------
        ConfigError
            If another client owns the device, or the clock is virtual.
        """
        if config.clock == "virtual":
            raise ConfigError('a device of its own has no virtual clock: use "real" or a scale')
        with self._lock:
            if self._owner is not None and self._owner is not owner:
                raise ConfigError("another client owns the device; close it there first")
            past = self._past(config)
            if self._rig is not None:
                self._rig.close()
            self._rig = SimulatedRig(
                config, holds_output=True, history_s=HISTORY_S, past_v=past
            )
            self._rig.open()
            self._owner = owner

    def disown(self, owner: object) -> None:
        """Forget an owner that is gone. The output goes on as it is."""
        with self._lock:
            if self._owner is owner:
                self._owner = None

    def arm(self, owner: object) -> None:
        """Allow output other than zero."""
        with self._lock:
            self._owned(owner).arm()

    def lengthen_lead(self, owner: object, lead_samples: int) -> None:
        """Have what is handed over from now on play later."""
        with self._lock:
            self._owned(owner).lengthen_lead(lead_samples)

    def exchange(self, owner: object, drive_v: FloatArray) -> Exchange:
        """Exchange one block. While it waits, others may stop or reset the device."""
        with self._lock:
            rig = self._owned(owner)
            handed = rig.hand_over(drive_v)
        rig.wait(handed)
        with self._lock:
            return rig.sense(handed)

    def stop(self, ramp_s: float) -> None:
        """Ramp what is queued to zero, and disarm."""
        with self._lock:
            if self._rig is not None:
                self._rig.stop(ramp_s)

    def health(self) -> str | None:
        """Return what is wrong with the device, or None."""
        with self._lock:
            return "not open" if self._rig is None else self._rig.health()

    def close(self, owner: object) -> None:
        """Bring the output to zero and let another client own the device."""
        with self._lock:
            if self._rig is not None and self._owner is owner:
                self._rig.close()
                self._owner = None

    def reset(self) -> None:
        """Put the output to zero at once; whoever still drives the device has lost it."""
        with self._lock:
            if self._rig is not None:
                self._rig.silence()
            self._owner = None

    def move_finger(
        self, x_mm: float, y_mm: float, in_contact: bool, normal_force_n: float
    ) -> None:
        """Move a finger of kind `client` or `takeover`."""
        with self._lock:
            if self._rig is None:
                raise ClosedError("the device is not open")
            self._rig.move_finger(x_mm, y_mm, in_contact, normal_force_n)

    def guide_finger(
        self, speed_mm_s: float, force_n: float, span_mm: tuple[float, float]
    ) -> None:
        """Tell a finger of kind `guided` or `takeover` what to do."""
        with self._lock:
            if self._rig is None:
                raise ClosedError("the device is not open")
            self._rig.guide_finger(speed_mm_s, force_n, span_mm)

    def output(self, seconds: float) -> DeviceOutput:
        """Return what was output during the last seconds, at most `HISTORY_S`."""
        with self._lock:
            rig = self._rig
            if rig is None:
                return DeviceOutput(0, np.zeros(0), holding=False, armed=False)
            n_samples = round(min(seconds, HISTORY_S) * rig.config.sample_rate_hz)
            first, voltage = rig.played(n_samples)
            return DeviceOutput(first, voltage, rig.holding, rig.armed)

    def _owned(self, owner: object) -> SimulatedRig:
        if self._rig is None or self._owner is not owner:
            raise DeviceLostError("the device was reset by someone else; open it anew")
        return self._rig

    def _past(self, config: SimulatedConfig) -> FloatArray | None:
        if self._rig is None or self._rig.config.sample_rate_hz != config.sample_rate_hz:
            return None
        return self._rig.played(round(HISTORY_S * config.sample_rate_hz))[1]


OWNERS_CALLS = frozenset({"open", "arm", "lengthen_lead", "exchange", "close"})
ANYBODYS_CALLS = frozenset({"stop", "health", "reset", "move_finger", "guide_finger", "output"})


def serve(endpoint: tuple[str, int], authkey: str, announce: Callable[[str], object]) -> None:
    """Serve a device for good.

    Parameters
    ----------
    endpoint : tuple of str and int
        Host and port to listen at; port 0 for any free one.
    authkey : str
        That a rig has to know.
    announce : callable
        Told the address, host:port, once it can be reached. A spawned process may pass the
        `send` of a pipe.
    """
    device = Device()
    with Listener(endpoint) as listener:
        announce("{}:{}".format(*listener.address))
        while True:
            client = threading.Thread(
                target=_answer,
                args=(device, listener.accept(), authkey.encode()),
                daemon=True,
            )
            client.start()


def _answer(device: Device, connection: "Connection[Any, Any]", authkey: bytes) -> None:
    """Answer one client until it goes.

    The handshake is done here too, so that a client that freezes in it keeps nobody else out.
    """
    try:
        deliver_challenge(connection, authkey)
        answer_challenge(connection, authkey)
        while True:
            call, arguments = connection.recv()
            try:
                if call in OWNERS_CALLS:
                    arguments = (connection, *arguments)
                elif call not in ANYBODYS_CALLS:
                    raise ConfigError(f"call {call!r} is unknown to this device")
                answer = (True, getattr(device, call)(*arguments))
            except HardwareError as error:
                answer = (False, error)
            connection.send(answer)
    except (AuthenticationError, EOFError, OSError):
        pass  # the client is not ours, or is gone; its output is held
    finally:
        device.disown(connection)
        connection.close()


def main() -> None:
    """Run the device from the command line."""
    parser = argparse.ArgumentParser(description="A simulated rig in a process of its own.")
    parser.add_argument("--address", default="127.0.0.1:7450", help="host:port; port 0: any")
    parser.add_argument("--authkey", default="frictus", help="as in the configuration")
    options = parser.parse_args()
    host, port = options.address.rsplit(":", 1)
    serve((host, int(port)), options.authkey, _print)


def _print(address: str) -> None:
    sys.stdout.write(f"{address}\n")
    sys.stdout.flush()


if __name__ == "__main__":
    main()
