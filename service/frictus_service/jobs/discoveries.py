"""The discoveries of this machine: one at a time, as each uses all processors."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from frictus_service.config import Config
from frictus_service.discovery.jobs import (
    DiscoveryJob,
    DiscoveryProgress,
    DiscoveryResult,
    DiscoverySpec,
    DiscoveryStore,
)
from frictus_service.errors import TooManyJobsError
from frictus_service.jobs.engine import JobEngine
from frictus_service.jobs.process import ParentLink, Work

MOST: Final = 100
"""That run or wait for their turn; of one person, half of them."""
DISCOVER: Final = "frictus_service.discovery.jobs:carry_out"


class DiscoveryWork(Work):
    """As `frictus_service.discovery.jobs.carry_out` is called."""

    spec: DiscoverySpec
    studies: tuple[Path, ...]

    def carry_out(self, run: Callable[..., Any], parent: ParentLink) -> DiscoveryResult:
        """Discover."""
        given = (self.spec, self.studies, self.folder)
        result: DiscoveryResult = run(*given, parent.report, parent.cancelled)
        return result


class DiscoveryEngine(JobEngine[DiscoveryJob]):
    """Runs discoveries. All methods may be called from any thread.

    Parameters
    ----------
    config : Config
        Its folder of studies is used.
    run : str
        ``module:function`` that carries out one discovery.
    """

    kind = "discovery"

    def __init__(self, config: Config, run: str = DISCOVER) -> None:
        self.store = DiscoveryStore(config.studies)
        self._run = run
        super().__init__(self.store, self.store.interrupt, at_once=1)

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
        UnknownStudyError, TooManyJobsError
        """
        self.recover()
        with self._lock:
            theirs = [each.job.created_by == by for each in self._jobs.values()]
            if len(theirs) >= MOST or sum(theirs) >= MOST // 2:
                raise TooManyJobsError(
                    f"{len(theirs)} discoveries run or wait for their turn, {sum(theirs)} of "
                    f"them yours; accepted: {MOST}, and {MOST // 2} of one person. Cancel "
                    "some, or ask again once some have ended"
                )
            job = self.store.create(spec, by)
            self._launch(job)
        return job

    def _work(self, job: DiscoveryJob) -> DiscoveryWork:
        return DiscoveryWork(
            run=self._run,
            folder=self.store.folder(job.id),
            spec=job.spec,
            studies=tuple(map(self.store.study, job.spec.studies)),
        )

    def _hear(self, job: str, progress: str) -> None:
        self.store.progress(job, DiscoveryProgress.model_validate_json(progress))

    def _outcome(self, result: str) -> dict[str, Any]:
        return {"result": DiscoveryResult.model_validate_json(result)}
