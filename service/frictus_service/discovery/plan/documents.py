"""`design/1`: which trials a study shall have; `plan/1`: what they show. Both are JSON."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, ValidationError, model_validator

from frictus.errors import explain
from frictus_hardware.physics.effects import EFFECTS
from frictus_hardware.physics.linear import TransferFunction
from frictus_hardware.physics.simulator import Simulator
from frictus_service import json_text
from frictus_service.discovery.document import Response
from frictus_service.discovery.problem.base_models import ResponseName
from frictus_service.discovery.problem.candidates import Candidate
from frictus_service.errors import DesignError

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
        return FactorialDesign.model_validate_json(json_text.read_file(path), strict=True)
    except FileNotFoundError as error:
        raise DesignError(
            f"no design {str(path)!r}; accepted: a study file, or a design/1 file (.json)"
        ) from error
    except ValidationError as error:
        raise DesignError(f"{path} is no design/1 document: {explain(error)}") from error
    except OSError as error:
        raise DesignError(f"{path} is no design/1 document: {error}") from error


@dataclass(frozen=True, slots=True)
class Setup:
    """Base model, rig and catalogue.

    Attributes
    ----------
    base : Simulator
        The base model.
    nominal_mount : TransferFunction or None
        The study's; None: none.
    response : {'friction', 'mobility'}
    candidates : tuple of Candidate
        Parameters of effects that are tried.
    carrier_hz, sample_rate_hz : float
        Of the rig.
    """

    base: Simulator
    nominal_mount: TransferFunction | None
    response: ResponseName
    candidates: tuple[Candidate, ...]
    carrier_hz: float = 7000.0
    sample_rate_hz: float = 20_000.0


WANTED: Final[Mapping[str, float]] = {
    "amplitude_compression": 0.0048,
    "channel_delay": 4e-6,
    "charge_leakage": 1.0,
    "cutoff_drift": 0.02,
    "direction_asymmetry": 0.06,
    "force_dependent_cutoff": 0.18,
    "force_dependent_gain": 0.18,
    "fractional_damping": 0.1,
    "fractional_rolloff": 0.12,
    "gain_drift": 0.02,
    "mains_interference": 0.004,
    "mount_resonance_shift": 0.0048,
    "position_dependent_gain": 0.005,
    "residual_quadratic": 0.0048,
    "second_mode": 0.1,
    "speed_dependent_cutoff": 4.8,
    "speed_dependent_gain": 0.25,
    "speed_dependent_mass": 0.3,
    "speed_dependent_stiffness": 0.4,
    "stick_slip": 0.06,
}
"""Of the first parameter. A tenth to a fifth of the response at the ends of the usual ranges
(speeds 20 to 100 mm/s, forces 0.2 to 0.6 N, 20 minutes), or what shifts a phase by some
degrees; mass and stiffness as the paper found them to rise with the speed (Section 3.2)."""


def wanted_sizes(asked: Mapping[str, float]) -> dict[str, float]:
    """Return the sizes to be shown: the usual ones, but for those that are asked for.

    Parameters
    ----------
    asked : mapping of str to float
        By id of the effect.

    Raises
    ------
    DesignError
        If there is no such effect, or a size is not above zero and within its bounds.
    """
    for id_, size in asked.items():
        if id_ not in EFFECTS:
            raise DesignError(f"no effect {id_!r} is known; known are: {', '.join(EFFECTS)}")
        dose = EFFECTS[id_].parameters[0]
        if not 0.0 < size <= dose.high:
            raise DesignError(
                f"{id_}: a {dose.name} of {size:g} is wanted; accepted: above 0, up to "
                f"{dose.high:g} {dose.unit}"
            )
    return {**WANTED, **asked}


Shown = Literal["yes", "larger only", "no"]
"""Of the size that is wanted: yes, only a larger one, or no size at all."""


class _Document(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", populate_by_name=True)


class Addition(_Document):
    """The cheapest further trials that help, and what they reach."""

    additions: tuple[str, ...]
    """In words; to be made together."""
    finger_s: Annotated[FiniteFloat, Field(ge=0.0)]
    """Seconds on the finger, of all participants together."""
    reaches: FiniteFloat
    """Smallest size found, or largest cosine."""


class PlannedEffect(_Document):
    """One effect of the catalogue in this design."""

    id: str
    parameter: str
    unit: str
    held: dict[str, FiniteFloat] = {}
    """Its other parameters."""
    shown: Shown
    wanted: FiniteFloat
    detectable: FiniteFloat | None
    """Smallest size that is found in four of five studies."""
    standard_error: FiniteFloat | None
    """Of the mean over units; null of a size that shows as its square."""
    needs: str | None = None
    """What a design needs to show it at all."""
    cheapest: Addition | None = None
    """Null where it is shown as small as wanted, or no addition achieves it."""


class PlannedPair(_Document):
    """Two effects that look alike in this design."""

    between: tuple[str, str]
    cosine: Annotated[FiniteFloat, Field(ge=-1.0, le=1.0)]
    separable: Literal["no", "weakly"]
    separating_experiment: str
    cheapest: Addition | None = None
    """Null where they are separable, or no addition of trials separates them."""


class Plan(_Document):
    """A `plan/1` document."""

    schema_: Annotated[Literal["plan/1"], Field(alias="schema")] = "plan/1"
    code_version: str
    seed: Annotated[int, Field(ge=0)]
    source: str
    """The study or the design."""
    response: Response
    participants: int
    trials: int
    """Of each participant, on average."""
    finger_s: FiniteFloat
    """Of all participants together."""
    units: int
    compared: Literal["participants", "blocks"]
    critical_t: FiniteFloat | None
    """|t| that the largest of all effects exceeds by chance in one study of twenty; null where
    nothing can be tested."""
    effects: tuple[PlannedEffect, ...]
    pairs: tuple[PlannedPair, ...]
    """Most alike first."""
    notes: tuple[str, ...]
    """What a reader must know first."""
    assumptions: str

    def to_json(self) -> bytes:
        """Return the document as JSON bytes, indented for reading."""
        return self.model_dump_json(by_alias=True, indent=2).encode()
