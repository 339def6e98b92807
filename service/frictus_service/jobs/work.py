"""What the process of each kind of job is given as its first line, and what it does with it."""

import queue
from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter

import frictus
from frictus.experiment import Protocol
from frictus.tls import Tls
from frictus_service.calibration.job import CalibrationResult, CalibrationSpec
from frictus_service.config import Config
from frictus_service.discovery.jobs import DiscoveryResult, DiscoverySpec
from frictus_service.experiments.job import ExperimentJob, Input


@dataclass(frozen=True, slots=True)
class ParentLink:
    """What the process of a job and whoever started it have to do with one another.

    Attributes
    ----------
    report : callable
        Takes what the job is at.
    inputs : queue of Answer or Pause
        What pages answer.
    cancelled : callable
        Whether it is to stop.
    """

    report: Callable[[BaseModel], None]
    inputs: "queue.SimpleQueue[Input]"
    cancelled: Callable[[], bool]


class Work(BaseModel):
    """What a job is. When the input of its process ends behind it, it shall stop."""

    model_config = ConfigDict(frozen=True)
    run: str
    """``module:function`` that does it."""
    folder: Path
    """Of this job alone."""

    @abstractmethod
    def carry_out(self, run: Callable[..., Any], parent: ParentLink) -> BaseModel | None:
        """Do it, and return what came of it.

        Parameters
        ----------
        run : callable
            As `run` names it.
        parent : ParentLink
            Whoever started the process.
        """


class RigAccount(BaseModel):
    """By what name, and how, a job reaches the rigs."""

    model_config = ConfigDict(frozen=True)
    client: str
    router: str
    tls: Tls | None = None

    @classmethod
    def of(cls, config: Config, created_by: str, kind: str, job: str) -> Self:
        """Return the account of a job.

        Parameters
        ----------
        config : Config
            Its router and certificates are used.
        created_by : str
            Who began the job: whoever finds the rig held reads it.
        kind, job : str
            Kind and id of the job.
        """
        client = f"{created_by}.{kind}-{job[-8:]}"
        return cls(client=client, router=config.router.endpoint, tls=config.tls("client"))

    def connect(self) -> frictus.Client:
        """Return a client of that name.

        Raises
        ------
        LinkError
        """
        return frictus.connect(self.router, self.client, tls=self.tls)


class CalibrationWork(Work):
    """As `frictus_service.calibration.run.run_calibration` is called."""

    kind: Literal["calibration"] = "calibration"
    account: RigAccount
    spec: CalibrationSpec

    def carry_out(self, run: Callable[..., Any], parent: ParentLink) -> CalibrationResult:
        """Calibrate."""
        with self.account.connect() as client:
            result: CalibrationResult = run(
                self.spec, self.folder, client, parent.report, parent.cancelled
            )
        return result


class DiscoveryWork(Work):
    """As `frictus_service.discovery.jobs.carry_out` is called."""

    kind: Literal["discovery"] = "discovery"
    spec: DiscoverySpec
    study: Path

    def carry_out(self, run: Callable[..., Any], parent: ParentLink) -> DiscoveryResult:
        """Discover."""
        result: DiscoveryResult = run(
            self.spec, self.study, self.folder, parent.report, parent.cancelled
        )
        return result


class ExperimentWork(Work):
    """As `frictus_service.experiments.run.run_experiment` is called."""

    kind: Literal["experiment"] = "experiment"
    account: RigAccount
    site: str
    job: ExperimentJob
    protocol: Protocol

    def carry_out(self, run: Callable[..., Any], parent: ParentLink) -> None:
        """Present the trials."""
        with self.account.connect() as client:
            given = (self.job, self.protocol, self.folder, client, self.site)
            run(*given, parent.inputs, parent.report, parent.cancelled)


AnyWork = Annotated[
    CalibrationWork | DiscoveryWork | ExperimentWork, Field(discriminator="kind")
]
WORK: Final[TypeAdapter[AnyWork]] = TypeAdapter(AnyWork)
INPUT: Final[TypeAdapter[Input]] = TypeAdapter(Input)
"""A line each, behind the work."""
