"""`design/1`: which trials a study shall have. JSON, written by a person."""

from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, ValidationError, model_validator

from frictus_service.discovery.errors import DesignError

Tone = Annotated[FiniteFloat, Field(ge=1.0, le=3000.0)]
Speed = Annotated[FiniteFloat, Field(ge=1.0, le=200.0)]
Force = Annotated[FiniteFloat, Field(ge=0.02, le=5.0)]
Drive = Annotated[FiniteFloat, Field(gt=0.0, le=150.0)]
Order = Literal["random", "speed blocks"]
Levels = Annotated[int, Field(ge=1, le=100)]

MOST_TRIALS = 1000


class FactorialDesign(BaseModel):
    """Every participant does every combination of tones, speed, force and drive."""

    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True)

    schema_: Annotated[Literal["design/1"], Field(alias="schema")] = "design/1"
    participants: Annotated[int, Field(ge=1, le=1000)]
    tones_hz: Annotated[tuple[Tone, ...], Field(min_length=1, max_length=100)]
    tones_per_trial: Levels = 1
    """Played at once; each tone is played equally often."""
    speeds_mm_s: Annotated[tuple[Speed, ...], Field(min_length=1, max_length=100)]
    forces_n: Annotated[tuple[Force, ...], Field(min_length=1, max_length=100)]
    drive_vpp: Annotated[tuple[Drive, ...], Field(min_length=1, max_length=10)] = (150.0,)
    repeats: Levels = 1
    blanks: Annotated[int, Field(ge=0, le=100)] = 0
    """Trials without drive at every speed and force."""
    seconds: Annotated[FiniteFloat, Field(ge=0.5, le=600.0)] = 10.0
    """Of a trial."""
    span_mm: Annotated[FiniteFloat, Field(ge=5.0, le=500.0)] = 60.0
    """Of a stroke."""
    order: Order = "random"
    trial_every_s: Annotated[FiniteFloat, Field(gt=0.0, le=3600.0)] = 20.0

    @model_validator(mode="after")
    def _possible(self) -> Self:
        for name in ("tones_hz", "speeds_mm_s", "forces_n", "drive_vpp"):
            levels = getattr(self, name)
            if len(set(levels)) < len(levels):
                raise ValueError(f"{name}: every level once; for more trials give repeats")
        if self.tones_per_trial > len(self.tones_hz):
            raise ValueError(
                f"tones_per_trial is {self.tones_per_trial}, and there are "
                f"{len(self.tones_hz)} tones; accepted: so many at most"
            )
        if self.trial_every_s < self.seconds:
            raise ValueError(
                f"trial_every_s is {self.trial_every_s:g}, and a trial takes "
                f"{self.seconds:g} s; accepted: that at least"
            )
        if self.trials > MOST_TRIALS:
            raise ValueError(
                f"{self.trials} trials for each participant; accepted: up to {MOST_TRIALS}"
            )
        return self

    @property
    def trials(self) -> int:
        """Of each participant."""
        conditions = len(self.speeds_mm_s) * len(self.forces_n)
        driven = len(self.tones_hz) * len(self.drive_vpp) * self.repeats
        return conditions * (driven + self.blanks)


def read_design(path: Path) -> FactorialDesign:
    """Return the design in a file.

    Parameters
    ----------
    path : Path

    Raises
    ------
    DesignError
        If there is no such file, or it is no `design/1`.
    """
    try:
        return FactorialDesign.model_validate_json(path.read_bytes())
    except FileNotFoundError as error:
        raise DesignError(
            f"no design {str(path)!r}; accepted: a study file, or a design/1 file (.json)"
        ) from error
    except (OSError, ValidationError) as error:
        raise DesignError(f"{path} is no design/1 document: {error}") from error
