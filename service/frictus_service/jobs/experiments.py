"""The experiments of this machine: one on a rig at a time, answered by pages."""

from collections.abc import Callable
from typing import Any, Final

from pydantic import TypeAdapter

from frictus.errors import ArgumentError
from frictus.experiment import Protocol
from frictus.experiment.tasks import checked
from frictus_service.config import Config
from frictus_service.errors import JobStateError, RigInExperimentError
from frictus_service.experiments.job import (
    GO_ON,
    Answer,
    ExperimentJob,
    ExperimentSpec,
    ExperimentStore,
    Input,
    ParticipantScreen,
    Pause,
)
from frictus_service.jobs.engine import JobEngine, RigUse
from frictus_service.jobs.process import ParentLink, RigAccount, Work

PRESENT: Final = "frictus_service.experiments.run:run_experiment"
AT_ONCE: Final = 16
RESTING: Final = ("ready", "break")


class ExperimentWork(Work):
    """As `frictus_service.experiments.run.run_experiment` is called."""

    inputs = TypeAdapter(Input)
    account: RigAccount
    site: str
    job: ExperimentJob
    protocol: Protocol

    def carry_out(self, run: Callable[..., Any], parent: ParentLink) -> None:
        """Present the trials."""
        with self.account.connect() as client:
            given = (self.job, self.protocol, self.folder, client, self.site)
            run(*given, parent.inputs, parent.report, parent.cancelled)


class ExperimentEngine(JobEngine[ExperimentJob]):
    """Runs experiments. All methods may be called from any thread.

    Parameters
    ----------
    config : Config
        Its site, router and folder of studies are used.
    use : RigUse
        Of the rigs, with the other kinds of jobs.
    run : str
        ``module:function`` that carries out one experiment.
    """

    kind = "experiment"
    resumable = ("interrupted", "failed", "cancelled")

    def __init__(self, config: Config, use: RigUse, run: str = PRESENT) -> None:
        self.store = ExperimentStore(config.studies)
        self._config, self._run = config, run
        self._screens: dict[str, ParticipantScreen] = {}
        self._shown = 0
        self._use = use
        use.checks.append(self.require_free)
        super().__init__(self.store, self.store.interrupt, AT_ONCE)

    @property
    def changes(self) -> int:
        """Grows whenever any experiment shows something else, or is in another state."""
        return self.store.changes + self._shown

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
        ArgumentError, RigInExperimentError, RigBusyError
        """
        self.recover()
        with self._use.beginning, self._lock:
            self._use.require_free(spec.rig)
            job = self.store.create(spec, by)
            self._launch(job)
        return job

    def get(self, job: str) -> ExperimentJob:
        """Return where an experiment stands, with what its pages show now.

        Raises
        ------
        UnknownExperimentError
        """
        return self.with_screen(super().get(job))

    def resume(self, job: str) -> ExperimentJob:
        """Go on with an experiment: after a pause, or from its log where it has ended early.

        Raises
        ------
        UnknownExperimentError, JobStateError, RigInExperimentError, RigBusyError
        """
        found = self.get(job)
        if found.state == "running":
            return self.pause(job, False)
        with self._use.beginning:
            if found.state in self.resumable:
                self._use.require_free(found.rig)
            return super().resume(job)

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
        job = self.store.get(experiment)
        with self._lock:
            process, screen = self._process_of(experiment), self._screens.get(experiment)
            if process is None or screen is None:
                raise JobStateError(
                    f"experiment {experiment} is {job.state}: one that shows trials can pause"
                )
            process.tell(Pause(pause=wanted))
            self._show(experiment, screen.model_copy(update={"pausing": wanted}))
        return self.get(experiment)

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
        job = self.store.get(experiment)
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
        return self.get(experiment)

    def with_screen(self, job: ExperimentJob) -> ExperimentJob:
        """Return a job with what its pages show now.

        Parameters
        ----------
        job : ExperimentJob
            As it is kept.
        """
        screen = self._screens.get(job.id) if job.state == "running" else None
        return job.model_copy(update={"screen": screen})

    def require_free(self, rig: str) -> None:
        """Raise if an experiment is under way on a rig.

        Raises
        ------
        RigInExperimentError
        """
        # The process of one whose folder was deleted drives the rig until it has seen that.
        driving = (job for job in self._with_process() if job.rig == rig)
        if (other := next(driving, None) or self.store.active_on(rig)) is not None:
            raise RigInExperimentError(
                f"experiment {other.id} ({other.protocol}, {other.participant}) is under way "
                f"on rig {rig!r}: wait for its end, or stop it"
            )

    def _work(self, job: ExperimentJob) -> ExperimentWork:
        self._screens.pop(job.id, None)  # of an earlier run
        return ExperimentWork(
            run=self._run,
            folder=self.store.folder(job.id),
            account=RigAccount.of(self._config, job.created_by, self.kind, job.id),
            site=self._config.site,
            job=job,
            protocol=self.store.protocol(job.id),
        )

    def _hear(self, job: str, progress: str) -> None:
        with self._lock:
            self._show(job, ParticipantScreen.model_validate_json(progress))

    def _outcome(self, result: str) -> dict[str, Any]:
        return {}

    def _show(self, experiment: str, screen: ParticipantScreen) -> None:
        self._screens[experiment] = screen
        self._shown += 1
