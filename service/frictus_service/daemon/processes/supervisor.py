"""The supervisor: hosts the router, starts the parts, watches them, makes the output safe.

It learns of a part's death by the process sentinel and of a frozen loop by a counter in shared
memory, never over the network. A rig that died or froze leaves its device holding the last
value: the device is reset first, then everybody is told, then the rig is started again,
disarmed.
"""

import contextlib
import multiprocessing
import sys
import threading
import time
from collections.abc import Callable, Sequence
from multiprocessing.connection import wait
from typing import Final, Self

import zenoh

from frictus.errors import LinkError
from frictus.messages import Fault
from frictus.session import open_session
from frictus_service.config import Config
from frictus_service.daemon.processes.child_process import (
    COMPILING_S,
    FIRST_PAUSE_S,
    PATIENCE_S,
    Part,
    PartName,
    run_part,
)
from frictus_service.daemon.processes.trip_notice import TripNotice
from frictus_service.daemon.safety import AGAIN, FormerRun
from frictus_service.errors import StartError
from frictus_service.security.members import tls_of_rig
from frictus_service.security.router import open_secured_router

ALL: Final[tuple[PartName, ...]] = ("rig", "api", "recorder", "tracker")
STARTS_AFTER: Final[dict[PartName, PartName]] = {"tracker": "rig"}
"""A part that follows another, and loads so much that it would hold up that one's start."""
LOOKS: Final = 5
"""A counter must stand still over so many looks: a supervisor that was itself held up has
looked less often, and does not blame the rig."""
STOP_S: Final = 5.0
"""How long a part may take to stop before it is killed."""
LONGEST_PAUSE_S: Final = 10.0
"""A part that keeps ending is started again ever more rarely."""
SOUND_S: Final = 60.0
"""A part that has run so long starts with the shortest pause again."""
ASK_S: Final = 0.1
"""Windows sees Ctrl-C only between waits."""


def to_stderr(line: str) -> None:
    """Write a line to standard error."""
    sys.stderr.write(f"{line}\n")


