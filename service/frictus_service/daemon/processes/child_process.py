"""A part of the service in a process of its own, and how it tells that it lives.

A start is given up for stillness, not time: how long a first one takes hangs on the machine and
on what else it does, a minute of compiling alone, many beside busy neighbours. What is compiled
is kept function by function.

systemd is told by one datagram per message, to the socket that it names in the environment
(sd_notify(3)). Elsewhere, and on Windows, nothing is sent.

Two one-way pipes join them: the part tells each step of its start and that it moves, that it is
ready, failed, or has something to say; when the other pipe ends, by a stop or because the
supervisor is gone, the part stops.
"""

import contextlib
import os
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, Final, Literal

from frictus.errors import FrictusError
from frictus_hardware.errors import HardwareError
from frictus_service.config import Config
from frictus_service.daemon.safety import FormerRun
from frictus_service.errors import ServiceError
from frictus_service.processes import Heartbeat, leave_interrupts_to_the_parent

if sys.platform == "win32":  # where a pipe's end is of a class of its own
    from multiprocessing.connection import PipeConnection as Connection
else:
    from multiprocessing.connection import Connection

PATIENCE_S: Final = 60.0
"""A start in which nothing moves for so long has failed."""
FIRST_PAUSE_S: Final = 0.1
"""Before a part that has ended is started again, for the first time."""


class StartProgress:
    """When something last moved, and what it said it was doing.

    Parameters
    ----------
    now_s : callable
        Monotonic seconds.
    """

    def __init__(self, now_s: Callable[[], float] = time.monotonic) -> None:
        self._now_s = now_s
        self.begin()

    def begin(self) -> None:
        """Start anew; seconds count from here."""
        self._began_s = self._moved_s = self._said_s = self._now_s()
        self.step = "starting"

    def move(self, step: str = "") -> float:
        """Note that something moved; return the seconds since it began.

        Parameters
        ----------
        step : str
            What is done from now on; empty for the same as before.
        """
        self._moved_s = self._now_s()
        self.step = step or self.step
        return self._moved_s - self._began_s

    def due(self, every_s: float) -> bool:
        """Return whether to say what is done: that was so long ago, or it began then.

        Parameters
        ----------
        every_s : float
            Least time between two sayings.
        """
        due = self._moved_s - self._said_s >= every_s
        if due:
            self._said_s = self._moved_s
        return due

    def left_s(self, patience_s: float) -> float:
        """Return how much longer it may stand still; 0 or less: it has for too long."""
        return self._moved_s + patience_s - self._now_s()


COMPILING_S: Final = 5.0
"""Between two lines on what is compiled: fifty functions in half a minute, or in many."""


@contextmanager
def compiling_told(
    on_function: Callable[[str, str], None], on_pass: Callable[[], None]
) -> Iterator[None]:
    """Tell of what this process compiles meanwhile; what comes from the cache is not told.

    Parameters
    ----------
    on_function : callable
        Called as the compilation of each function begins, with its name and with how far that
        is, as in ``12 of up to 54 functions``. Those of Numba itself are not named.
    on_pass : callable
        Called as each pass of the compiler begins, some hundred for a function.
    """
    from numba.core import event  # late: a supervisor does without

    begun: list[str] = []
    most = 0

    class Told(event.Listener):
        def on_start(self, event: event.Event) -> None:
            nonlocal most
            if event.kind != "numba:compile" or _is_numbas(event.data["dispatcher"]):
                on_pass()
                return
            begun.append(event.data["dispatcher"].py_func.__name__)
            most = max(most or _functions_to_compile(), len(begun))
            on_function(begun[-1], f"{len(begun)} of up to {most} functions")

        def on_end(self, event: event.Event) -> None:
            """Do nothing: the next beginning says enough."""

    with (
        event.install_listener("numba:compile", Told()),
        event.install_listener("numba:run_pass", Told()),
    ):
        yield


def _is_numbas(dispatcher: Any) -> bool:
    return bool(dispatcher.py_func.__module__.startswith("numba."))


def _functions_to_compile() -> int:
    """Return how many functions of loaded modules are compiled once they are called."""
    from numba.core.dispatcher import Dispatcher

    modules = [*sys.modules.values()]
    loaded = [value for module in modules for value in [*vars(module).values()]]
    found = [value for value in loaded if isinstance(value, Dispatcher)]
    return len({id(each) for each in found if not _is_numbas(each)})


KEEP_ALIVES: Final = 4
"""Sent so often within the time after which systemd would act."""
STEP_US: Final = 120_000_000
"""What systemd grants from each line of the start on: it must not end one that gets on."""


