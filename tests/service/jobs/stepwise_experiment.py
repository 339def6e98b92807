"""An experiment without a rig: it asks as one on a rig does, and keeps the same log.

Run in processes that the service starts; the participant's pseudonym says what goes wrong.
"""

import os
import queue
import time
from collections.abc import Callable
from pathlib import Path

import frictus
from frictus.errors import LeaseLostError
from frictus.experiment import Protocol, ScheduledTrial
from frictus.experiment.procedures.schedule import Schedule, resumed
from frictus.experiment.tasks import is_positive
from frictus.experiment.trial_log import FORMAT, TrialLog
from frictus_service.experiments.job import LOG, ExperimentJob, Input, ParticipantScreen
from frictus_service.experiments.run import PageParticipant

EFFECT = {"gain": 1.0}


class Unrendered:
    """What `PageParticipant` asks of an experiment."""

    def __init__(self, protocol: Protocol, log: TrialLog) -> None:
        self.protocol, self._log = protocol, log

    @property
    def rows(self) -> list[dict[str, object]]:
        return self._log.rows

    def require_ready(self) -> None:
        self._log.require_in_place()
        if (Path(self._log._file.name).parent / "stopped").exists():
            raise LeaseLostError("stopped by local.rest")


def run(
    job: ExperimentJob,
    protocol: Protocol,
    folder: Path,
    client: frictus.Client,
    site: str,
    inputs: "queue.SimpleQueue[Input]",
    tell: Callable[[ParticipantScreen], None],
    cancelled: Callable[[], bool],
) -> None:
    """Ask what is left of the trials."""
    (folder / "client").write_text(client.name, encoding="ascii")
    print("libraries print too")  # noqa: T201
    if job.participant == "broken":
        raise ZeroDivisionError("in the middle of it")
    with TrialLog(folder / LOG) as log:
        if not log.rows:
            document = protocol.model_dump(mode="json")
            head = {"format": FORMAT, "participant": job.participant, "protocol": document}
            log.append(head | {"seed": job.seed, "order_row": job.order_row})
        schedule = resumed(protocol, log.rows)
        experiment = Unrendered(protocol, log)
        person = PageParticipant(experiment, inputs, tell, cancelled)  # type: ignore[arg-type]
        while (trial := schedule.next()) is not None:
            person.prepare(trial)
            _ask(protocol, trial, person, log, schedule)
            if job.participant == "fatal" and trial.number == 2:
                os._exit(11)


def _ask(
    protocol: Protocol,
    trial: ScheduledTrial,
    person: PageParticipant,
    log: TrialLog,
    schedule: Schedule,
) -> None:
    for number in range(1, len(trial.order) + 1):
        person.begin(trial, number)
    response = person.ask(trial, [])
    positive = is_positive(protocol.task, trial.order, response)
    interval = {
        "utc_ns": time.time_ns(),
        "duration_s": 1.0,
        "first_sample": 0,
        "last_sample": 20_000,
        "run": 1,
        "finger": None,
        "applied": EFFECT,
    }
    row = {
        "trial": trial.number,
        "phase": trial.phase,
        "condition": trial.condition,
        "catch": trial.catch,
        "order": list(trial.order),
        "level": trial.level,
        "level_rendered": trial.level,
        "unit": "N",
        "recording": None,
        "intervals": [interval for _ in trial.order],
        "status": "answered",
        "flags": [],
        "settings": None,
        "response": response,
        "correct": None if trial.correct is None else response == trial.correct,
        "positive": positive,
        "response_s": 0.5,
    }
    log.append(row)
    schedule.record(trial, trial.level, positive)
