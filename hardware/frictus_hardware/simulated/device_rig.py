"""The backend that drives a simulated device in another process."""

import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from multiprocessing import AuthenticationError
from multiprocessing.connection import Client, Connection, answer_challenge, deliver_challenge
from typing import Any

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_hardware.base import Exchange, Opened, RigInfo
from frictus_hardware.errors import ClosedError, ConfigError, LinkLostError
from frictus_hardware.output import DeviceOutput
from frictus_hardware.simulated.config import SimulatedConfig, SimulatedDeviceConfig
from frictus_hardware.simulated.twin import info_of


class Link:
    """One connection to the device; one call at a time.

    Parameters
    ----------
    config : SimulatedDeviceConfig

    Raises
    ------
    LinkLostError
        If no device listens at the address.
    ConfigError
        If the device refuses the authkey.
    """

    def __init__(self, config: SimulatedDeviceConfig) -> None:
        self._address = config.address
        self._timeout_s = config.timeout_s
        self._lock = threading.Lock()
        try:
            self._connection = _connect(config)
        except AuthenticationError as error:
            raise ConfigError(f"the device at {config.address} refuses the authkey") from error
        except (OSError, EOFError) as error:
            raise LinkLostError(
                f"no simulated device at {config.address} ({error}): start one with "
                f"python -m frictus_hardware.simulated.device --address {config.address}"
            ) from error

    def call(self, name: str, *arguments: object, extra_s: float = 0.0) -> Any:
        """Return the device's answer.

        Raises
        ------
        HardwareError
            What the device raised, or `LinkLostError` if it does not answer.
        """
        with self._lock:
            try:
                self._connection.send((name, arguments))
                if not self._connection.poll(self._timeout_s + extra_s):
                    self._connection.close()  # a late answer would be taken for the next one's
                    raise TimeoutError(f"no answer within {self._timeout_s + extra_s:g} s")
                ok, answer = self._connection.recv()
            except (OSError, EOFError) as error:
                raise LinkLostError(
                    f"the simulated device at {self._address} is gone: {error}"
                ) from error
        if not ok:
            raise answer
        return answer

    def close(self) -> None:
        """Close the connection; the device goes on."""
        self._connection.close()


def _connect(config: SimulatedDeviceConfig) -> "Connection[Any, Any]":
    """Return a connection after the handshake, which `Client` would do without a time limit."""
    connection = Client(config.endpoint)
    assert isinstance(connection, Connection)  # over TCP it is no pipe of Windows
    try:
        for step in (answer_challenge, deliver_challenge):
            step(_Impatient(connection, config.timeout_s), config.authkey.encode())  # type: ignore[arg-type]
    except BaseException:
        connection.close()
        raise
    return connection


class _Impatient:
    """A connection as the handshake uses it, where nothing is waited for without end."""

    def __init__(self, connection: "Connection[Any, Any]", timeout_s: float) -> None:
        self._connection, self._timeout_s = connection, timeout_s
        self.send_bytes = connection.send_bytes

    def recv_bytes(self, most: int) -> bytes:
        if not self._connection.poll(self._timeout_s):
            raise TimeoutError(f"it is frozen, no answer within {self._timeout_s:g} s")
        return self._connection.recv_bytes(most)


