"""A whole service in processes of its own, supervisor included, so that any can be killed.

The device is a process too and outlives them all: it holds what its rig last gave it, as a real
one does, and tells what it has output.
"""

import contextlib
import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import Any, Final, TypeAlias

import numpy as np
import psutil
from tests.campaigns.owner import UPDATE_S, own
from tests.campaigns.service import START_S, Said

from frictus_hardware import SimulatedDeviceConfig
from frictus_hardware.simulated.device_rig import recent_output
from frictus_service.config import Config
from frictus_service.daemon.processes.child_process import PartName
from frictus_service.daemon.processes.supervisor import ALL, Supervisor

Pipe: TypeAlias = "Connection[Any, Any]"
LEASE_MS: Final = 300
QUIET_S: Final = 0.15
"""A device that has output nothing for so long is quiet."""
HISTORY_S: Final = 4.0
GONE_S: Final = 20.0


def host(
    config: Config, parts: tuple[PartName, ...], host_router: bool | None, pipe: Pipe
) -> None:
    """Run parts of a service until told to end, or nobody can; say what they say."""

    def say(line: str) -> None:
        with contextlib.suppress(OSError):  # whoever listened has closed the pipe
            pipe.send(line)

    with Supervisor(config, parts, host_router, say) as supervisor:
        supervisor.wait_ready(START_S)
        with contextlib.suppress(EOFError):
            pipe.recv()


def owner(endpoint: str, pipe: Pipe) -> None:
    """Be the owner until the other end of the pipe closes."""
    threading.Thread(target=_end_with, args=(pipe,), daemon=True).start()
    due = threading.Event()  # never set: a pause
    own(endpoint, LEASE_MS, lambda: due.wait(UPDATE_S))


def _end_with(pipe: Pipe) -> None:
    with contextlib.suppress(EOFError, OSError):
        pipe.recv()
    os._exit(0)


class Spawned:
    """A process that ends when its pipe says so or closes, or is killed."""

    def __init__(self, work: Callable[..., None], *given: object) -> None:
        context = multiprocessing.get_context("spawn")
        self.pipe, theirs = context.Pipe()
        self.process = context.Process(target=work, args=(*given, theirs))
        self.process.start()
        theirs.close()

    @property
    def pid(self) -> int:
        """Its process id."""
        assert self.process.pid is not None
        return self.process.pid

    def tell_end(self) -> None:
        """Have it end in order; by a word, since a pipe that a thread reads stays open."""
        with contextlib.suppress(OSError):  # it has ended
            self.pipe.send("end")

    def end(self, timeout_s: float = GONE_S) -> None:
        """Have it end in order; kill it where it does not."""
        self.tell_end()
        self.process.join(timeout_s)
        self.kill()
        self.pipe.close()

    def kill(self) -> None:
        """Kill it, frozen or not."""
        if self.process.is_alive():
            self.process.kill()
        self.process.join()


class Hosted:
    """Parts of a service in their own processes; started again by `start`.

    Parameters
    ----------
    config : Config
    parts : tuple of str
        None of them: the router alone.
    host_router : bool or None
        None: as configured.
    """

    def __init__(
        self,
        config: Config,
        parts: tuple[PartName, ...] = ALL,
        host_router: bool | None = None,
    ) -> None:
        self.config, self.parts, self._host_router = config, parts, host_router
        self.said = Said()
        self.starts = 0
        self._host: Spawned | None = None
        self._listener: threading.Thread | None = None

    def start(self) -> None:
        """Start the supervisor, and wait until every part is ready; raises as `await_ready`."""
        self.begin()
        self.await_ready()

    def begin(self) -> None:
        """Start the supervisor."""
        self.said = Said()
        self._host = Spawned(host, self.config, self.parts, self._host_router)
        self._listener = threading.Thread(target=self._listen, args=(self._host.pipe,))
        self._listener.start()
        self.starts += 1

    def await_ready(self) -> None:
        """Wait until router and parts are ready.

        Raises
        ------
        TimeoutError
            If they do not get so.
        """
        said = self.said
        if not (
            said.await_line(lambda line: line.startswith("router "), START_S)
            and said.await_ready(self.parts, START_S)
        ):
            raise TimeoutError(f"the service did not start: {self.said.lines[-5:]}")

    def _listen(self, pipe: Pipe) -> None:
        with contextlib.suppress(EOFError, OSError):
            while True:
                self.said(pipe.recv())

    def pid(self, name: str) -> int:
        """Return the process id of a part, or of the supervisor."""
        assert self._host is not None
        if name == "supervisor":
            return self._host.pid
        return self.said.pid(name)

    def end_with(self, pids: list[int]) -> list[int]:
        """Wait until processes that lost their supervisor have ended; return those left."""
        assert self._host is not None
        self._host.kill()
        until_s = time.monotonic() + GONE_S
        while (left := [pid for pid in pids if _runs(pid)]) and time.monotonic() < until_s:
            time.sleep(0.02)
        for pid in left:
            send(pid, "SIGKILL")
        self._forget()
        return left

    def tell_end(self) -> None:
        """Have it end in order, beside others; `end` waits for it."""
        if self._host is not None:
            self._host.tell_end()

    def end(self) -> None:
        """End it in order."""
        if self._host is not None:
            self._host.end()
            self._forget()

    def _forget(self) -> None:
        assert self._host is not None
        assert self._listener is not None
        self._host.pipe.close()
        self._listener.join()
        self._host = None


def _runs(pid: int) -> bool:
    """Return whether a process runs; one that nobody has waited for does not."""
    try:
        return bool(psutil.Process(pid).status() != psutil.STATUS_ZOMBIE)
    except psutil.NoSuchProcess:
        return False


def send(pid: int, name: str) -> None:
    """Send a signal to a process, if it is still there."""
    with contextlib.suppress(ProcessLookupError):
        os.kill(pid, getattr(signal, name))


def silent_after_ms(config: SimulatedDeviceConfig, since_s: float, limit_s: float) -> float:
    """Return how long after an instant a device output its last voltage, ms.

    Parameters
    ----------
    config : SimulatedDeviceConfig
    since_s : float
        Monotonic.
    limit_s : float
        A device that is still driven so long after it is returned as driven: infinity.
    """
    while True:
        output = recent_output(config, HISTORY_S)
        read_s = time.monotonic()
        rate_hz = config.rig.sample_rate_hz
        driven = np.flatnonzero(output.voltage_v)
        quiet_s = (
            (output.voltage_v.size - 1 - int(driven[-1])) / rate_hz
            if driven.size
            else HISTORY_S
        )
        if quiet_s >= QUIET_S:
            return max(0.0, 1e3 * (read_s - quiet_s - since_s))
        if read_s - since_s > limit_s:
            return float("inf")


def await_driven(config: SimulatedDeviceConfig, timeout_s: float) -> bool:
    """Wait until a device outputs a voltage; return whether it does."""
    until_s = time.monotonic() + timeout_s
    while time.monotonic() < until_s:
        if recent_output(config, 0.1).voltage_v.any():
            return True
    return False