class ServiceManager:
    """Whoever started this process and waits to hear from it.

    Parameters
    ----------
    environment : mapping
        With `NOTIFY_SOCKET` and `WATCHDOG_USEC` where systemd asks for them.
    monotonic_s : callable
        Monotonic clock, s.
    """

    def __init__(
        self,
        environment: Mapping[str, str] = os.environ,
        monotonic_s: Callable[[], float] = time.monotonic,
    ) -> None:
        address = environment.get("NOTIFY_SOCKET", "")
        # A leading @ stands for the zero byte of Linux's abstract names.
        self._address = f"\0{address[1:]}" if address.startswith("@") else address
        self._every_s = 1e-6 * int(environment.get("WATCHDOG_USEC", "0")) / KEEP_ALIVES
        self._monotonic_s = monotonic_s
        self._due_s = 0.0
        self._started = False

    def ready(self) -> None:
        """Say that the service has started."""
        self._started = True
        self._send("READY=1")

    def stopping(self) -> None:
        """Say that the service is about to end."""
        self._send("STOPPING=1")

    def status(self, line: str) -> None:
        """Show a line in `systemctl status`; during the start it also asks for more time."""
        more_time = "" if self._started else f"\nEXTEND_TIMEOUT_USEC={STEP_US}"
        self._send(f"STATUS={line.splitlines()[0] if line else ''}{more_time}")

    def keep_alive(self) -> None:
        """Say that all is well, if it is time to; silence has systemd start the unit again."""
        now_s = self._monotonic_s()
        if self._every_s > 0.0 and now_s >= self._due_s:
            self._due_s = now_s + self._every_s
            self._send("WATCHDOG=1")

    def _send(self, message: str) -> None:
        if sys.platform == "win32" or not self._address:
            return
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sender:
            sender.setblocking(False)  # the watch over the rig waits for nobody
            # Who does not hear us acts on our silence; there is nobody else to tell.
            with contextlib.suppress(OSError):
                sender.sendto(message.encode(), self._address)


PartName = Literal["rig", "api", "recorder", "tracker"]


@dataclass(slots=True)
class Part:
    """One part and its process, as its supervisor knows it.

    Attributes
    ----------
    name : PartName
        Of the part.
    heartbeat : shared counter
        Rises while its block loop runs.
    process : Process or None
        None while it does not run.
    telling, told : Connection or None
        Pipes to and from it; it stops when the former is closed.
    ready : threading.Event
        Set once it has said so.
    progress : StartProgress
        Of its start.
    failure : str
        Why it ended, or could not start.
    started_s, due_s : float
        When it was started, and is to be; monotonic.
    pause_s : float
        Before it is started the next time.
    starts, beats, looks : int
        Starts so far; the counter when it was last looked at, and at how many looks it stood.
    former : FormerRun or None
        How its last run ended.
    """

    name: PartName
    heartbeat: Any
    process: Any = None
    telling: "Connection[Any, Any] | None" = None
    told: "Connection[Any, Any] | None" = None
    ready: threading.Event = field(default_factory=threading.Event)
    progress: StartProgress = field(default_factory=StartProgress)
    failure: str = ""
    started_s: float = 0.0
    due_s: float = 0.0
    pause_s: float = FIRST_PAUSE_S
    starts: int = 0
    beats: int = 0
    looks: int = 0
    former: FormerRun | None = None


Word = Literal["ready", "failed", "say", "step", "moved"]
"""``step`` is said at once; what has ``moved``, perhaps to another step, now and then."""
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
    former: FormerRun | None,
) -> None:
    """Run a part; the target of its process.

    Parameters
    ----------
    name : {'rig', 'api', 'recorder', 'tracker'}
    config : Config
        Of the service.
    told : Connection
        Ends when the part shall stop.
    telling : Connection
        Takes what the part has to say.
    heartbeat : Heartbeat
        That the supervisor watches.
    former : FormerRun or None
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
                lambda function, far: mouth.tell("moved", f"compiling {function}, {far}"),
                lambda: mouth.tell("moved"),
            ):
                run_rig(
                    config,
                    heartbeat,
                    mouth,
                    stop,
                    former,
                    lambda line: mouth.tell("say", line),
                    lambda step: mouth.tell("step", step),
                )
        elif name == "recorder":
            from frictus_service.recording.recorder import run_recorder

            run_recorder(config, mouth, stop, lambda line: mouth.tell("say", line))
        elif name == "tracker":
            from frictus_service.tracking.process import run_tracker

            run_tracker(config, mouth, stop, lambda line: mouth.tell("say", line))
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
    # So that the parts end in order: a rig that is killed leaves its device driven.
    leave_interrupts_to_the_parent()
    if sys.platform != "win32":
        signal.signal(signal.SIGTERM, lambda _number, _frame: stop.set())