class SimulatedDeviceRig(Opened):
    """See `frictus_hardware.base.Backend`; `truth` of an exchange is always there.

    Parameters
    ----------
    config : SimulatedDeviceConfig
        Address of the device, and the rig that it is.
    """

    def __init__(self, config: SimulatedDeviceConfig) -> None:
        self.config = config
        # Two links, because one is busy while an exchange waits.
        self._blocks: Link | None = None
        self._control: Link | None = None
        self._info = replace(info_of(config.rig), backend=config.kind)
        self._next_play_sample = self._info.lead_samples

    @property
    def info(self) -> RigInfo:
        """What does not change while the backend is open, but for the lead."""
        return self._info

    @property
    def next_play_sample(self) -> int:
        """Device index at which the next drive handed over will start to play."""
        return self._next_play_sample

    def open(self) -> None:
        """Start the sample clock with the lead prefilled with zeros; disarmed.

        Raises
        ------
        LinkLostError
            If no device listens at the address.
        """
        if self._blocks is not None:
            return
        blocks = Link(self.config)
        try:
            control = Link(self.config)
            blocks.call("open", self.config.rig, extra_s=60.0)  # the device may compile first
            blocks.call("lengthen_lead", self._info.lead_samples)
        except BaseException:
            blocks.close()
            raise
        self._blocks, self._control = blocks, control
        self._next_play_sample = self._info.lead_samples

    def arm(self) -> None:
        """Allow output other than zero."""
        self._linked(self._blocks).call("arm")

    def lengthen_lead(self, lead_samples: int) -> None:
        """Have what is handed over from now on play later; zeros play in between.

        Parameters
        ----------
        lead_samples : int
            The lead in force to that of `max_lead_ms`.
        """
        self._linked(self._blocks).call("lengthen_lead", lead_samples)
        self._next_play_sample += lead_samples - self._info.lead_samples
        self._info = replace(self._info, lead_samples=lead_samples)

    def exchange(self, drive_v: FloatArray) -> Exchange:
        """Hand over the next block of output; wait for as many sensed samples."""
        drive_v = np.asarray(drive_v, dtype=np.float64)
        block_s = drive_v.size / self._info.clock_hz
        exchange: Exchange = self._linked(self._blocks).call(
            "exchange", drive_v, extra_s=block_s
        )
        end = exchange.first_sample + exchange.applied_v.size
        self._next_play_sample = end + self._info.lead_samples
        return exchange

    def stop(self, ramp_s: float) -> None:
        """Ramp what is queued to zero within `ramp_s`, drop the rest, and disarm."""
        if self._control is not None:
            self._control.call("stop", ramp_s)

    def health(self) -> str | None:
        """Return what is wrong with the device, or None."""
        if self._control is None:
            return "not open"
        try:
            answer: str | None = self._control.call("health")
        except LinkLostError as error:
            return str(error)
        return answer

    def move_finger(
        self, x_mm: float, y_mm: float, in_contact: bool, normal_force_n: float = 0.4
    ) -> None:
        """Move a finger of kind `client` or `takeover`; from any thread."""
        self._linked(self._control).call("move_finger", x_mm, y_mm, in_contact, normal_force_n)

    @property
    def follows_guidance(self) -> bool:
        """Whether the finger is of kind `guided` or `takeover`."""
        return self.config.rig.follows_guidance

    def guide_finger(
        self, speed_mm_s: float, force_n: float, span_mm: tuple[float, float]
    ) -> None:
        """Tell a finger of kind `guided` or `takeover` what to do; from any thread."""
        self._linked(self._control).call("guide_finger", speed_mm_s, force_n, span_mm)

    def close(self) -> None:
        """Bring the output to zero and release the device. Closing twice is harmless."""
        blocks, control = self._blocks, self._control
        self._blocks = self._control = None
        if blocks is None or control is None:
            return
        try:
            blocks.call("close")
        except LinkLostError:
            pass  # nothing is left to release
        finally:
            blocks.close()
            control.close()

    def _linked(self, link: Link | None) -> Link:
        if link is None:
            raise ClosedError("the rig is not open: call open(), or use it in a with statement")
        return link


def reset(config: SimulatedDeviceConfig) -> None:
    """Put the output of a device to zero, whoever drives it.

    Raises
    ------
    LinkLostError
        If no device listens at the address.
    """
    _once(config, "reset")


def recent_output(config: SimulatedDeviceConfig, seconds: float) -> DeviceOutput:
    """Return what a device has output during the last seconds.

    Raises
    ------
    LinkLostError
        If no device listens at the address.
    """
    output: DeviceOutput = _once(config, "output", seconds)
    return output


@contextmanager
def launched(rig: SimulatedConfig) -> Iterator[SimulatedDeviceConfig]:
    """Run a device in a process of its own at any free port, until the context ends.

    Raises
    ------
    LinkLostError
        If it does not come up.
    """
    command = [sys.executable, "-m", "frictus_hardware.simulated.device"]
    with subprocess.Popen(
        [*command, "--address", "127.0.0.1:0"], stdout=subprocess.PIPE, text=True
    ) as process:
        try:
            address = process.stdout.readline().strip() if process.stdout else ""
            if not address:
                raise LinkLostError("the simulated device did not come up")
            yield SimulatedDeviceConfig(address=address, rig=rig)
        finally:
            process.kill()


def _once(config: SimulatedDeviceConfig, name: str, *arguments: object) -> Any:
    link = Link(config)
    try:
        return link.call(name, *arguments)
    finally:
        link.close()
