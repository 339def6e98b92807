"""Paths of recordings: start, end and follow one on a rig; which there are on this machine."""

from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from typing import Annotated, Final

from fastapi import APIRouter, Depends, Query, Response
from fastapi import Path as PathParameter
from fastapi.responses import FileResponse
from pydantic import BaseModel, ConfigDict, Field

from frictus.errors import RefusedError
from frictus.messages import RecordingState
from frictus_service.api import problems
from frictus_service.api.access import needs
from frictus_service.api.requests import body_of, json_body
from frictus_service.api.routes.rigs import RigName
from frictus_service.api.services import Given

_RIG: Final[tuple[type[problems.ApiError], ...]] = (
    problems.UnauthenticatedError,
    problems.MissingScopeError,
    problems.RigNotFoundError,
    problems.InvalidError,
    problems.UnreadableRigError,
    problems.NoLinkError,
)
_ASK: Final[tuple[type[problems.ApiError], ...]] = (
    *_RIG,
    problems.RecordingConflictError,
    problems.StaleError,
    problems.UnavailableError,
)
MOST_LISTED: Final = 500
_NAME: Final = r"^[A-Za-z0-9._-]+$"
RecordingName = Annotated[
    str, PathParameter(min_length=1, max_length=100, pattern=_NAME, description="As listed")
]
router = APIRouter(prefix="/v1", tags=["recordings"])


class RecordingAsked(BaseModel):
    """What to record."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: Annotated[str, Field(min_length=1, max_length=100, pattern=_NAME)]
    participant: Annotated[str, Field(max_length=64)] | None = None
    notes: Annotated[str, Field(max_length=10_000)] = ""


class RecordingFile(BaseModel):
    """One recording in the folder of this machine."""

    name: str
    bytes: int
    modified_utc: str = Field(description="ISO 8601")
    finished: bool = Field(description="false: being written, or torn")
    seconds: float | None = Field(description="Length; null where it is not finished")


class RecordingList(BaseModel):
    """The recordings in the folder of this machine, the newest first."""

    folder: str
    recordings: list[RecordingFile]
    left_out: int = Field(description="How many older ones there are besides")


@contextmanager
def _conflicts() -> Iterator[None]:
    """Answer with 409 where the recorder says `conflict`: no ETag is involved."""
    try:
        yield
    except RefusedError as error:
        if error.code != "conflict":
            raise
        raise problems.RecordingConflictError(str(error)) from error


@router.get(
    "/recordings",
    dependencies=[Depends(needs("read"))],
    responses=problems.documented(*_RIG[:2], problems.InvalidError),
)
def list_recordings(
    given: Given, most: Annotated[int, Query(ge=1, le=MOST_LISTED)] = MOST_LISTED
) -> RecordingList:
    """List the recordings in this machine's folder; a recorder elsewhere has its own."""
    from frictus_service.recording.summary import length_s, shelved

    folder = given.config.recordings
    found = shelved(folder)
    return RecordingList(
        folder=str(folder.resolve()),
        recordings=[
            RecordingFile(
                name=one.path.stem,
                bytes=one.size,
                modified_utc=datetime.fromtimestamp(one.modified_s, UTC).isoformat(),
                finished=one.finished,
                seconds=length_s(one),
            )
            for one in found[:most]
        ],
        left_out=max(0, len(found) - most),
    )


@router.get(
    "/recordings/{name}/recording.mcap",
    dependencies=[Depends(needs("read"))],
    response_class=FileResponse,
    responses=problems.documented(
        *_RIG[:2],
        problems.RecordingNotFoundError,
        problems.InvalidError,
        problems.RecordingConflictError,
    ),
)
def get_recording_file(name: RecordingName, given: Given) -> FileResponse:
    """Return a finished recording of this machine's folder as a file."""
    from frictus_service.recording.recording import SUFFIX
    from frictus_service.recording.summary import is_finished

    folder = given.config.recordings.resolve()
    path = folder / f"{name}{SUFFIX}"
    # A link in the folder may lead anywhere: what lies elsewhere is no recording of it.
    if not path.is_file() or path.resolve().parent != folder:
        raise problems.RecordingNotFoundError(f"there is no recording {name!r}")
    if not is_finished(path):
        raise problems.RecordingConflictError(
            f"{name!r} is being written, or was torn: end it, or make a finished file of it "
            "with `frictus recover`"
        )
    return FileResponse(path, media_type="application/octet-stream", filename=path.name)


@router.get(
    "/rigs/{rig}/recording",
    dependencies=[Depends(needs("read"))],
    responses=problems.documented(*_RIG),
)
def get_recording(rig: RigName, given: Given) -> RecordingState:
    """Return what the rig's recorder does: file, length, blocks, and what was lost."""
    return given.link.rig(rig).recording()


@router.post(
    "/rigs/{rig}/recordings",
    dependencies=[Depends(needs("calibrate"))],
    status_code=201,
    responses=problems.documented(*_ASK, problems.UnsupportedMediaError),
    openapi_extra=body_of(RecordingAsked),
)
def start_recording(
    rig: RigName,
    given: Given,
    response: Response,
    asked: Annotated[RecordingAsked, json_body(RecordingAsked)],
) -> RecordingState:
    """Have the rig's recorder record everything that the rig publishes."""
    with _conflicts():
        state = given.link.rig(rig).record(asked.name, asked.participant, asked.notes)
    response.headers["Location"] = f"/v1/rigs/{rig}/recording"
    return state


@router.post(
    "/rigs/{rig}/recording/stop",
    dependencies=[Depends(needs("calibrate"))],
    responses=problems.documented(*_ASK),
)
def stop_recording(rig: RigName, given: Given) -> RecordingState:
    """End the recording; return how long it became and what was lost in it."""
    with _conflicts():
        return given.link.recorder_of(rig).end_recording()
