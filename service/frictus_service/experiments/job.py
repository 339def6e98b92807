"""Experiments as jobs: what is asked, where one stands, what pages answer.

``studies/experiments/ID/`` holds `job.json`, where the experiment stands; `protocol.json`, the
whole of its protocol; and `trials.jsonl`, the log, from which it goes on.
"""

import secrets
from functools import cache
from pathlib import Path
from typing import Annotated, Final, Literal, Self

from pydantic import Field, FiniteFloat, ValidationError, model_validator

from frictus.errors import ArgumentError
from frictus.experiment import Protocol, load_protocol, parse_protocol, ready_protocols
from frictus.experiment.procedures.plans import ConstantPlan, StaircasePlan
from frictus.experiment.tasks import Task
from frictus.lenient import Exact
from frictus.names import Matching, Name
from frictus_service.errors import JobStateError, UnknownExperimentError
from frictus_service.job_folder import ACTIVE, FolderJob, JobFolder

FOLDER: Final = "experiments"
PROTOCOL: Final = "protocol.json"
LOG: Final = "trials.jsonl"
GO_ON: Final = "go"
"""The answer that begins, and ends a break."""
_VEILED: Final = "null: told to who may calibrate, not to participants"
Phase = Literal["ready", "interval", "question", "wait", "feedback", "break", "pause"]


class ExperimentSpec(Exact):
    """One experiment: a ready protocol by name, or the TOML of one."""

    rig: Name
    participant: Annotated[
        str,
        Matching(r"^[A-Za-z0-9]{1,64}$", "1 to 64 ASCII letters and digits are accepted"),
    ]
    protocol: Annotated[
        str | None, Field(max_length=60, description="Name of a ready protocol")
    ] = None
    toml: Annotated[
        str | None, Field(max_length=200_000, description="A protocol as a TOML document")
    ] = None
    order_row: Annotated[int, Field(ge=0, le=1_000_000)] = 0
    """Row of the Latin square of blocks: the number of the participant."""
    seed: Annotated[int | None, Field(ge=0, lt=2**53, description="null: fresh")] = None

    @model_validator(mode="after")
    def _one_protocol(self) -> Self:
        if (self.protocol is None) == (self.toml is None):
            raise ValueError("give either `protocol`, a ready one's name, or `toml`")
        return self

    def document(self) -> Protocol:
        """Return the protocol that is asked for.

        Raises
        ------
        ArgumentError
            If there is no such ready protocol, or the TOML is none.
        """
        if self.toml is not None:
            return parse_protocol(self.toml.encode(), "the protocol")
        ready = ready_protocols()
        if self.protocol not in ready:
            raise ArgumentError(
                f"there is no ready protocol {self.protocol!r}; there are {', '.join(ready)}"
            )
        return load_protocol(ready[self.protocol])


class ParticipantScreen(Exact):
    """What the participant's page shows, and what the experimenter's says of the trial."""

    phase: Phase
    trial: int
    step: Annotated[int, Field(description="Question within the trial; 0: before it")] = 0
    interval: Annotated[int, Field(description="From 1 while one is felt; else 0")] = 0
    intervals: int = 1
    practice: bool = False
    condition: Annotated[str | None, Field(description=_VEILED)] = None
    level: Annotated[FiniteFloat | None, Field(description=_VEILED)] = None
    unit: str = ""
    touched: Annotated[bool, Field(description="False: a finger was missed")] = True
    right: bool | None = None
    answered: Annotated[int, Field(description="Trials that count")] = 0
    refused: Annotated[
        int,
        Field(description="Trials that the rig could not render whole; 0 to participants"),
    ] = 0
    pausing: Annotated[bool, Field(description="A pause follows this trial")] = False


