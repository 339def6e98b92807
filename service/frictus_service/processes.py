"""What the processes share: signals, heartbeat, priorities, garbage, warnings, free ports."""

import gc
import signal
import socket
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final, Protocol

LOOP_PRIORITY: Final = 20
PUBLISHER_PRIORITY: Final = 10
CALLS_PRIORITY: Final = 5
"""Of every other thread of a rig, Zenoh's among them, whose callbacks read commands. Real time
too: a thread that is set aside while it holds the interpreter's lock holds up the loop, at
whatever priority."""

PYTHON_FREEZES: Final = 1_000
"""At most so many objects are frozen by nobody: Python 3.12 freezes 375 in every collection."""

NUMERICAL: Final = r"(frictus_service|numpy|scipy|statsmodels)\b"


def quiet_numerics() -> None:
    """Say nothing, from now on, of divisions by zero and the like in numerical code.

    What cannot be computed is NaN, and a sentence says so; a warning of a library would tell a
    user nothing, and name a line of ours. Tests turn warnings into errors.
    """
    warnings.filterwarnings("ignore", category=RuntimeWarning, module=NUMERICAL)


class StopSignal(Protocol):
    """Such as an Event, of a thread or of a process."""

    def is_set(self) -> bool:
        """Return whether to stop."""
        ...


class ReadySignal(Protocol):
    """Such as an Event, of a thread or of a process."""

    def set(self) -> None:
        """Take note that calls or connections are answered."""
        ...


class Heartbeat(Protocol):
    """A number in shared memory, written by the loop alone; 0 says that nobody need watch."""

    value: int


def _of_the_terminal() -> list[int]:
    """Return the signals that reach every process of a terminal, of those this system has."""
    names = ("SIGINT", "SIGBREAK", "SIGHUP")
    return [getattr(signal, name) for name in names if hasattr(signal, name)]


@contextmanager
def interruption() -> Iterator[list[int]]:
    """Give a list that whatever tells a process to end fills, and ends nothing else.

    That is Ctrl-C, SIGTERM, a terminal that closes (unless `nohup` holds it off) and, on
    Windows, Ctrl-Break. A list, and no Event: its lock may be held by whom the signal
    interrupts. Call it from the main thread.
    """
    told: list[int] = []
    numbers = [signal.SIGTERM, *_of_the_terminal()]
    if sys.platform != "win32" and signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
        numbers.remove(signal.SIGHUP)
    former = {
        number: signal.signal(number, lambda number, _frame: told.append(number))
        for number in numbers
    }
    try:
        yield told
    finally:
        for number, handler in former.items():
            signal.signal(number, handler)


def leave_interrupts_to_the_parent() -> None:
    """Ignore what reaches every process of a terminal: whoever started this one acts on it."""
    for number in _of_the_terminal():
        signal.signal(number, signal.SIG_IGN)


@contextmanager
def existing_objects_frozen() -> Iterator[None]:
    """Leave what exists out of every collection of garbage until the end.

    A pass over everything that was ever imported takes 35 to 130 ms, and several times that
    on busy cores: nothing of the process moves meanwhile, and no lease is renewed. It is made
    once, before. Whoever has frozen some already ends that for all.
    """
    gc.collect()
    outermost = gc.get_freeze_count() < PYTHON_FREEZES
    gc.freeze()
    try:
        yield
    finally:
        if outermost:
            gc.unfreeze()


@contextmanager
def garbage_collection_off() -> Iterator[None]:
    """Keep the garbage collector from stopping a loop that moves blocks."""
    with existing_objects_frozen():
        gc.disable()
        try:
            yield
        finally:
            gc.enable()


def free_port() -> int:
    """Return a port of this machine that nobody uses just now."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def free_endpoint() -> str:
    """Return a Zenoh endpoint of this machine at a free port."""
    return f"tcp/127.0.0.1:{free_port()}"