class Supervisor:
    """Runs the parts of the service while it is entered.

    Parameters
    ----------
    config : Config
        Of the service.
    parts : sequence of str
        Which parts: `rig`, `api`, `recorder`, `tracker`.
    host_router : bool or None
        Whether to listen at the router's endpoint; None: as configured.
    say : callable
        Told, line by line, what an operator should know; standard error by default.
    alive : callable
        Called at each look, several within `freeze_ms`, at which no block loop stands still.
    """

    def __init__(
        self,
        config: Config,
        parts: Sequence[PartName] = ALL,
        host_router: bool | None = None,
        say: Callable[[str], None] = to_stderr,
        alive: Callable[[], None] = lambda: None,
    ) -> None:
        self._config = config
        self._alive = alive
        self._host_router = config.router.host if host_router is None else host_router
        self._tell = say
        self._context = multiprocessing.get_context("spawn")
        self._parts = {
            name: Part(name, self._context.Value("Q", 0, lock=False)) for name in parts
        }
        self._stopping = threading.Event()
        self._changed = threading.Condition()
        self._trip_notice: TripNotice | None = None
        self._undo = contextlib.ExitStack()
        self._watcher = threading.Thread(target=self._watch, name="frictus-supervisor")

    def pid_of(self, name: PartName) -> int:
        """Return the process id of a part that runs."""
        return int(self._parts[name].process.pid)

    def wait_ready(
        self,
        patience_s: float = PATIENCE_S,
        names: Sequence[PartName] = ALL,
        is_over: Callable[[], bool] = lambda: False,
    ) -> None:
        """Wait until parts are ready, for as long as those that are not get on.

        Parameters
        ----------
        patience_s : float
            For how long a part may stand still before its start has failed.
        names : sequence of str
            Which parts; those that this supervisor does not run are not waited for.
        is_over : callable
            Asked ten times a second; True ends the wait, whoever is ready.

        Raises
        ------
        StartError
            If a part cannot start, with its reason, or stands still.
        """
        with self._changed:
            while not is_over():
                waiting = [
                    part
                    for part in self._parts.values()
                    if part.name in names and not part.ready.is_set()
                ]
                for part in waiting:
                    if part.failure:
                        raise StartError(f"{part.name}: {part.failure}")
                if not waiting:
                    return
                # One that waits for another's readiness is not still: it has not begun.
                begun = [
                    part for part in waiting if part.starts or part.name not in STARTS_AFTER
                ]
                if not begun:
                    self._changed.wait(ASK_S)
                    continue
                stillest = min(begun, key=lambda part: part.progress.left_s(patience_s))
                left_s = stillest.progress.left_s(patience_s)
                if left_s <= 0.0:
                    raise StartError(
                        f"{stillest.name} stood still for {patience_s:g} s while "
                        f"{stillest.progress.step}: start again, what was compiled is kept; "
                        "`frictus doctor` says what this machine lacks"
                    )
                self._changed.wait(min(left_s, ASK_S))

    def __enter__(self) -> Self:
        """Open the router and start the parts.

        Raises
        ------
        StartError
            If nothing can listen at the router's endpoint.
        LinkError
            If the router runs elsewhere, and none answers there.
        """
        endpoint = self._config.router.endpoint
        with contextlib.ExitStack() as undo:
            self._session = undo.enter_context(self._opened())
            if "rig" in self._parts:
                self._trip_notice = TripNotice(self._session, self._config.keys)
                undo.callback(self._trip_notice.close)
            self._undo = undo.pop_all()
        self._say(f"router {'listens' if self._host_router else 'found'} at {endpoint}")
        self._start_due()
        self._watcher.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Stop the parts in order: the output ramps to zero before the router goes."""
        self._stopping.set()
        self._watcher.join()
        for part in self._parts.values():
            self._stop(part)
        self._undo.close()
        self._say("stopped")

    def _opened(self) -> zenoh.Session:
        config = self._config
        if self._host_router:
            try:
                return open_secured_router(config)
            except LinkError as error:  # no link that is missing: it is a part of this service
                raise StartError(f"router: {error}") from error
        api_alone = set(self._parts) == {"api"}
        tls = config.tls("client") if api_alone else tls_of_rig(config)
        return open_session(config.router.endpoint, tls=tls)

    def _start(self, part: Part) -> None:
        part_told, telling = self._context.Pipe(duplex=False)
        told, part_telling = self._context.Pipe(duplex=False)
        part.ready.clear()
        part.heartbeat.value = 0
        process = self._context.Process(
            target=run_part,
            args=(
                part.name,
                self._config,
                part_told,
                part_telling,
                part.heartbeat,
                part.former,
            ),
            name=f"frictus-{part.name}",
            daemon=True,
        )
        part.started_s = time.monotonic()
        try:
            process.start()
        except OSError as error:  # the machine has no room for it now
            telling.close()
            told.close()
            self._put_off(part, f"{part.name} could not be started: {error}")
            return
        finally:
            # Only the child holds its ends now: they close with it.
            part_told.close()
            part_telling.close()
        part.process = process
        part.telling, part.told = telling, told
        part.progress.begin()
        part.starts += 1

    def _watch(self) -> None:
        look_s = 1e-3 * self._config.limits.freeze_ms / LOOKS
        looked_s = time.monotonic()
        while not self._stopping.is_set():
            try:
                self._follow(look_s)
                if time.monotonic() - looked_s >= look_s:
                    looked_s = time.monotonic()
                    self._look_for_freeze()
                self._start_due()
            except Exception as error:  # whatever it is: a rig that freezes must be ended
                self._say(f"the supervisor met a bug, and goes on: {error!r}")
                self._stopping.wait(look_s)

    def _follow(self, look_s: float) -> None:
        """Wait for what parts say, and for their ends."""
        running = [part for part in self._parts.values() if part.process is not None]
        sources = [part.process.sentinel for part in running]
        sources += [part.told for part in running if part.told is not None]
        if not sources:
            self._stopping.wait(look_s)
        ended = wait(sources, look_s) if sources else []
        for part in running:
            if part.told in ended:
                self._listen(part)
            if part.process.sentinel in ended:
                part.process.join()  # the exit code is known only now
                self._listen(part)
                self._on_death(part, _how_it_ended(part.process.exitcode))

    def _say(self, line: str) -> None:
        # The reader of standard error may be gone, its disk full: what watches over voltage
        # goes on, and has nobody to tell.
        with contextlib.suppress(Exception):
            self._tell(line)

    def _listen(self, part: Part) -> None:
        """Take what a part has to say."""
        try:
            while part.told is not None and part.told.poll():
                word, line = part.told.recv()
                if word == "say":
                    self._say(f"{part.name}: {line}")
                elif word in ("step", "moved"):
                    self._on_progress(part, line, 0.0 if word == "step" else COMPILING_S)
                elif word == "ready":
                    self._on_ready(part)
                else:
                    part.failure = line
        except (EOFError, OSError):
            if part.told is not None:
                part.told.close()
            part.told = None

    def _on_progress(self, part: Part, step: str, every_s: float) -> None:
        after_s = part.progress.move(step)
        if part.progress.due(every_s):
            self._say(f"{part.name}, {after_s:.1f} s: {part.progress.step}")

    def _on_ready(self, part: Part) -> None:
        part.failure = ""
        if part.name == "rig" and self._trip_notice is not None:
            self._trip_notice.withdraw()
        again = f", start {part.starts}" if part.starts > 1 else ""
        after_s = part.progress.move("running")
        self._say(
            f"{part.name} is ready (process {part.process.pid}{again}) after {after_s:.1f} s"
        )
        with self._changed:
            part.ready.set()
            self._changed.notify_all()

    def _look_for_freeze(self) -> None:
        for part in self._parts.values():
            beats = part.heartbeat.value
            stands = part.process is not None and beats != 0 and beats == part.beats
            part.looks = part.looks + 1 if stands else 0
            part.beats = beats
            if part.looks >= LOOKS:
                part.looks = 0
                part.process.kill()
                part.process.join()
                self._listen(part)
                self._on_death(
                    part, f"its block loop stood still for {self._config.limits.freeze_ms} ms"
                )
        # A rig that is being started, or waits for its device, counts as alive: it drives
        # nothing, and to start everything anew would help neither.
        if not any(part.looks for part in self._parts.values()):
            self._alive()

    def _on_death(self, part: Part, how: str) -> None:
        part.process.close()
        part.process = None
        for pipe in (part.telling, part.told):
            if pipe is not None:
                pipe.close()
        part.telling = part.told = None
        reason = f"the {part.name} process ended: {part.failure or how}"
        if part.name == "rig":
            reason = self._make_safe(part, reason)
        self._put_off(part, reason)
        with self._changed:
            part.failure = part.failure or reason
            self._changed.notify_all()

    def _put_off(self, part: Part, reason: str) -> None:
        now_s = time.monotonic()
        if now_s - part.started_s > SOUND_S:
            part.pause_s = FIRST_PAUSE_S
        part.due_s = now_s + part.pause_s
        self._say(f"{reason}; it is started again in {part.pause_s:.1f} s")
        part.pause_s = min(2.0 * part.pause_s, LONGEST_PAUSE_S)

    def _make_safe(self, part: Part, reason: str) -> str:
        """Reset the device, then tell everybody; return the reason with what came of it."""
        reason += f"; {self._reset_device() or 'the device was reset'}"
        fault = Fault(kind="internal", reason=reason, utc_ns=time.time_ns(), action=AGAIN)
        part.former = FormerRun(fault)
        try:
            if self._trip_notice is not None:
                part.former = self._trip_notice.former_run(fault)
                self._trip_notice.tell(part.former)
        except (zenoh.ZError, LinkError) as error:
            self._say(f"could not be published: {error}")
        return reason

    def _start_due(self) -> None:
        for part in self._parts.values():
            due = part.process is None and time.monotonic() >= part.due_s
            if due and not self._held_back(part):
                self._start(part)

    def _held_back(self, part: Part) -> bool:
        """Whether the part that it starts after, if that runs here, is not ready."""
        first = self._parts.get(STARTS_AFTER.get(part.name, part.name))
        return first is not None and first is not part and not first.ready.is_set()

    def _stop(self, part: Part) -> None:
        if part.process is None:
            return
        if part.telling is not None:
            part.telling.close()
        part.process.join(STOP_S)
        if part.process.is_alive():
            self._say(f"{part.name} did not stop within {STOP_S:g} s and was killed")
            part.process.kill()
            part.process.join()
        killed = part.process.exitcode != 0
        part.process.close()
        part.process = None
        if part.told is not None:
            part.told.close()
        if part.name == "rig" and killed and (failure := self._reset_device()):
            self._say(failure)

    def _reset_device(self) -> str:
        """Reset the device; return what people must know where it could not be."""
        try:
            self._config.backend.reset()
        except Exception as error:  # whatever it is: those that follow are to be ended, too
            return f"the device could NOT be reset ({error}): switch it off by hand"
        return ""


def _how_it_ended(exitcode: int | None) -> str:
    if exitcode is not None and exitcode < 0:
        return f"killed by signal {-exitcode}"
    return f"exit code {exitcode}"
