"""The discoveries that this API process runs: started, followed, cancelled.

One runs at a time, as each uses all processors; others wait for their turn. One API process
runs those of a folder of studies: what stands there as running when that process starts was
interrupted.
"""

import logging
import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Final

from frictus_service.config import Config
from frictus_service.discovery.jobs import ACTIVE, DiscoveryJob, DiscoverySpec, DiscoveryStore
from frictus_service.errors import DiscoveryStateError, UnknownStudyError
from frictus_service.jobs.process import DiscoveryOrder, Failed, Found, JobProcess, Looked, Said

DISCOVER: Final = "frictus_service.discovery.jobs:carry_out"
_LOG: Final = logging.getLogger(__name__)


@dataclass(slots=True)
class _Running:
    """A discovery that is queued or runs."""

    process: JobProcess | None = None
    cancelled: bool = False


class Discoveries:
    """Runs discoveries. All methods may be called from any thread.

    Parameters
    ----------
    config : Config
        Its folder of studies is used.
    run : str
        ``module:function`` that carries out one discovery.
    """

    def __init__(self, config: Config, run: str = DISCOVER) -> None:
        self.shelf = DiscoveryStore(config.studies)
        self._run = run
        self._lock = threading.Lock()
        self._jobs: dict[str, _Running] = {}
        self._turns = ThreadPoolExecutor(1, thread_name_prefix="discovery")
        self.closing = False

    def start(self, spec: DiscoverySpec, by: str) -> DiscoveryJob:
        """Start a discovery; return it as it was queued.

        Parameters
        ----------
        spec : DiscoverySpec
            What the discovery was asked for.
        by : str
            Who asks.

        Raises
        ------
        UnknownStudyError
        """
        job = self.shelf.create(spec, by)
        with self._lock:
            self._jobs[job.id] = _Running()
        self._turns.submit(self._follow, job)
        return job

    def cancel(self, discovery: str) -> DiscoveryJob:
        """Tell a discovery to stop; it is cancelled once its process has ended.

        Raises
        ------
        UnknownDiscoveryError, DiscoveryStateError
        """
        job = self.shelf.get(discovery)
        with self._lock:
            running = self._jobs.get(discovery)
            if running is not None:
                running.cancelled = True
                if running.process is not None:
                    running.process.stop()
        if running is None:
            raise DiscoveryStateError(
                f"discovery {discovery} is {job.state}: only one that is queued or running can "
                "be cancelled"
            )
        return job

    def close(self) -> None:
        """Stop everything, and wait until it has ended; it is interrupted then."""
        with self._lock:
            self.closing = True
            for running in self._jobs.values():
                if running.process is not None:
                    running.process.stop()
        self._turns.shutdown()

    def _follow(self, job: DiscoveryJob) -> None:
        """Run a discovery from beginning to end, when it is its turn."""
        try:
            running = self._jobs[job.id]
            last = None
            if not (running.cancelled or self.closing):
                self.shelf.change(job.id, "running", of=("queued",))
                last = self._carry_out(job, running)
            self._conclude(job.id, running, last)
        except Exception:
            # It stands there as running: the next API process makes that interrupted.
            _LOG.exception("discovery %s: its state could not be kept", job.id)
        finally:
            with self._lock:
                del self._jobs[job.id]

    def _carry_out(self, job: DiscoveryJob, running: _Running) -> Said | None:
        """Return the last word of the discovery's process; None if it ended without one."""
        try:
            order = DiscoveryOrder(
                run=self._run,
                spec=job.spec,
                study=self.shelf.study(job.spec.study),
                folder=self.shelf.folder(job.id),
            )
            process = JobProcess(order)
        except UnknownStudyError as error:
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
                if isinstance(word, Looked):
                    self.shelf.progress(job.id, word.progress)
                else:
                    last = word
        return last

    def _conclude(self, discovery: str, running: _Running, last: Said | None) -> None:
        if isinstance(last, Found):
            self.shelf.change(discovery, "done", of=ACTIVE, result=last.result)
        elif isinstance(last, Failed):
            self.shelf.change(discovery, "failed", of=ACTIVE, failure=last.reason)
        elif running.cancelled:
            self.shelf.change(discovery, "cancelled", of=ACTIVE)
        else:
            if not self.closing:
                _LOG.warning("discovery %s: its process ended by itself", discovery)
            self.shelf.change(discovery, "interrupted", of=ACTIVE)
