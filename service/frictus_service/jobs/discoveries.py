"""The discoveries that this API process runs: one at a time, as each uses all processors."""

from typing import Any, Final

from frictus_service.config import Config
from frictus_service.discovery.jobs import DiscoveryJob, DiscoverySpec, DiscoveryStore
from frictus_service.jobs.folder_jobs import FolderJobs
from frictus_service.jobs.process import DiscoveryOrder, Found, Looked, Said

DISCOVER: Final = "frictus_service.discovery.jobs:carry_out"


class Discoveries(FolderJobs[DiscoveryJob]):
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
        super().__init__(self.shelf, at_once=1)

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
        self._launch(job)
        return job

    def _order(self, job: DiscoveryJob) -> DiscoveryOrder:
        return DiscoveryOrder(
            run=self._run,
            spec=job.spec,
            study=self.shelf.study(job.spec.study),
            folder=self.shelf.folder(job.id),
        )

    def _hear(self, job: str, word: Said) -> None:
        if isinstance(word, Looked):
            self.shelf.progress(job, word.progress)

    def _outcome(self, last: Said | None) -> dict[str, Any] | None:
        return {"result": last.result} if isinstance(last, Found) else None
