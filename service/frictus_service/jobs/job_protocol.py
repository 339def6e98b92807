"""What the API process and the process of a job say to one another: JSON lines."""

from pathlib import Path
from typing import Annotated, Final, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter

from frictus.tls import Tls
from frictus_service.calibration.job import CalibrationResult, CalibrationSpec, Progress
from frictus_service.discovery.jobs.documents import (
    DiscoveryProgress,
    DiscoveryResult,
    DiscoverySpec,
)


class _Word(BaseModel):
    model_config = ConfigDict(frozen=True)


class Order(_Word):
    """The one line that the process of a calibration is given."""

    kind: Literal["calibration"] = "calibration"
    run: str
    """``module:function``, called as `frictus_service.calibration.run.run_calibration` is."""
    client: str
    """Its name to the rigs."""
    router: str
    tls: Tls | None = None
    spec: CalibrationSpec
    folder: Path
    """Of this calibration alone."""


class DiscoveryOrder(_Word):
    """The one line that the process of a discovery is given."""

    kind: Literal["discovery"] = "discovery"
    run: str
    """``module:function``, called as `frictus_service.discovery.jobs.worker.carry_out` is."""
    spec: DiscoverySpec
    study: Path
    folder: Path
    """Of this discovery alone."""


AnyOrder = Annotated[Order | DiscoveryOrder, Field(discriminator="kind")]
"""When the input of a process ends behind it, it shall stop."""
ORDER: Final[TypeAdapter[AnyOrder]] = TypeAdapter(AnyOrder)


class Moved(_Word):
    """A calibration goes on."""

    kind: Literal["moved"] = "moved"
    progress: Progress


class Done(_Word):
    """A calibration has ended well."""

    kind: Literal["done"] = "done"
    result: CalibrationResult


class Looked(_Word):
    """A discovery goes on."""

    kind: Literal["looked"] = "looked"
    progress: DiscoveryProgress


class Found(_Word):
    """A discovery has ended well."""

    kind: Literal["found"] = "found"
    result: DiscoveryResult


class Failed(_Word):
    """It cannot go on."""

    kind: Literal["failed"] = "failed"
    reason: str


class Stopped(_Word):
    """It has ended because it was told to."""

    kind: Literal["stopped"] = "stopped"


Said = Annotated[Moved | Done | Looked | Found | Failed | Stopped, Field(discriminator="kind")]
SAID: Final[TypeAdapter[Said]] = TypeAdapter(Said)
