"""What the API process and the process of a calibration say to one another: JSON lines."""

from pathlib import Path
from typing import Annotated, Final, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter

from frictus_service.calibration.job import CalibrationResult, CalibrationSpec, Progress


class _Word(BaseModel):
    model_config = ConfigDict(frozen=True)


class Order(_Word):
    """The one line that a process is given; when its input ends, it shall stop."""

    run: str
    """``module:function``, called as `frictus_service.calibration.run.run_calibration` is."""
    router: str
    spec: CalibrationSpec
    folder: Path
    """Of this calibration alone."""


class Moved(_Word):
    """It goes on."""

    kind: Literal["moved"] = "moved"
    progress: Progress


class Done(_Word):
    """It has ended well."""

    kind: Literal["done"] = "done"
    result: CalibrationResult


class Failed(_Word):
    """It cannot go on."""

    kind: Literal["failed"] = "failed"
    reason: str


class Stopped(_Word):
    """It has ended because it was told to."""

    kind: Literal["stopped"] = "stopped"


Said = Annotated[Moved | Done | Failed | Stopped, Field(discriminator="kind")]
SAID: Final[TypeAdapter[Said]] = TypeAdapter(Said)
