"""Runs a supervisor until it is interrupted."""

import contextlib
import time
from collections.abc import Callable, Sequence

from frictus_service.config import Config
from frictus_service.daemon.processes.child_process import PartName, ServiceManager
from frictus_service.daemon.processes.supervisor import ALL, ASK_S, Supervisor, to_stderr
from frictus_service.processes import interruption


def serve(
    config: Config,
    parts: Sequence[PartName] = ALL,
    host_router: bool | None = None,
    say: Callable[[str], None] = to_stderr,
    is_over: Callable[[], bool] = lambda: False,
) -> None:
    """Run the service until it is told to end; then stop cleanly.

    Ctrl-C, SIGTERM, a terminal that closes and, on Windows, Ctrl-Break tell it, also while its
    parts start. Call it from the main thread.

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
    manager = ServiceManager()

    def say_and_show(line: str) -> None:
        with contextlib.suppress(OSError):  # the terminal is gone: the parts end in order
            say(line)
        manager.status(line)

    with (
        interruption() as told,
        Supervisor(config, parts, host_router, say_and_show, manager.keep_alive) as supervisor,
    ):
        supervisor.wait_ready(is_over=lambda: bool(told))
        if not told:
            manager.ready()
            say_and_show("ready; Ctrl-C stops")
        while not (told or is_over()):
            time.sleep(ASK_S)
        manager.stopping()
        say_and_show("stopping: the output ramps to zero" if "rig" in parts else "stopping")
