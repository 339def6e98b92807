"""Paths of recordings: start, end and follow one on a rig; which there are on this machine."""

import asyncio
import contextlib
import json
import logging
import math
import shutil
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from datetime import UTC, datetime
from pathlib import Path as FilePath
from tempfile import TemporaryDirectory, gettempdir
from typing import Annotated, Any, Final, Literal

from fastapi import APIRouter, Depends, Query, Request, Response
from fastapi import Path as PathParameter
from fastapi.responses import FileResponse
from h11 import LocalProtocolError
from pydantic import BaseModel, Field
from starlette.types import Receive, Scope, Send

from frictus.errors import RefusedError
from frictus.lenient import Exact
from frictus.messages import RecordingState
from frictus.names import NAME, Pseudonym
from frictus_hardware.arrays import FloatArray
from frictus_service.api import problems
from frictus_service.api.access import needs
from frictus_service.api.limits import TAKE_S, RequestLimits, address_of
from frictus_service.api.requests import SLOWEST_BYTES_S, body_of, json_body
from frictus_service.api.routes.rigs import RigName
from frictus_service.api.services import Given, Services
from frictus_service.durable import left_behind
from frictus_service.errors import RecordingError

EXPORT_PREFIX: Final = "frictus-export-"
"""Of folders in the temporary folder of the system."""
_LOG: Final = logging.getLogger(__name__)
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
_FILE: Final[tuple[type[problems.ApiError], ...]] = (
    *_RIG[:2],
    problems.RecordingNotFoundError,
    problems.InvalidError,
    problems.RecordingConflictError,
)
MOST_LISTED: Final = 500
MOST_NOTES: Final = 2_000
"""Characters of a header."""
EXPORT_S: Final = 600.0
ExportFormat = Literal["study", "replay"]
_EXPORTS: Final[dict[ExportFormat, tuple[str, str]]] = {
    "study": ("h5", ".h5"),
    "replay": ("replay", ".npz"),
}
"""What the command calls them, and their suffixes."""
RecordingName = Annotated[
    str, PathParameter(min_length=1, max_length=100, description="As listed"), NAME
]
router = APIRouter(prefix="/v1", tags=["recordings"])


class RecordingAsked(Exact):
    """What to record."""

    name: Annotated[str, Field(min_length=1, max_length=100), NAME]
    participant: Pseudonym | None = None
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
    site: str
    router: str = Field(description="By which this service reaches the rigs")
    recordings: list[RecordingFile]
    left_out: int = Field(description="How many older ones there are besides")


class RecordedSignal(BaseModel):
    """One signal over the columns of a course."""

    name: Literal["lateral_force", "normal_force", "speed", "screen_voltage"]
    unit: str
    low: list[float | None] = Field(description="Least of each column; null: nothing there")
    high: list[float | None]


class RecordedEvent(BaseModel):
    """Something that happened while it was recorded."""

    at_s: float
    what: str


class RecordingCourse(BaseModel):
    """How a recording went."""

    column_s: float = Field(description="What one column covers")
    signals: list[RecordedSignal]
    events: list[RecordedEvent] = Field(description="Arming, trips, what is missing; in order")
    left_out: int = Field(description="How many events there are besides")
    guided_trials: int = Field(description="Trials in which somebody was guided: of a study")
    ending: str = Field(description="How far the recording was looked at, for people")


@contextmanager
def _conflicts() -> Iterator[None]:
    """Answer with 409 where the recorder says `conflict`: no ETag is involved."""
    try:
        yield
    except RefusedError as error:
        if error.code != "conflict":
            raise
        raise problems.RecordingConflictError(str(error)) from error


@contextmanager
def _kept(name: str) -> Iterator[None]:
    """Answer with 404 where a recording is deleted or moved while it is looked at."""
    try:
        yield
    except FileNotFoundError as error:
        raise problems.RecordingNotFoundError(
            f"there is no recording {name!r} any more: deleted or moved while it was read"
        ) from error


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
        site=given.link.site,
        router=given.config.router.endpoint,
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
    responses=problems.documented(*_FILE),
)
def get_recording_file(name: RecordingName, given: Given) -> FileResponse:
    """Return a finished recording of this machine's folder as a file."""
    path = _finished(name, given)
    return RecordingResponse(path, media_type="application/octet-stream", filename=path.name)


@router.get(
    "/recordings/{name}/course",
    dependencies=[Depends(needs("read"))],
    responses=problems.documented(*_FILE, problems.BusyError),
)
def get_recording_course(
    name: RecordingName, given: Given, request: Request
) -> RecordingCourse:
    """Return how a finished recording went: its signals in columns, and what happened."""
    from frictus_service.recording.course import SIGNALS, course_of
    from frictus_service.recording.summary import length_s, shelf_entry

    path = _finished(name, given)
    limits: RequestLimits = request.app.state.limits
    with limits.courses.held(address_of(request)), _kept(name):
        try:
            course = course_of(path, length_s(shelf_entry(path)) or 0.0)
        except RecordingError as error:
            told = str(error).replace(str(path), name)
            raise problems.RecordingConflictError(told) from error
    return RecordingCourse(
        column_s=course.column_s,
        signals=[
            RecordedSignal(
                name=signal,
                unit=unit,
                low=_drawn(course.low[signal]),
                high=_drawn(course.high[signal]),
            )
            for signal, unit in SIGNALS.items()
        ],
        events=[RecordedEvent(at_s=one.at_s, what=one.what) for one in course.events],
        left_out=course.left_out,
        guided_trials=course.guided_trials,
        ending=course.ending,
    )


