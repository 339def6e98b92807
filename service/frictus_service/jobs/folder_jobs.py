"""Jobs of one kind that this API process runs: started, followed, cancelled.

One API process runs those of a folder: what stands there as running when that process starts
was interrupted.
"""

import logging
import threading
from abc import ABC, abstractmethod
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, Generic

from frictus_service.errors import JobStateError, ServiceError
from frictus_service.job_folder import ACTIVE, Job, JobFolder
from frictus_service.jobs.process import AnyOrder, Failed, JobProcess, Said

_LOG = logging.getLogger(__name__)


@dataclass(slots=True)
class _Running:
    """A job that is queued or runs."""

    process: JobProcess | None = None
    cancelled: bool = False


class FolderJobs(ABC, Generic[Job]):
    """Runs jobs, each in a process of its own. All methods may be called from any thread.

    Parameters
    ----------
    shelf : JobFolder
        Keeps them.
    at_once : int
        How many run at a time; others wait for their turn.
    """

    def __init__(self, shelf: JobFolder[Job], at_once: int) -> None:
        self._shelf = shelf
        self._lock = threading.Lock()
        self._jobs: dict[str, _Running] = {}
        self._turns = ThreadPoolExecutor(at_once, thread_name_prefix=shelf.kind)
        self.closing = False

    @abstractmethod
    def _order(self, job: Job) -> AnyOrder:
        """Return what the process of a job is told."""

    @abstractmethod
    def _hear(self, job: str, word: Said) -> None:
        """Take in what a job says before its last word."""

    @abstractmethod
    def _outcome(self, last: Said | None) -> dict[str, Any] | None:
        """Return what the last word of a job that is done adds; None where it is not done."""

    def cancel(self, job: str) -> Job:
        """Tell a job to stop; it is cancelled once its process has ended.

        Raises
        ------
        UnknownJobError, JobStateError
        """
        found = self._shelf.get(job)
        with self._lock:
            running = self._jobs.get(job)
            if running is not None:
                running.cancelled = True
                if running.process is not None:
                    running.process.stop()
        if running is None:
            raise JobStateError(
                f"{self._shelf.kind} {job} is {found.state}: only one that is queued or "
                "running can be cancelled"
            )
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
        with self._lock:
            self._jobs[job.id] = _Running()
        self._turns.submit(self._follow, job)

    def _process_of(self, job: str) -> JobProcess | None:
        """Return the process of a job that runs; called with the lock held."""
        running = self._jobs.get(job)
        return None if running is None or running.cancelled else running.process

    def _follow(self, job: Job) -> None:
        """Run a job from beginning to end, when it is its turn."""
        running = self._jobs[job.id]
        try:
            last = None
            if not (running.cancelled or self.closing):
                self._shelf.change(job.id, "running", of=("queued",))
                last = self._carry_out(job, running)
            self._conclude(job.id, running, last)
        except Exception:
            # It stands there as running: the next API process makes that interrupted.
            _LOG.exception("%s %s: its state could not be kept", self._shelf.kind, job.id)
        finally:
            with self._lock:
                if self._jobs.get(job.id) is running:  # not if it was resumed meanwhile
                    del self._jobs[job.id]

    def _carry_out(self, job: Job, running: _Running) -> Said | None:
        """Return the last word of the job's process; None if it ended without one."""
        try:
            process = JobProcess(self._order(job))
        except ServiceError as error:
            return Failed(reason=str(error))
        except OSError as error:
            return Failed(reason=f"its process could not be started: {error}")
        last: Said | None = None
        with process:
            with self._lock:
                running.process = process
                if running.cancelled or self.closing:
                    process.stop()
            for word in process.said():
                last = word
                self._hear(job.id, word)
        return last

    def _conclude(self, job: str, running: _Running, last: Said | None) -> None:
        change = self._shelf.change
        if (outcome := self._outcome(last)) is not None:
            change(job, "done", of=ACTIVE, **outcome)
        elif isinstance(last, Failed):
            change(job, "failed", of=ACTIVE, failure=last.reason)
        elif running.cancelled:
            change(job, "cancelled", of=ACTIVE)
        else:
            if not self.closing:
                _LOG.warning("%s %s: its process ended by itself", self._shelf.kind, job)
            change(job, "interrupted", of=ACTIVE)
