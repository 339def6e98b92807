"""Runs a supervisor until it is interrupted."""

import signal
import time
from collections.abc import Callable, Sequence
from types import FrameType

from frictus_service.config import Config
from frictus_service.daemon.processes.child_process import PartName, ServiceManager
from frictus_service.daemon.processes.supervisor import ALL, Supervisor, to_stderr


def serve(
    config: Config,
    parts: Sequence[PartName] = ALL,
    host_router: bool | None = None,
    say: Callable[[str], None] = to_stderr,
    is_over: Callable[[], bool] = lambda: False,
) -> None:
    """Run the service until Ctrl-C, SIGTERM or, on Windows, Ctrl-Break; then stop cleanly.

    Call it from the main thread.

    Parameters
    ----------
    config, parts, host_router, say
        As for `Supervisor`.
    is_over : callable
        Asked ten times a second, once all parts are ready; True stops them, too.

    Raises
    ------
    StartError, LinkError
        If the service cannot start.
    """
    told: list[int] = []  # not an Event: its lock may be held by whom the signal interrupts

    def on_signal(number: int, _frame: FrameType | None) -> None:
        told.append(number)

    manager = ServiceManager()

    def say_and_show(line: str) -> None:
        say(line)
        manager.status(line)

    names = ("SIGINT", "SIGTERM", "SIGBREAK")
    numbers = [getattr(signal, name) for name in names if hasattr(signal, name)]
    former = {number: signal.signal(number, on_signal) for number in numbers}
    try:
        with Supervisor(
            config, parts, host_router, say_and_show, manager.keep_alive
        ) as supervisor:
            supervisor.wait_ready()
            manager.ready()
            say_and_show("ready; Ctrl-C stops")
            while not (told or is_over()):
                time.sleep(0.1)  # Windows sees Ctrl-C only between waits
            manager.stopping()
            say_and_show("stopping: the output ramps to zero" if "rig" in parts else "stopping")
    finally:
        for number, handler in former.items():
            signal.signal(number, handler)
