"""A part of the service in a process of its own, as its supervisor starts it.

Two one-way pipes join them: the part tells each step of its start and that it moves, that it is
ready, failed, or has something to say; when the other pipe ends, by a stop or because the
supervisor is gone, the part stops.
"""

import signal
import sys
import threading
from multiprocessing.connection import Connection
from typing import Any, Literal

from frictus.errors import FrictusError
from frictus.messages import FaultKind
from frictus_hardware.errors import HardwareError
from frictus_service.config import Config
from frictus_service.daemon.heartbeat import Heartbeat
from frictus_service.daemon.progress import compiling_told
from frictus_service.errors import ServiceError

PartName = Literal["rig", "api", "recorder"]
Word = Literal["ready", "failed", "say", "step", "moved"]
FAILED_EXIT = 3
"""Exit code of a part that could not start or go on, and has said why."""


class _Mouth:
    """Tells the supervisor; from any thread."""

    def __init__(self, pipe: "Connection[Any, Any]") -> None:
        self._pipe = pipe
        self._lock = threading.Lock()

    def tell(self, what: Word, line: str = "") -> None:
        with self._lock:
            try:
                self._pipe.send((what, line))
            except OSError:
                pass  # the supervisor is gone; the other pipe tells so too

    def set(self) -> None:
        """Say that the part is ready: the shape of an event."""
        self.tell("ready")


def run_part(
    name: PartName,
    config: Config,
    told: "Connection[Any, Any]",
    telling: "Connection[Any, Any]",
    heartbeat: Heartbeat,
    fault: tuple[FaultKind, str] | None,
) -> None:
    """Run a part; the target of its process.

    Parameters
    ----------
    name : {'rig', 'api', 'recorder'}
    config : Config
        Of the service.
    told : Connection
        Ends when the part shall stop.
    telling : Connection
        Takes what the part has to say.
    heartbeat : Heartbeat
        That the supervisor watches.
    fault : tuple of kind and reason, or None
        Why the rig had to be started again.
    """
    stop = threading.Event()
    _leave_interrupts_to_the_supervisor(stop)
    threading.Thread(target=_wait_for_the_end, args=(told, stop), daemon=True).start()
    mouth = _Mouth(telling)
    try:
        mouth.tell("step", "loading")
        if name == "rig":
            from frictus_service.daemon.rig import run_rig

            with compiling_told(
                lambda function: mouth.tell("step", f"compiling {function}"),
                lambda: mouth.tell("moved"),
            ):
                run_rig(
                    config,
                    heartbeat,
                    mouth,
                    stop,
                    fault,
                    lambda line: mouth.tell("say", line),
                    lambda step: mouth.tell("step", step),
                )
        elif name == "recorder":
            from frictus_service.recording.recorder import run_recorder

            run_recorder(config, mouth, stop, lambda line: mouth.tell("say", line))
        else:
            from frictus_service.api import server

            serve_api: Any = server.run_api  # typed for events of processes
            serve_api(config, stop, mouth)
    except (ServiceError, FrictusError, HardwareError) as error:
        mouth.tell("failed", str(error))
        sys.exit(FAILED_EXIT)
    except Exception as error:
        mouth.tell("failed", f"{type(error).__name__}: {error}")
        raise


def _wait_for_the_end(told: "Connection[Any, Any]", stop: threading.Event) -> None:
    try:
        told.recv()
    except (EOFError, OSError):
        pass
    stop.set()


def _leave_interrupts_to_the_supervisor(stop: threading.Event) -> None:
    # Ctrl-C reaches every process of a terminal; only the supervisor acts on it, so that the
    # parts end in order.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if sys.platform == "win32":
        signal.signal(signal.SIGBREAK, signal.SIG_IGN)
    else:
        signal.signal(signal.SIGTERM, lambda _number, _frame: stop.set())
