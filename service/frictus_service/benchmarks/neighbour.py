"""A process beside this one, for what must not share an interpreter with the measurement."""

import contextlib
import multiprocessing
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing.connection import Connection
from typing import Any, Final, TypeAlias

from frictus_service.errors import StartError

Pipe: TypeAlias = "Connection[Any, Any]"
Work: TypeAlias = Callable[..., None]

START_S: Final = 60.0
END_S: Final = 10.0


@contextmanager
def neighbour(work: Work, *given: object) -> Iterator[Pipe]:
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
    try:
        heard(ours, START_S)
        yield ours
    finally:
        ours.close()
        process.join(END_S)
        if process.is_alive():
            process.kill()
            process.join()
        process.close()


def heard(pipe: Pipe, timeout_s: float) -> Any:
    """Return what the neighbour says next.

    Raises
    ------
    StartError
        If it says nothing in time, or has ended.
    """
    try:
        if pipe.poll(timeout_s):
            return pipe.recv()
    except (EOFError, OSError) as error:
        raise StartError("a process that helps to measure has ended; see above") from error
    raise StartError(f"a process that helps to measure said nothing for {timeout_s:g} s")


def _run(work: Work, pipe: Pipe, *given: object) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # whoever started it ends it
    with contextlib.suppress(EOFError, BrokenPipeError, ConnectionResetError):
        work(pipe, *given)
