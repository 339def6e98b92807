"""A process beside this one, for what must not share an interpreter with the measurement."""

import contextlib
import multiprocessing
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing.connection import Connection
from typing import Any, Final, TypeAlias

import zenoh

from frictus.session import is_read
from frictus_service.errors import StartError

Pipe: TypeAlias = "Connection[Any, Any]"
Work: TypeAlias = Callable[..., None]

START_S: Final = 60.0
END_S: Final = 10.0
ANSWER_S: Final = 60.0


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

    def heard(self, timeout_s: float = ANSWER_S) -> Any:
        """Return what it says next.

        Raises
        ------
        StartError
            If it says nothing in time, or has ended.
        """
        try:
            if self._pipe.poll(timeout_s):
                return self._pipe.recv()
        except (EOFError, OSError) as error:
            raise StartError("a process that helps to measure has ended") from error
        raise StartError(f"a process that helps to measure said nothing for {timeout_s:g} s")

    def ask(self, word: object) -> Any:
        """Say something and return the answer; raises as `heard`."""
        self.tell(word)
        return self.heard()


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
        other.heard(START_S)
        yield other
    finally:
        ours.close()
        process.join(END_S)
        if process.is_alive():
            process.kill()
            process.join()
        process.close()


def await_subscriber(publisher: zenoh.Publisher, timeout_s: float = END_S) -> None:
    """Wait until somebody subscribes to what is published.

    Raises
    ------
    StartError
        If nobody does in time.
    """
    deadline_s = time.monotonic() + timeout_s
    while not is_read(publisher):
        if time.monotonic() > deadline_s:
            raise StartError(f"nobody subscribed to {publisher.key_expr}")
        time.sleep(0.01)


def _run(work: Work, pipe: Pipe, *given: object) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # whoever started it ends it
    with contextlib.suppress(EOFError, BrokenPipeError, ConnectionResetError):
        work(pipe, *given)
