"""The experiments that this API process runs: one on a rig at a time, answered by pages."""

import threading
from typing import Any, Final

from frictus.errors import ArgumentError
from frictus.experiment.tasks import checked
from frictus_service.config import Config
from frictus_service.errors import JobStateError, RigInExperimentError
from frictus_service.experiments.job import (
    GO_ON,
    Answer,
    ExperimentJob,
    ExperimentSpec,
    ExperimentStore,
    ParticipantScreen,
    Pause,
)
from frictus_service.job_folder import State
from frictus_service.jobs.folder_jobs import FolderJobs
from frictus_service.jobs.process import Completed, ExperimentOrder, Said, ScreenChanged

PRESENT: Final = "frictus_service.experiments.run:run_experiment"
AT_ONCE: Final = 16
RESUMABLE: Final[tuple[State, ...]] = ("interrupted", "failed", "cancelled")
RESTING: Final = ("ready", "break")


class Experiments(FolderJobs[ExperimentJob]):
    """Runs experiments. All methods may be called from any thread.

    Parameters
    ----------
    config : Config
        Its site, router and folder of studies are used.
    run : str
        ``module:function`` that carries out one experiment.
    """

    def __init__(self, config: Config, run: str = PRESENT) -> None:
        self.shelf = ExperimentStore(config.studies)
        self._config, self._run = config, run
        self._screens: dict[str, ParticipantScreen] = {}
        self._shown = 0
        self._starting = threading.Lock()
        super().__init__(self.shelf, AT_ONCE)

    @property
    def changes(self) -> int:
        """Grows whenever any experiment shows something else, or is in another state."""
        return self.shelf.changes + self._shown

    def start(self, spec: ExperimentSpec, by: str) -> ExperimentJob:
        """Start an experiment; return it as it was queued.

        Parameters
        ----------
        spec : ExperimentSpec
            What the experiment was asked for.
        by : str
            Who asks.

        Raises
        ------
        ArgumentError, RigInExperimentError
        """
        with self._starting:
            self._require_free(spec.rig)
            job = self.shelf.create(spec, by)
        self._launch(job)
        return job

    def resume(self, experiment: str) -> ExperimentJob:
        """Go on with an experiment: after a pause, or from its log where it has ended early.

        Raises
        ------
        UnknownExperimentError, JobStateError, RigInExperimentError
        """
        job = self.shelf.get(experiment)
        if job.state == "running":
            return self.pause(experiment, False)
        with self._starting:
            if job.state in RESUMABLE:
                self._require_free(job.rig)
            job = self.shelf.change(experiment, "queued", of=RESUMABLE)
        self._launch(job)
        return job

    def pause(self, experiment: str, wanted: bool = True) -> ExperimentJob:
        """Have an experiment pause before its next trial, or go on.

        Parameters
        ----------
        experiment : str
            Its id.
        wanted : bool
            Whether it is to pause.

        Raises
        ------
        UnknownExperimentError, JobStateError
        """
        job = self.shelf.get(experiment)
        with self._lock:
            process, screen = self._process_of(experiment), self._screens.get(experiment)
            if process is None or screen is None:
                raise JobStateError(
                    f"experiment {experiment} is {job.state}: one that shows trials can pause"
                )
            process.tell(Pause(pause=wanted))
            self._show(experiment, screen.model_copy(update={"pausing": wanted}))
        return self.stands(experiment)

    def answer(self, experiment: str, given: Answer) -> ExperimentJob:
        """Pass an answer on; the same question takes no other one.

        Parameters
        ----------
        experiment : str
            Its id.
        given : Answer
            What the participant answers.

        Raises
        ------
        UnknownExperimentError, JobStateError
        ArgumentError
            If the task has no such answer.
        """
        job = self.shelf.get(experiment)
        with self._lock:
            process, screen = self._process_of(experiment), self._screens.get(experiment)
            if process is None or screen is None:
                raise JobStateError(f"experiment {experiment} is {job.state}: it asks nothing")
            resting = screen.phase in RESTING
            asked = resting or screen.phase == "question"
            if not asked or (given.trial, given.step) != (screen.trial, screen.step):
                raise JobStateError(
                    f"question {given.step} of trial {given.trial} is not asked (any more): "
                    f"trial {screen.trial} is under way; show what GET says now"
                )
            if not resting:
                answer = checked(job.task, given.answer)
            elif (answer := given.answer) != GO_ON:
                raise ArgumentError(f"{answer!r}: {GO_ON!r} is accepted now")
            process.tell(given.model_copy(update={"answer": answer}))
            self._show(experiment, screen.model_copy(update={"phase": "wait"}))
        return self.stands(experiment)

    def stands(self, experiment: str) -> ExperimentJob:
        """Return where an experiment stands, with what its pages show now.

        Raises
        ------
        UnknownExperimentError
        """
        return self.with_screen(self.shelf.get(experiment))

    def with_screen(self, job: ExperimentJob) -> ExperimentJob:
        """Return a job with what its pages show now.

        Parameters
        ----------
        job : ExperimentJob
            As it is kept.
        """
        screen = self._screens.get(job.id) if job.state == "running" else None
        return job.model_copy(update={"screen": screen})

    def _require_free(self, rig: str) -> None:
        if (other := self.shelf.active_on(rig)) is not None:
            raise RigInExperimentError(
                f"experiment {other.id} ({other.protocol}, {other.participant}) is under way "
                f"on rig {rig!r}: wait for its end, or stop it"
            )

    def _order(self, job: ExperimentJob) -> ExperimentOrder:
        config = self._config
        self._screens.pop(job.id, None)  # of an earlier run
        return ExperimentOrder(
            run=self._run,
            # Whoever finds the rig held reads who began it.
            client=f"{job.created_by}.experiment-{job.id[-8:]}",
            router=config.router.endpoint,
            tls=config.tls("client"),
            site=config.site,
            job=job,
            protocol=self.shelf.protocol(job.id),
            folder=self.shelf.folder(job.id),
        )

    def _hear(self, job: str, word: Said) -> None:
        if isinstance(word, ScreenChanged):
            with self._lock:
                self._show(job, word.screen)

    def _outcome(self, last: Said | None) -> dict[str, Any] | None:
        return {} if isinstance(last, Completed) else None

    def _show(self, experiment: str, screen: ParticipantScreen) -> None:
        self._screens[experiment] = screen
        self._shown += 1
