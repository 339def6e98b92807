"""Jobs of one kind that this API process runs: queued, followed, cancelled, resumed.

Where a job stands is always what its store says. One API process runs the jobs of a store: what
is there as running when that process starts was interrupted.
"""

import logging
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, ClassVar, Final, Generic, Protocol, TypeVar

from frictus_service.errors import ServiceError, UnknownJobError
from frictus_service.job_folder import ACTIVE, State
from frictus_service.jobs.process import JobProcess, Word, Work

AGAIN_S: Final = 1.0
"""After which it is tried again to keep what became of a job."""
_LOG: Final = logging.getLogger(__name__)


class JobDocument(Protocol):
    """What any job says of itself."""

    @property
    def id(self) -> str:
        """Its id."""

    @property
    def state(self) -> State:
        """Where it stands."""


Job = TypeVar("Job", bound=JobDocument)
Kept = TypeVar("Kept", bound=JobDocument, covariant=True)


class JobStore(Protocol[Kept]):
    """Where the jobs of one kind are kept."""

    def get(self, job: str, /) -> Kept:
        """Return a job."""

    def state(self, job: str, /) -> State:
        """Return in which state a job is, at less cost."""

    def change(
        self,
        job: str,
        to: State,
        /,
        *,
        of: Sequence[State],
        result: Any = None,
        failure: str | None = None,
    ) -> Kept:
        """Put a job that is in one of the states `of` into another, and return it."""


@dataclass(slots=True)
class _Running(Generic[Job]):
    """A job that is queued or runs."""

    job: Job
    turn: "Future[None] | None" = None
    process: JobProcess | None = None
    cancelled: bool = False


class RigUse:
    """One job on a rig at a time, of whatever kind.

    Attributes
    ----------
    beginning : Lock
        Held from the question whether a rig is free until the job that asked is kept.
    checks : list of callable
        One of each kind of job: raises where one is under way on a rig.
    """

    def __init__(self) -> None:
        self.beginning = threading.Lock()
        self.checks: list[Callable[[str], None]] = []

    def require_free(self, rig: str) -> None:
        """Raise if a job is under way on a rig.

        Raises
        ------
        RigBusyError, RigInExperimentError
        """
        for check in self.checks:
            check(rig)


