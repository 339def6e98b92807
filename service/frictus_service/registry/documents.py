"""What the registry answers with; the REST API and the command line show it as it is."""

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from frictus.model import Model
from frictus_service.calibration.job import CalibrationResult, CalibrationSpec, Progress

CalibrationState = Literal["queued", "running", "interrupted", "cancelled", "failed", "done"]


class _Document(BaseModel):
    model_config = ConfigDict(frozen=True)


class VersionSummary(_Document):
    """A published version, without the model itself."""

    name: str
    version: int
    etag: Annotated[str, Field(description="Of the model; a rig names it when it is active")]
    response: Literal["friction", "mobility"]
    participant: Annotated[str | None, Field(description="Pseudonym; null: population")]
    rig: str | None
    published_utc_ns: int
    published_by: str
    comment: str
    calibration: Annotated[str | None, Field(description="The calibration that measured it")]

    @property
    def reference(self) -> str:
        """``NAME@VERSION``."""
        return f"{self.name}@{self.version}"


class Published(VersionSummary):
    """A published version; it never changes."""

    model: Model


class VersionPage(_Document):
    """Some of the versions, newest first."""

    models: list[VersionSummary]
    next: Annotated[int | None, Field(description="`after` of the next page; null on the last")]


class Alias(_Document):
    """A name that stands for one version until it is moved."""

    name: str
    alias: str
    version: int
    revision: Annotated[int, Field(description="1 when it was made; one more with each move")]
    moved_utc_ns: int

    @property
    def etag(self) -> str:
        """What a mover must have seen."""
        return f"{self.alias}-{self.revision}"


class AliasMove(_Document):
    """One move of an alias; never changed."""

    alias: str
    revision: int
    from_version: int | None
    to_version: int
    moved_utc_ns: int
    moved_by: str
    reason: str


class Activation(_Document):
    """A rig was given a published model; never changed."""

    site: str
    rig: str
    name: str
    version: int
    etag: Annotated[str, Field(description="Of the version that was published")]
    confirmed: Annotated[str, Field(description="Of the model that the rig says it applies")]
    activated_utc_ns: int
    activated_by: str


class Audit(_Document):
    """Who moved which alias of a model, and on which rigs it was activated; newest first."""

    name: str
    moves: list[AliasMove]
    activations: list[Activation]


class Calibration(_Document):
    """One calibration and where it stands."""

    id: str
    site: str
    rig: str
    participant: str
    state: CalibrationState
    created_utc_ns: int
    created_by: str
    updated_utc_ns: int
    spec: CalibrationSpec
    progress: Progress | None
    result: CalibrationResult | None
    failure: str | None
    published: Annotated[str | None, Field(description="NAME@VERSION of its model")]


class CalibrationPage(_Document):
    """Some of the calibrations, newest first."""

    calibrations: list[Calibration]
    next: Annotated[str | None, Field(description="`after` of the next page; null on the last")]


class CalibrationEvent(_Document):
    """One thing that a calibration told; numbered from 1 without gaps."""

    number: int
    utc_ns: int
    kind: Literal["state", "progress"]
    data: Annotated[str, Field(description="JSON: the state, or the progress")]
