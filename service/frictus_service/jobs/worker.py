"""The process of one job: ``python -m frictus_service.jobs.worker MODULE:WORK``.

It reads its work from its input, then what an experiment's pages answer, and says on its
output how it goes. The input ends when the job is cancelled, and when whoever started it is
gone: then it stops, its rig disarmed.
"""

import importlib
import os
import queue
import sys
import threading
import traceback
from collections.abc import Callable
from typing import IO, Any, Final

from pydantic import BaseModel

from frictus.errors import FrictusError
from frictus_service.durable import file_of
from frictus_service.errors import (
    CancelledError,
    DiscoveryCancelledError,
    ExperimentCancelledError,
    ServiceError,
)
from frictus_service.jobs.process import ParentLink, Word, Work
from frictus_service.processes import leave_interrupts_to_the_parent, quiet_numerics

STILL_S: Final = 3.0
"""Whoever started us and takes nothing for so long stands still, and cannot end us."""
GRACE_S: Final = 3.0
"""Whoever does not stop within this is ended; the rig then disarms, as its lease runs out."""


def main() -> None:
    """Do the work."""
    quiet_numerics()
    leave_interrupts_to_the_parent()
    output = _take_output()
    line, rest = _read_line()
    if not line:
        return  # it was cancelled before it was given any
    work: Work = _named(sys.argv[1]).model_validate_json(line)
    stop = threading.Event()
    inputs: queue.SimpleQueue[Any] = queue.SimpleQueue()

    def take(line: bytes) -> None:
        if work.inputs is not None:
            inputs.put(work.inputs.validate_json(line))

    threading.Thread(target=_follow_input, args=(rest, take, stop), daemon=True).start()

    def say(word: Word) -> None:
        # To wait here would hold a trial as it is, its drive on; with us our token falls.
        watchdog = threading.Timer(STILL_S, os._exit, (1,))
        watchdog.daemon = True
        watchdog.start()
        try:
            output.write(word.model_dump_json().encode() + b"\n")
            output.flush()
        finally:
            watchdog.cancel()

    def report(progress: BaseModel) -> None:
        say(Word(kind="progress", data=progress.model_dump_json(by_alias=True)))

    try:
        say(_carry_out(work, ParentLink(report, inputs, stop.is_set)))
    except BrokenPipeError:
        pass  # nobody is left to be told; what is finished stands in the folder


def _named(name: str) -> Any:
    module, _, what = name.partition(":")
    return getattr(importlib.import_module(module), what)


def _carry_out(work: Work, parent: ParentLink) -> Word:
    try:
        result = work.carry_out(_named(work.run), parent)
    except (CancelledError, DiscoveryCancelledError, ExperimentCancelledError):
        return Word(kind="stopped")
    except BrokenPipeError:
        raise
    except (ServiceError, FrictusError) as error:
        return Word(kind="failed", data=str(error))
    except OSError as error:  # a disk, a file: no bug
        why = f"{file_of(error)} could not be read or written ({error.strerror or error})"
        return Word(kind="failed", data=f"{why}: have its machine mended, and start it again")
    except Exception as error:
        traceback.print_exc()
        return Word(kind="failed", data=f"unexpected {type(error).__name__}: {error}")
    return Word(kind="done", data=result.model_dump_json(by_alias=True) if result else "")


def _take_output() -> IO[bytes]:
    """Return what was standard output; whatever else is printed goes to standard error."""
    own = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    return own


def _read_line() -> tuple[bytes, bytes]:
    """Return the work, empty if none comes, and what came behind it."""
    # Not by sys.stdin: its lock would be held by the thread that waits for the end.
    line = b""
    while b"\n" not in line:
        more = os.read(sys.stdin.fileno(), 1 << 16)
        if not more:
            return b"", b""
        line += more
    first, _, rest = line.partition(b"\n")
    return first, rest


def _follow_input(rest: bytes, take: Callable[[bytes], None], stop: threading.Event) -> None:
    """Pass on what is answered; when the input ends, the job is to stop."""
    while True:
        *lines, rest = rest.split(b"\n")
        for line in lines:
            take(line)
        if not (more := os.read(sys.stdin.fileno(), 1 << 16)):
            break
        rest += more
    stop.set()
    threading.Event().wait(GRACE_S)
    os._exit(1)


if __name__ == "__main__":
    main()