class JobEngine(ABC, Generic[Job]):
    """Runs jobs, each in a process of its own. All methods may be called from any thread.

    A kind of job says how one is begun, what its process is given, and what its words mean.

    Parameters
    ----------
    store : JobStore
        Keeps them.
    interrupt : callable
        Notes in the store that whatever ran, or waited, does so no more.
    at_once : int
        How many run at a time; others wait for their turn.

    Attributes
    ----------
    kind : str
        What a job is called.
    cancellable, resumable : tuple of str
        States in which a job that this process does not run can be given up, and gone on with.
    closing : bool
        Whether the API is about to end.
    """

    kind: ClassVar[str]
    cancellable: ClassVar[tuple[State, ...]] = ACTIVE
    resumable: ClassVar[tuple[State, ...]] = ()

    def __init__(
        self, store: JobStore[Job], interrupt: Callable[[], object], at_once: int
    ) -> None:
        self._store = store
        self._interrupt = interrupt
        # Held while a job is kept and launched: one that is cancelled between would run.
        self._lock = threading.RLock()
        self._jobs: dict[str, _Running[Job]] = {}
        self._turns = ThreadPoolExecutor(at_once, thread_name_prefix=self.kind)
        self._recovered = False
        self._recovering = threading.Lock()
        self.closing = False

    @abstractmethod
    def _work(self, job: Job) -> Work:
        """Return what the process of a job is given."""

    @abstractmethod
    def _hear(self, job: str, progress: str) -> None:
        """Take in what a job is at, as JSON."""

    @abstractmethod
    def _outcome(self, result: str) -> dict[str, Any]:
        """Return what the result of a job, as JSON, adds to its document."""

    def recover(self) -> None:
        """Note what an earlier process left running as interrupted; once."""
        with self._recovering:
            if not self._recovered:
                self._interrupt()
                self._recovered = True

    def get(self, job: str) -> Job:
        """Return where a job stands.

        Raises
        ------
        UnknownJobError, UnknownCalibrationError
        """
        self.recover()
        return self._store.get(job)

    def is_active(self, job: str) -> bool:
        """Return whether a job waits or runs, at less cost than `get`.

        Raises
        ------
        UnknownJobError, UnknownCalibrationError
        """
        self.recover()
        return self._store.state(job) in ACTIVE

    def cancel(self, job: str) -> Job:
        """Cancel a job that waits for its turn; or have it end, and be cancelled then.

        Raises
        ------
        UnknownJobError, UnknownCalibrationError, JobStateError, CalibrationStateError
        """
        self.recover()
        with self._lock:
            running = self._jobs.get(job)
            if running is not None:
                running.cancelled = True
                if running.turn is not None and running.turn.cancel():
                    del self._jobs[job]
                    running = None
                elif running.process is not None:
                    running.process.stop()
            if running is None:
                return self._store.change(job, "cancelled", of=self.cancellable)
        return self._store.get(job)

    def resume(self, job: str) -> Job:
        """Go on with a job that has ended early; what it has finished is kept.

        Raises
        ------
        UnknownJobError, UnknownCalibrationError, JobStateError, CalibrationStateError
        """
        self.recover()
        with self._lock:
            found = self._store.change(job, "queued", of=self.resumable)
            self._launch(found)
        return found

    def stop(self) -> None:
        """Tell everything that runs to stop; it is interrupted then."""
        with self._lock:
            self.closing = True
            for running in self._jobs.values():
                if running.process is not None:
                    running.process.stop()

    def close(self) -> None:
        """Stop everything, and wait until it has ended."""
        self.stop()
        self._turns.shutdown()

    def _launch(self, job: Job) -> None:
        running = _Running(job)
        with self._lock:
            self._jobs[job.id] = running
            running.turn = self._turns.submit(self._follow, job, running)

    def _process_of(self, job: str) -> JobProcess | None:
        """Return the process of a job that runs; called with the lock held."""
        running = self._jobs.get(job)
        return None if running is None or running.cancelled else running.process

    def _with_process(self) -> list[Job]:
        """Return the jobs that have a process, whatever became of what is kept of them."""
        with self._lock:
            return [each.job for each in self._jobs.values() if each.process is not None]

    def _follow(self, job: Job, running: _Running[Job]) -> None:
        """Run a job from beginning to end, when it is its turn."""
        last = None
        try:
            try:
                if not (running.cancelled or self.closing):
                    self._store.change(job.id, "running", of=("queued",))
                    last = self._carry_out(job, running)
            except UnknownJobError:
                pass  # said below, with what its process said last
            except Exception:
                _LOG.exception("%s %s broke off", self.kind, job.id)
            self._keep_outcome(job.id, running, last)
        except UnknownJobError as error:
            said = "" if last is None else f" ({last.kind}: {last.data})"
            _LOG.warning(
                "%s %s has ended%s, which is not kept: %s", self.kind, job.id, said, error
            )
        except Exception:
            # It stands there as running: the next API process makes that interrupted.
            _LOG.exception("%s %s: its state could not be kept", self.kind, job.id)
        finally:
            self._forget(job.id, running)

    def _forget(self, job: str, running: _Running[Job]) -> None:
        with self._lock:
            if self._jobs.get(job) is running:  # not if it was resumed meanwhile
                del self._jobs[job]

    def _carry_out(self, job: Job, running: _Running[Job]) -> Word | None:
        """Return the last word of the job's process; None if it ended without one."""
        try:
            process = JobProcess(self._work(job))
        except ServiceError as error:
            return Word(kind="failed", data=str(error))
        except OSError as error:
            return Word(kind="failed", data=f"its process could not be started: {error}")
        last = None
        with self._lock:
            running.process = process
            if running.cancelled or self.closing:
                process.stop()
        with process:
            for word in process.said():
                if word.kind != "progress":
                    last = word
                    continue
                try:
                    self._hear(job.id, word.data)
                except OSError as error:
                    # It goes on, a participant may be sliding; what counts is in its folder.
                    _LOG.warning("%s %s: progress was not kept: %s", self.kind, job.id, error)
        with self._lock:
            running.process = None
        if last is None and not (running.cancelled or self.closing):
            _LOG.warning("%s %s: its process ended by itself", self.kind, job.id)
        return last

    def _keep_outcome(self, job: str, running: _Running[Job], last: Word | None) -> None:
        """Keep what became of a job, once the disk or the database takes it."""
        said = ""
        while True:
            try:
                with self._lock:  # or who cancels it now is told that it will be
                    self._conclude(job, running, last)
                    return self._forget(job, running)
            except OSError as error:
                if self.closing:
                    raise
                if str(error) != said:
                    said = str(error)
                    _LOG.warning("%s %s: its state is not kept yet: %s", self.kind, job, said)
            time.sleep(AGAIN_S)

    def _conclude(self, job: str, running: _Running[Job], last: Word | None) -> None:
        change = self._store.change
        if last is not None and last.kind == "done":
            change(job, "done", of=ACTIVE, **self._outcome(last.data))
        elif last is not None and last.kind == "failed":
            change(job, "failed", of=ACTIVE, failure=last.data)
        elif running.cancelled:
            change(job, "cancelled", of=ACTIVE)
        else:
            change(job, "interrupted", of=ACTIVE)
