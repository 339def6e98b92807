"""What a discovery is asked to do as a job, how it tells its progress, and what came of it."""

from typing import Annotated, Final, Literal

from pydantic import BaseModel, ConfigDict, Field

from frictus.model import Model
from frictus_service.discovery.document import Response, Verdict

State = Literal["queued", "running", "interrupted", "cancelled", "failed", "done"]
ACTIVE: tuple[State, ...] = ("queued", "running")
STUDY_NAME: Final = r"^\w[\w.-]*(/\w[\w.-]*)*$"


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class DiscoverySpec(_Strict):
    """One discovery."""

    study: Annotated[
        str,
        Field(
            max_length=200,
            pattern=STUDY_NAME,
            description="File below the folder of studies, such as visit1.h5",
        ),
    ]
    response: Response = "friction"
    base: Annotated[
        Literal["paper", "constant-cutoff"] | Model,
        Field(description="What is criticised; a `model/1` document may stand here"),
    ] = "paper"
    seed: Annotated[int | None, Field(ge=0, description="Of random draws; null: fresh")] = None


class DiscoveryProgress(_Strict):
    """What a discovery is at."""

    message: str


class DiscoveryResult(_Strict):
    """What came of it; the report has all."""

    verdict: Verdict | None
    sentence: str
    """The verdict in words."""
    causes: tuple[str, ...]
    """Named."""


class DiscoveryJob(_Strict):
    """A discovery and where it stands."""

    id: str
    state: State
    created_utc_ns: int
    created_by: str
    updated_utc_ns: int
    spec: DiscoverySpec
    progress: DiscoveryProgress | None = None
    result: DiscoveryResult | None = None
    failure: str | None = None


class DiscoveryJobs(_Strict):
    """All discoveries of this machine, newest first."""

    discoveries: list[DiscoveryJob]


class DiscoveryEvent(_Strict):
    """One thing that a discovery told; numbered from 1 without gaps."""

    number: int
    kind: Literal["state", "progress"]
    data: str
    """JSON: the state, or the progress."""
