"""The process of one job: ``python -m frictus_service.jobs.worker``.

It reads its order from its input and says on its output how it goes. The input ends when the
job is cancelled, and when whoever started it is gone: then it stops, a calibration's rig
disarmed.
"""

import importlib
import os
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
from frictus_service.errors import CancelledError, DiscoveryCancelledError, ServiceError
from frictus_service.jobs.process import (
    ORDER,
    AnyOrder,
    DiscoveryOrder,
    Done,
    Failed,
    Found,
    Looked,
    Moved,
    Order,
    Said,
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
    order = ORDER.validate_json(_read_line())
    stop = threading.Event()
    threading.Thread(target=_stop_with_input, args=(stop,), daemon=True).start()

    def say(word: Said) -> None:
        output.write(word.model_dump_json(by_alias=True).encode() + b"\n")
        output.flush()

    try:
        say(_carry_out(order, say, stop.is_set))
    except BrokenPipeError:
        pass  # nobody is left to be told; what is finished stands in the folder


def _carry_out(
    order: AnyOrder, say: Callable[[Said], None], cancelled: Callable[[], bool]
) -> Said:
    module, _, function = order.run.partition(":")
    try:
        run = getattr(importlib.import_module(module), function)
        if isinstance(order, DiscoveryOrder):
            return _discover(run, order, say, cancelled)
        return _calibrate(run, order, say, cancelled)
    except (CancelledError, DiscoveryCancelledError):
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


def _take_output() -> IO[bytes]:
    """Return what was standard output; whatever else is printed goes to standard error."""
    own = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    return own


def _read_line() -> bytes:
    # Not by sys.stdin: its lock would be held by the thread that waits for the end.
    line = b""
    while not line.endswith(b"\n"):
        more = os.read(sys.stdin.fileno(), 1 << 16)
        if not more:
            raise EOFError("the order did not come")
        line += more
    return line


def _stop_with_input(stop: threading.Event) -> None:
    while os.read(sys.stdin.fileno(), 1 << 10):
        pass
    stop.set()
    threading.Event().wait(GRACE_S)
    os._exit(1)


if __name__ == "__main__":
    main()
