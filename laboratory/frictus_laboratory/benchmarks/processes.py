"""What a measurement starts: the service at free ports, and a process beside this one.

What must not share an interpreter with the measurement runs beside it. How long that takes
hangs on the machine and on what else it does: it is waited for as long as it gets on, which its
processor time tells.
"""

import contextlib
import multiprocessing
import signal
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from multiprocessing.connection import Connection
from typing import Any, Final, TypeAlias

import psutil
import zenoh

import frictus
from frictus.keys import Topics
from frictus.session import is_read
from frictus_hardware import BackendConfig, SimulatedConfig
from frictus_hardware.simulated.strokes import SteadyStrokes
from frictus_service.config import ApiConfig, Config, Limits, RouterConfig
from frictus_service.daemon.processes.child_process import PATIENCE_S, PartName, StartProgress
from frictus_service.daemon.processes.supervisor import Supervisor
from frictus_service.errors import StartError
from frictus_service.processes import free_endpoint, free_port

RIG: Final = "rig1"
QUIET_S: Final = 10.0
"""A rig that says nothing for so long is taken for dead."""
STEADY: Final = SimulatedConfig(finger=SteadyStrokes())


def config_of(backend: BackendConfig = STEADY, limits: Limits | None = None) -> Config:
    """Return the configuration of a service at free ports."""
    return Config(
        rig=RIG,
        backend=backend,
        router=RouterConfig(endpoint=free_endpoint()),
        api=ApiConfig(port=free_port()),
        limits=limits or Limits(),
    )


@contextmanager
def serving(config: Config, parts: Sequence[PartName] = ("rig",)) -> Iterator[Supervisor]:
    """Run the service; what it says is told only if it does not start.

    Raises
    ------
    StartError
        If it does not start.
    """
    said: list[str] = []
    with Supervisor(config, parts, say=said.append) as supervisor:
        try:
            supervisor.wait_ready(120.0)
        except StartError:
            sys.stderr.write("\n".join([*said, ""]))
            raise
        yield supervisor


def await_status(
    rig: frictus.Rig, holds: Callable[[frictus.RigStatus], bool]
) -> frictus.RigStatus:
    """Return the first status for which something holds, the present one included.

    Raises
    ------
    SilenceError
        If the rig says nothing for a minute.
    """
    with rig.watch(Topics.STATUS, timeout_s=60.0) as states:
        return next(s for s in states if isinstance(s, frictus.RigStatus) and holds(s))


Pipe: TypeAlias = "Connection[Any, Any]"
Work: TypeAlias = Callable[..., None]

END_S: Final = 10.0
LOOK_S: Final = 1.0


class Neighbour:
    """The other process, seen from this one.

    Parameters
    ----------
    pid : int
        Its process id.
    pipe : Connection
        To it.
    """

    def __init__(self, pid: int, pipe: Pipe) -> None:
        self.pid = pid
        self._pipe = pipe

    def tell(self, word: object) -> None:
        """Say something to it."""
        self._pipe.send(word)

    def has_spoken(self) -> bool:
        """Return whether it has said something that was not yet heard."""
        return self._pipe.poll()

    def heard(self, patience_s: float = PATIENCE_S) -> Any:
        """Return what it says next.

        Parameters
        ----------
        patience_s : float
            For how long it may compute nothing before it is given up.

        Raises
        ------
        StartError
            If it says nothing and stands still, or has ended.
        """
        try:
            _await_word(self._pipe.poll, lambda: used_s(self.pid), StartProgress(), patience_s)
            return self._pipe.recv()
        except (EOFError, OSError) as error:
            raise StartError("a process that helps to measure has ended") from error

    def ask(self, word: object) -> Any:
        """Say something and return the answer; raises as `heard`."""
        self.tell(word)
        return self.heard()


def used_s(pid: int) -> float:
    """Return the processor time of a process, s; 0 once it has ended.

    Parameters
    ----------
    pid : int
        Its process id.
    """
    try:
        times = psutil.Process(pid).cpu_times()
    except psutil.NoSuchProcess:
        return 0.0
    return float(times.user + times.system)


@contextmanager
def neighbour(work: Work, *given: object) -> Iterator[Neighbour]:
    """Run `work(pipe, *given)` in a process of its own until the context ends.

    It must send something once it is ready, and ends when receiving raises `EOFError`.

    Parameters
    ----------
    work : callable
        A function of a module.
    given : object
        What can be pickled.

    Raises
    ------
    StartError
        If it does not get ready.
    """
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_run, args=(work, theirs, *given), daemon=True)
    process.start()
    theirs.close()
    assert process.pid is not None
    other = Neighbour(process.pid, ours)
    try:
        other.heard()
        yield other
    finally:
        ours.close()
        process.join(END_S)
        if process.is_alive():
            process.kill()
            process.join()
        process.close()


def _await_word(
    has_come: Callable[[float], bool],
    processor_s: Callable[[], float],
    progress: StartProgress,
    patience_s: float,
) -> None:
    """Wait for a word for as long as the processor time of who shall say it grows.

    Parameters
    ----------
    has_come : callable
        Waits so many seconds at most, and returns whether there is a word.
    processor_s : callable
        Returns the processor time.
    progress : StartProgress
        Of the processor time of the other process.
    patience_s : float

    Raises
    ------
    StartError
        If it has not grown for so long.
    """
    before_s = processor_s()
    while not has_come(LOOK_S):
        now_s = processor_s()
        if now_s > before_s:
            before_s = now_s
            progress.move()
        elif progress.left_s(patience_s) <= 0.0:
            raise StartError(
                f"a process that helps to measure stood still for {patience_s:g} s: "
                "measure again with less beside it"
            )


def await_subscriber(publisher: zenoh.Publisher) -> None:
    """Wait until somebody subscribes to what is published.

    Raises
    ------
    StartError
        If nobody does in time.
    """
    deadline_s = time.monotonic() + END_S
    while not is_read(publisher):
        if time.monotonic() > deadline_s:
            raise StartError(f"nobody subscribed to {publisher.key_expr}")
        time.sleep(0.01)


def _run(work: Work, pipe: Pipe, *given: object) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # whoever started it ends it
    with contextlib.suppress(EOFError, BrokenPipeError, ConnectionResetError):
        work(pipe, *given)
