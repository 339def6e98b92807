"""The process of one job: ``python -m frictus_service.jobs.worker``.

It reads its order from its input, then what an experiment's pages answer, and says on its
output how it goes. The input ends when the job is cancelled, and when whoever started it is
gone: then it stops, its rig disarmed.
"""

import importlib
import os
import queue
import signal
import sys
import threading
import traceback
from collections.abc import Callable
from typing import IO, Final

import frictus
from frictus.errors import FrictusError
from frictus_service.calibration.job import CalibrationResult, Progress
from frictus_service.discovery.jobs import DiscoveryProgress, DiscoveryResult
from frictus_service.errors import (
    CancelledError,
    DiscoveryCancelledError,
    ExperimentCancelledError,
    ServiceError,
)
from frictus_service.experiments.job import Input, ParticipantScreen
from frictus_service.jobs.process import (
    INPUT,
    ORDER,
    AnyOrder,
    Completed,
    DiscoveryOrder,
    Done,
    ExperimentOrder,
    Failed,
    Found,
    Looked,
    Moved,
    Order,
    Said,
    ScreenChanged,
    Stopped,
)
from frictus_service.processes import quiet_numerics

GRACE_S: Final = 3.0
"""Whoever does not stop within this is ended; the rig then disarms, as its lease runs out."""


def main() -> None:
    """Carry out the order."""
    quiet_numerics()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for whoever started us
    output = _take_output()
    line, rest = _read_line()
    order = ORDER.validate_json(line)
    stop = threading.Event()
    inputs: queue.SimpleQueue[Input] = queue.SimpleQueue()
    threading.Thread(target=_follow_input, args=(rest, inputs, stop), daemon=True).start()

    def say(word: Said) -> None:
        output.write(word.model_dump_json(by_alias=True).encode() + b"\n")
        output.flush()

    try:
        say(_carry_out(order, inputs, say, stop.is_set))
    except BrokenPipeError:
        pass  # nobody is left to be told; what is finished stands in the folder


def _carry_out(
    order: AnyOrder,
    inputs: "queue.SimpleQueue[Input]",
    say: Callable[[Said], None],
    cancelled: Callable[[], bool],
) -> Said:
    module, _, function = order.run.partition(":")
    try:
        run = getattr(importlib.import_module(module), function)
        if isinstance(order, DiscoveryOrder):
            return _discover(run, order, say, cancelled)
        if isinstance(order, ExperimentOrder):
            return _experiment(run, order, inputs, say, cancelled)
        return _calibrate(run, order, say, cancelled)
    except (CancelledError, DiscoveryCancelledError, ExperimentCancelledError):
        return Stopped()
    except (ServiceError, FrictusError) as error:
        return Failed(reason=str(error))
    except BrokenPipeError:
        raise
    except Exception as error:
        traceback.print_exc()
        return Failed(reason=f"unexpected {type(error).__name__}: {error}")


def _calibrate(
    run: Callable[..., CalibrationResult],
    order: Order,
    say: Callable[[Said], None],
    cancelled: Callable[[], bool],
) -> Said:
    def tell(progress: Progress) -> None:
        say(Moved(progress=progress))

    with frictus.connect(order.router, order.client, tls=order.tls) as client:
        return Done(result=run(order.spec, order.folder, client, tell, cancelled))


def _discover(
    run: Callable[..., DiscoveryResult],
    order: DiscoveryOrder,
    say: Callable[[Said], None],
    cancelled: Callable[[], bool],
) -> Said:
    def tell(progress: DiscoveryProgress) -> None:
        say(Looked(progress=progress))

    return Found(result=run(order.spec, order.study, order.folder, tell, cancelled))


def _experiment(
    run: Callable[..., None],
    order: ExperimentOrder,
    inputs: "queue.SimpleQueue[Input]",
    say: Callable[[Said], None],
    cancelled: Callable[[], bool],
) -> Said:
    def tell(screen: ParticipantScreen) -> None:
        say(ScreenChanged(screen=screen))

    with frictus.connect(order.router, order.client, tls=order.tls) as client:
        given = (order.job, order.protocol, order.folder, client, order.site)
        run(*given, inputs, tell, cancelled)
    return Completed()


def _take_output() -> IO[bytes]:
    """Return what was standard output; whatever else is printed goes to standard error."""
    own = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    return own


def _read_line() -> tuple[bytes, bytes]:
    """Return the order, and what came behind it."""
    # Not by sys.stdin: its lock would be held by the thread that waits for the end.
    line = b""
    while b"\n" not in line:
        more = os.read(sys.stdin.fileno(), 1 << 16)
        if not more:
            raise EOFError("the order did not come")
        line += more
    first, _, rest = line.partition(b"\n")
    return first, rest


def _follow_input(
    rest: bytes, inputs: "queue.SimpleQueue[Input]", stop: threading.Event
) -> None:
    """Pass on what is answered; when the input ends, the job is to stop."""
    while True:
        *lines, rest = rest.split(b"\n")
        for line in lines:
            inputs.put(INPUT.validate_json(line))
        if not (more := os.read(sys.stdin.fileno(), 1 << 16)):
            break
        rest += more
    stop.set()
    threading.Event().wait(GRACE_S)
    os._exit(1)


if __name__ == "__main__":
    main()
