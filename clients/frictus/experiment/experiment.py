"""An experiment on a rig: trial by trial, each in the log before the next one begins."""

import contextlib
import secrets
import time
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self

from pydantic import ValidationError

from frictus.errors import ArgumentError, explain
from frictus.experiment.participant import Participant
from frictus.experiment.presentation import PresentedInterval, Presenter, ScaledError
from frictus.experiment.procedures.plans import Plan
from frictus.experiment.procedures.schedule import Schedule, ScheduledTrial, resumed
from frictus.experiment.protocol import Design, Presentation, Protocol
from frictus.experiment.stimuli import Stimulus
from frictus.experiment.tasks import Adjustment, Task, checked, is_positive
from frictus.experiment.trial_log import FORMAT, TrialLog
from frictus.experiment.trial_row import flags_of, start_row, status_of, trial_row
from frictus.rig import Rig

LEASE_MS: Final = 2_000


class Experiment:
    """An experiment on one rig; a context manager that arms the rig and opens the log.

    Where the log holds trials already, of the same protocol, the experiment goes on after them
    with the trial that would have come.

    Parameters
    ----------
    rig : Rig
        The rig.
    task : Task
        What the participant is asked, such as `TwoAlternatives()`.
    procedure : Plan
        How levels are chosen, such as `QuestPlusPlan(levels=...)`.
    stimulus : Stimulus or mapping of str to Stimulus
        What a level means; several are conditions by name.
    log : str or Path
        File of the trials (JSON lines), made or gone on with.
    name : str
        Of the experiment: letters, digits, ``-``.
    presentation : Presentation
        Durations, fades, mask.
    design : Design
        Order of conditions, practice, catch trials, breaks.
    record : bool
        Whether the rig's recorder records meanwhile.
    participant : str
        Pseudonym: 1 to 64 ASCII letters and digits.
    order_row : int
        Row of the Latin square of blocks, from 0: number the participants.
    seed : int or None
        Of everything drawn; None draws one. A log that is gone on with has its own.

    Raises
    ------
    ArgumentError
        If the parts do not fit together.
    """

    def __init__(
        self,
        rig: Rig,
        task: Task,
        procedure: Plan,
        stimulus: Stimulus | Mapping[str, Stimulus],
        *,
        log: str | Path,
        name: str = "experiment",
        presentation: Presentation | None = None,
        design: Design | None = None,
        record: bool = False,
        participant: str = "01",
        order_row: int = 0,
        seed: int | None = None,
    ) -> None:
        conditions = stimulus if isinstance(stimulus, Mapping) else {"stimulus": stimulus}
        try:
            self.protocol = Protocol(
                name=name,
                task=task,
                procedure=procedure,
                conditions=dict(conditions),
                presentation=presentation or Presentation(),
                design=design or Design(),
                record=record,
            )
        except ValidationError as error:
            raise ArgumentError(f"experiment: {explain(error)}") from error
        if not (participant.isascii() and participant.isalnum() and len(participant) <= 64):
            raise ArgumentError(f"participant {participant!r}: 1 to 64 of A-Z, a-z and 0-9")
        if order_row < 0 or (seed is not None and not 0 <= seed < 2**63):
            raise ArgumentError("seed and order_row are 0 or above")
        self._rig, self._path = rig, Path(log)
        self._participant, self._order_row = participant, order_row
        self._seed = secrets.randbits(31) if seed is None else seed
        self._open = contextlib.ExitStack()
        self._log: TrialLog | None = None
        self._presenter: Presenter | None = None
        self._recording: str | None = None
        self.schedule = Schedule(self.protocol, self._seed, order_row)

    @classmethod
    def of(cls, rig: Rig, protocol: Protocol, **options: Any) -> Self:
        """Return the experiment of a protocol document.

        Parameters
        ----------
        rig : Rig
            The rig.
        protocol : Protocol
            As `load_protocol` returns it.
        **options : Any
            `log`, `participant`, `order_row` and `seed` of the constructor.
        """
        made = cls(
            rig,
            protocol.task,
            protocol.procedure,
            protocol.conditions,
            name=protocol.name,
            presentation=protocol.presentation,
            design=protocol.design,
            record=protocol.record,
            **options,
        )
        made.protocol = protocol  # its description too
        return made

    @property
    def seed(self) -> int:
        """Of everything drawn; of the log, once that is open."""
        return self._seed

    @property
    def rows(self) -> list[dict[str, Any]]:
        """What the log holds: a header, starts, trials."""
        return [] if self._log is None else list(self._log.rows)

    def __enter__(self) -> Self:
        """Open the log, take in its trials, arm the rig and start the recording."""
        with contextlib.ExitStack() as undo:
            self._log = undo.enter_context(TrialLog(self._path))
            self._go_on(self._log)
            lease = undo.enter_context(self._rig.arm(LEASE_MS, keep_model=True))
            presenter = Presenter(self._rig, lease, self.protocol.presentation)
            self._presenter = undo.enter_context(contextlib.closing(presenter))
            if self.protocol.record:
                self._recording = self._begin_recording(undo)
            begun = start_row(self._rig, self.schedule.recorded, time.time_ns())
            self._log.append(begun | {"recording": self._recording})
            self._open = undo.pop_all()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """End the recording, disarm, close the log."""
        self._presenter = None
        self._open.__exit__(kind, error, traceback)

    def _begin_recording(self, undo: contextlib.ExitStack) -> str:
        begin = f"{self.protocol.name}-{self._participant}-"
        left = self._rig.recording()
        if left.recording and (left.name or "").startswith(begin):  # of a start that was killed
            self._rig.end_recording()
        name = begin + time.strftime("%Y%m%dT%H%M%SZ", time.gmtime())
        self._rig.record(name, self._participant, f"log {self._path.name}")
        undo.callback(self._rig.end_recording)
        return name

    def _go_on(self, log: TrialLog) -> None:
        """Write the header of a new log, or take in the trials of an old one."""
        if not log.rows:
            header: dict[str, Any] = {
                "format": FORMAT,
                "utc_ns": time.time_ns(),
                "participant": self._participant,
                "seed": self._seed,
                "order_row": self._order_row,
                "protocol": self.protocol.model_dump(mode="json"),
            }
            log.append(header)
            return
        if (held := log.rows[0].get("participant")) != self._participant:
            raise ArgumentError(
                f"{self._path} is of participant {held!r}, not {self._participant!r}: one each"
            )
        self.schedule = resumed(self.protocol, log.rows, str(self._path))
        self._seed = self.schedule.seed

    def require_ready(self) -> None:
        """Raise `LeaseLostError` or `NotLoggedError` if rig or log take no (further) trial."""
        self._opened()[0].require_lease()
        self._opened()[1].require_in_place()

    def next(self) -> ScheduledTrial | None:
        """Return the next trial, the same until it is answered; None after the last."""
        return self.schedule.next()

    def present(
        self, trial: ScheduledTrial, *, participant: Participant | None = None
    ) -> list[PresentedInterval] | None:
        """Present the intervals of a trial.

        Parameters
        ----------
        trial : ScheduledTrial
            What `next` returned.
        participant : Participant or None
            Who learns when an interval begins.

        Returns
        -------
        list of PresentedInterval or None
            None where the rig cannot render it whole and such trials are refused: that is
            logged, and `next` returns another.

        Raises
        ------
        LeaseLostError
            If the rig no longer obeys.
        RuntimeError
            Outside of the context.
        """
        try:
            return self.present_at(trial, trial.level, participant=participant)
        except ScaledError as error:
            refused = {"status": "refused", "flags": ["scaled"], "gain": error.gain}
            self._opened()[1].append(self._row(trial, trial.level, []) | refused)
            self.schedule.refuse(trial)
            return None

    def present_at(
        self, trial: ScheduledTrial, level: float, *, participant: Participant | None = None
    ) -> list[PresentedInterval]:
        """Present the intervals of a trial at a level that the participant sets.

        Parameters
        ----------
        trial : ScheduledTrial
            What `next` returned.
        level : float
            In the unit of the stimulus, above 0.
        participant : Participant or None
            Who learns when an interval begins.

        Raises
        ------
        ScaledError
            If the rig cannot render it whole, and such trials are refused.
        LeaseLostError
            If the rig no longer obeys.
        RuntimeError
            Outside of the context.
        """
        presenter, _ = self._opened()
        stimulus = self.protocol.conditions[trial.condition]
        shown: list[PresentedInterval] = []
        for number, shows in enumerate(trial.order, 1):
            presenter.gap()
            if participant is not None:
                participant.begin(trial, number)
            scene = (stimulus.test if shows == "test" else stimulus.reference)(level)
            shown.append(presenter.interval(shows, scene))
        presenter.smooth()
        return shown

    def answer(
        self,
        trial: ScheduledTrial,
        intervals: list[PresentedInterval],
        response: str,
        response_s: float,
        *,
        settings: list[float] | None = None,
    ) -> dict[str, Any]:
        """Log an answer; it is on the disk when this returns. What was not felt comes again.

        Parameters
        ----------
        trial : ScheduledTrial
            What `next` returned.
        intervals : list of PresentedInterval
            What `present` returned last.
        response : str
            The answer.
        response_s : float
            From the end of the last interval to the answer.
        settings : list of float or None
            Levels set one after the other; the last one is the answer.

        Returns
        -------
        dict
            The row of the log.

        Raises
        ------
        ArgumentError
            If the task has no such answer, or the trial was answered; nothing is logged then.
        """
        _, log = self._opened()
        task = self.protocol.task
        if trial.number != self.schedule.recorded + 1:
            raise ArgumentError(
                f"trial {trial.number} was answered or refused: ask `next` for another"
            )
        given = checked(task, response)
        row = self._row(trial, settings[-1] if settings else trial.level, intervals)
        positive = is_positive(task, trial.order, given)
        flags = flags_of(trial, intervals, row["level_rendered"], settings or [])
        row |= {
            "status": status_of(flags),
            "flags": flags,
            "settings": settings,
            "response": given,
            "correct": None if trial.correct is None else given == trial.correct,
            "positive": positive,
            "response_s": round(response_s, 4),
        }
        log.append(row)
        if row["status"] == "answered":
            self.schedule.record(trial, row["level_rendered"], positive)
        else:
            self.schedule.repeat(trial)
        return row

    def run(self, participant: Participant) -> None:
        """Present and ask until the last trial.

        Parameters
        ----------
        participant : Participant
            Whoever answers; an answer that the task does not have is asked for again.
        """
        while (trial := self.next()) is not None:
            self.run_trial(trial, participant)

    def run_trial(self, trial: ScheduledTrial, participant: Participant) -> None:
        """Present a trial and ask, the break before it included.

        Parameters
        ----------
        trial : ScheduledTrial
            What `next` returned.
        participant : Participant
            Whoever answers.
        """
        if trial.pause:
            participant.rest(trial)
        if (shown := self.present(trial, participant=participant)) is None:
            return
        response, response_s = self._ask(participant, trial, shown)
        settings: list[float] | None = None
        if isinstance(task := self.protocol.task, Adjustment):
            settings = [trial.level]
            while response != "=" and len(settings) < task.steps:
                wanted = task.moved(settings[-1], response)
                try:
                    shown = self.present_at(trial, wanted, participant=participant)
                except ScaledError:  # no further up than the rig can
                    wanted = settings[-1]
                    shown = self.present_at(trial, wanted, participant=participant)
                settings.append(wanted)
                response, response_s = self._ask(participant, trial, shown)
        row = self.answer(trial, shown, response, response_s, settings=settings)
        if row["status"] != "answered":  # it comes again, and must not be given away
            self.schedule.check_felt()
        elif trial.feedback and row["correct"] is not None:
            participant.learn(trial, row["correct"])

    def _ask(
        self, participant: Participant, trial: ScheduledTrial, shown: list[PresentedInterval]
    ) -> tuple[str, float]:
        ended_s = time.monotonic()
        while True:
            with contextlib.suppress(ArgumentError):
                answer = checked(self.protocol.task, participant.ask(trial, shown))
                return answer, time.monotonic() - ended_s

    def _opened(self) -> tuple[Presenter, TrialLog]:
        if self._presenter is None or self._log is None:
            raise RuntimeError("use an experiment in `with`: it arms the rig and opens the log")
        return self._presenter, self._log

    def _row(
        self, trial: ScheduledTrial, level: float, intervals: list[PresentedInterval]
    ) -> dict[str, Any]:
        stimulus = self.protocol.conditions[trial.condition]
        return trial_row(trial, level, stimulus, intervals, time.time_ns(), self._recording)