class ExperimentJob(FolderJob):
    """An experiment and where it stands."""

    rig: str
    participant: str
    order_row: int
    seed: Annotated[int | None, Field(description=_VEILED)]
    protocol: str
    """Its name."""
    description: str
    task: Task
    planned: Annotated[int | None, Field(description="Trials that count; null: it depends")]
    screen: Annotated[ParticipantScreen | None, Field(description="null: it does not run")] = (
        None
    )

    def veiled(self) -> Self:
        """Return it as participants may see it: without what tells them what is played."""
        veil = {"condition": None, "level": None, "unit": "", "refused": 0}
        screen = self.screen and self.screen.model_copy(update=veil)
        return self.model_copy(update={"seed": None, "screen": screen})


class ReadyProtocol(Exact):
    """A protocol that comes with the service."""

    name: str
    description: str
    task: Task
    planned: int | None


class ExperimentList(Exact):
    """All experiments of this machine, newest first, and the protocols that are ready."""

    experiments: list[ExperimentJob]
    more: bool
    """Whether there are older ones, which are not listed."""
    ready: list[ReadyProtocol]


class Answer(Exact):
    """What the participant answers to the question that is on the screen."""

    trial: Annotated[int, Field(ge=1)]
    step: Annotated[int, Field(ge=0)]
    answer: Annotated[str, Field(min_length=1, max_length=50)]


class Pause(Exact):
    """The experimenter wants a pause before the next trial, or has it go on."""

    pause: bool


Input = Answer | Pause


def planned_trials(protocol: Protocol) -> int | None:
    """Return how many trials count; None where that depends on the answers.

    Parameters
    ----------
    protocol : Protocol
        The experiment.
    """
    total = 0
    for name in protocol.conditions:
        plan = protocol.plan_of(name)
        if isinstance(plan, StaircasePlan):
            return None
        if isinstance(plan, ConstantPlan):
            total += len(plan.levels) * plan.repeats
        else:
            total += plan.trials
    return total


@cache
def ready_list() -> list[ReadyProtocol]:
    """Return the protocols that come with the service."""
    loaded = {name: load_protocol(path) for name, path in ready_protocols().items()}
    return [
        ReadyProtocol(
            name=name,
            description=protocol.description,
            task=protocol.task,
            planned=planned_trials(protocol),
        )
        for name, protocol in loaded.items()
    ]


class ExperimentStore(JobFolder[ExperimentJob]):
    """Keeps experiments; one process per folder writes it, from any of its threads.

    Parameters
    ----------
    studies : Path
        The folder of studies.
    """

    def __init__(self, studies: Path) -> None:
        super().__init__(studies / FOLDER, ExperimentJob, "experiment", UnknownExperimentError)

    def create(self, spec: ExperimentSpec, by: str) -> ExperimentJob:
        """Queue an experiment.

        Raises
        ------
        ArgumentError
        """
        protocol = spec.document()
        asked = spec.model_dump(include={"rig", "participant", "order_row"})
        described = {
            "seed": secrets.randbits(31) if spec.seed is None else spec.seed,
            "protocol": protocol.name,
            "description": protocol.description,
            "task": protocol.task,
            "planned": planned_trials(protocol),
        }
        document = protocol.model_dump_json(indent=2).encode()
        return self.add(by, asked | described, {PROTOCOL: document})

    def active_on(self, rig: str) -> ExperimentJob | None:
        """Return the experiment that is queued or runs on a rig; None where there is none."""
        return next((job for job in self.all() if job.rig == rig and job.state in ACTIVE), None)

    def protocol(self, experiment: str) -> Protocol:
        """Return the protocol of an experiment.

        Raises
        ------
        JobStateError
            If its file cannot be read.
        """
        path = self.folder(experiment) / PROTOCOL
        try:
            return Protocol.model_validate_json(path.read_bytes())
        except (OSError, ValidationError) as error:
            reason = (
                error.strerror if isinstance(error, OSError) else "it is torn or no protocol"
            )
            raise JobStateError(
                f"{path} cannot be read: {reason}; put a copy of it back"
            ) from error
