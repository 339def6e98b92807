"""Carry out an experiment whose participant answers on a page."""

import queue
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import frictus
from frictus.experiment import Experiment, PresentedInterval, Protocol, ScheduledTrial
from frictus_service.errors import ExperimentCancelledError, UnattendedError
from frictus_service.experiments.job import (
    LOG,
    Answer,
    ExperimentJob,
    Input,
    ParticipantScreen,
    Phase,
)

LOOK_S: Final = 0.05
"""How often whoever waits for an answer looks whether the rig obeys."""
FEEDBACK_S: Final = 1.0
START_S: Final = 10.0
UNATTENDED_S: Final = 600.0
"""A rig is not kept armed for longer for somebody who does nothing."""


def run_experiment(
    job: ExperimentJob,
    protocol: Protocol,
    folder: Path,
    client: frictus.Client,
    site: str,
    inputs: "queue.SimpleQueue[Input]",
    tell: Callable[[ParticipantScreen], None],
    cancelled: Callable[[], bool],
) -> None:
    """Carry out an experiment to its last trial; what its log holds already is gone on with.

    Parameters
    ----------
    job : ExperimentJob
        What was asked for.
    protocol : Protocol
        The experiment.
    folder : Path
        Of this experiment alone.
    client : Client
        Connection to the rigs.
    site : str
        Of the rig.
    inputs : SimpleQueue
        What the pages answer.
    tell : callable
        Told what the participant's page shows.
    cancelled : callable
        Asked while an answer is waited for, and between intervals.

    Raises
    ------
    ExperimentCancelledError
    UnattendedError
    NotLoggedError
        Also while an answer is waited for that could not be kept.
    """
    made = Experiment.of(
        client.rig(job.rig, site, wait_s=START_S),
        protocol,
        log=folder / LOG,
        participant=job.participant,
        order_row=job.order_row,
        seed=job.seed,
    )
    with made as experiment:
        person = PageParticipant(experiment, inputs, tell, cancelled)
        while (trial := experiment.next()) is not None:
            person.prepare(trial)
            experiment.run_trial(trial, person)


class PageParticipant:
    """A participant who answers on a page.

    Parameters
    ----------
    experiment : Experiment
        Under way.
    inputs : SimpleQueue
        What the pages answer.
    tell : callable
        Told what the participant's page shows.
    cancelled : callable
        Whether the experiment is to end.
    now_s : callable
        Clock.
    """

    def __init__(
        self,
        experiment: Experiment,
        inputs: "queue.SimpleQueue[Input]",
        tell: Callable[[ParticipantScreen], None],
        cancelled: Callable[[], bool],
        now_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._now_s = now_s
        self._active_s = now_s()
        self._experiment, self._inputs = experiment, inputs
        self._tell, self._cancelled = tell, cancelled
        self._step = 0
        self._rested_before = 0
        self._pausing = False

    def prepare(self, trial: ScheduledTrial) -> None:
        """Wait until the participant is ready, before the first trial and after a pause.

        Parameters
        ----------
        trial : ScheduledTrial
            What comes next.
        """
        self._step = 0
        if self._rested_before == 0:
            self._rest(trial, "ready")
        self._take_pauses()
        if self._pausing:
            self._show(trial, "pause")
            while self._pausing:
                self._look()
                self._take_pauses(LOOK_S)
            self._rested_before = trial.number

    def rest(self, trial: ScheduledTrial) -> None:
        """Return once the participant wants to go on after a break.

        Parameters
        ----------
        trial : ScheduledTrial
            What comes next.
        """
        if self._rested_before != trial.number:
            self._rest(trial, "break")

    def begin(self, trial: ScheduledTrial, interval: int) -> None:
        """Show which interval begins.

        Parameters
        ----------
        trial : ScheduledTrial
            Under way.
        interval : int
            From 1.
        """
        self._look()
        self._show(trial, "interval", interval=interval)

    def ask(self, trial: ScheduledTrial, intervals: list[PresentedInterval]) -> str:
        """Show the question, and return the answer.

        Parameters
        ----------
        trial : ScheduledTrial
            Under way.
        intervals : list of PresentedInterval
            What was presented.
        """
        self._step += 1
        touched = all(each.felt for each in intervals)
        self._show(trial, "question", touched=touched)
        return self._answer(trial)

    def learn(self, trial: ScheduledTrial, right: bool) -> None:
        """Show whether the answer was right, for a moment.

        Parameters
        ----------
        trial : ScheduledTrial
            Answered.
        right : bool
            Whether it was.
        """
        self._show(trial, "feedback", right=right)
        end_s = self._now_s() + FEEDBACK_S
        while self._now_s() < end_s:
            self._look()
            time.sleep(LOOK_S)

    def _rest(self, trial: ScheduledTrial, phase: Phase) -> None:
        self._rested_before = trial.number
        self._show(trial, phase)
        self._answer(trial)

    def _show(self, trial: ScheduledTrial, phase: Phase, **more: Any) -> None:
        stimulus = self._experiment.protocol.conditions[trial.condition]
        rows = self._experiment.rows
        self._active_s = self._now_s()
        counted = [row for row in rows if row.get("phase") == "main" and not row["catch"]]
        self._tell(
            ParticipantScreen(
                phase=phase,
                trial=trial.number,
                step=self._step,
                intervals=len(trial.order),
                practice=trial.phase == "practice",
                condition=trial.condition,
                level=trial.level,
                unit=stimulus.unit,
                answered=sum(row["status"] == "answered" for row in counted),
                refused=sum(row.get("status") == "refused" for row in rows),
                pausing=self._pausing,
                **more,
            )
        )

    def _answer(self, trial: ScheduledTrial) -> str:
        """Return the answer to the question that is on the screen."""
        while True:
            self._look()
            given = self._next(LOOK_S)
            asked = (trial.number, self._step)
            if isinstance(given, Answer) and (given.trial, given.step) == asked:
                return given.answer

    def _take_pauses(self, timeout_s: float = 0.0) -> None:
        while self._next(timeout_s) is not None:
            pass

    def _next(self, timeout_s: float) -> Input | None:
        """Return what was answered next; a pause is noted for the next trial."""
        try:
            given = (
                self._inputs.get(timeout=timeout_s) if timeout_s else self._inputs.get(False)
            )
        except queue.Empty:
            return None
        self._active_s = self._now_s()
        if not isinstance(given, Answer):
            self._pausing = given.pause
        return given

    def _look(self) -> None:
        if self._cancelled():
            raise ExperimentCancelledError("cancelled; the answered trials are kept")
        if self._now_s() - self._active_s > UNATTENDED_S:
            raise UnattendedError(
                f"nobody answered or went on for {UNATTENDED_S / 60.0:g} minutes: the rig is "
                "given back. The answered trials are kept; resume to go on with this one"
            )
        self._experiment.require_ready()