@router.get(
    "/recordings/{name}/export/{to}",
    dependencies=[Depends(needs("read"))],
    response_class=FileResponse,
    responses=problems.documented(*_FILE, problems.BusyError, problems.NotStoredError),
)
def get_recording_export(
    name: RecordingName, to: ExportFormat, given: Given, request: Request
) -> FileResponse:
    """Return a finished recording in another form, as `frictus export` makes it.

    `study` is a `study/1` file of its guided trials, `replay` what plays as a rig. The header
    `Frictus-Notes` says what it holds and what was left out.
    """
    path = _finished(name, given)
    option, suffix = _EXPORTS[to]
    limits: RequestLimits = request.app.state.limits
    with ExitStack() as until_sent:
        until_sent.enter_context(limits.exports.held(address_of(request)))
        folder = until_sent.enter_context(TemporaryDirectory(prefix=EXPORT_PREFIX))
        out = FilePath(folder, f"{name}{suffix}")
        asked = ("export", str(path), "--to", option, "--out", str(out), "--json")
        said = given.commands.run(asked, EXPORT_S, path, name)
        answer = ExportResponse(
            out,
            media_type="application/octet-stream",
            filename=out.name,
            headers={"Frictus-Notes": _notes(json.loads(said))},
        )
        answer.until_sent = until_sent.pop_all()
    return answer


def _notes(said: dict[str, Any]) -> str:
    """Return what an export says of itself on one line, as a header can hold it."""
    told = [str(said["ending"])]
    if "trials" in said:
        told.append(f"trials: {said['trials']}")
    if said.get("missing_samples"):
        told.append(f"samples that are missing: {said['missing_samples']}")
    told += [
        f"left out: trial {one['trial']}, {one['field']}: {one['reason']}"
        for one in said.get("excluded", [])
    ]
    plain = "".join(each if each.isprintable() else " " for each in "; ".join(told))
    line = " ".join(plain.split()).encode("ascii", "replace").decode()
    return line if len(line) <= MOST_NOTES else f"{line[:MOST_NOTES]}..."


def _drawn(extremes: FloatArray) -> list[float | None]:
    return [None if math.isnan(each) else round(each, 4) for each in extremes.tolist()]


def _finished(name: str, given: Services) -> FilePath:
    """Return the file of a finished recording in this machine's folder."""
    from frictus_service.recording.recording import SUFFIX
    from frictus_service.recording.summary import is_finished

    folder = given.config.recordings.resolve()
    path = folder / f"{name}{SUFFIX}"
    # A link in the folder may lead anywhere: what lies elsewhere is no recording of it.
    if not path.is_file() or path.resolve().parent != folder:
        raise problems.RecordingNotFoundError(f"there is no recording {name!r}")
    with _kept(name):
        finished = is_finished(path)
    if not finished:
        raise problems.RecordingConflictError(
            f"{name!r} is being written, or was torn: end it, or make a finished file of it "
            "with `frictus recover`"
        )
    return path


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


class RecordingResponse(FileResponse):
    """A file that somebody may shorten while it is sent: its answer then breaks off."""

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send it."""
        try:
            await super().__call__(scope, receive, send)
        except LocalProtocolError:  # less than was announced: the server ends the connection
            _LOG.warning("%s was shortened while it was sent", self.path)


class ExportResponse(FileResponse):
    """A file that is there until it is sent, or nobody takes it, or not in time.

    Who takes a few bytes now and then holds a place, and a file, that others wait for.

    Attributes
    ----------
    until_sent : ExitStack
        What is held for it; closed at the end.
    """

    until_sent: ExitStack

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send it, and let go."""
        with self.until_sent:  # ends at once: who is cancelled cannot wait
            allowed_s = TAKE_S + FilePath(self.path).stat().st_size / SLOWEST_BYTES_S
            try:
                async with asyncio.timeout(allowed_s):
                    await super().__call__(scope, receive, send)
            except TimeoutError:  # the server ends the connection of an answer that breaks off
                _LOG.warning("%s was not taken within %.0f s", scope["path"], allowed_s)


def remove_left_exports() -> None:
    """Remove what exports of services that were killed have left."""
    for left in left_behind(FilePath(gettempdir()), EXPORT_PREFIX):
        with contextlib.suppress(OSError):  # somebody else's, or gone already
            shutil.rmtree(left)
