"""The paths of the studies: which there are on this machine, and one more."""

import re
from datetime import UTC, datetime
from pathlib import Path as FilePath
from typing import Annotated, Any, Final

from fastapi import APIRouter, Depends, Path, Request
from pydantic import AfterValidator, BaseModel, Field

from frictus.keys import of_a_file
from frictus_service.api import problems
from frictus_service.api.access import needs
from frictus_service.api.limits import RequestLimits, address_of
from frictus_service.api.requests import require_media
from frictus_service.api.services import Given
from frictus_service.api.uploads import keep_study

HDF5: Final = ("application/x-hdf5", "application/octet-stream")
_BODY: Final[dict[str, Any]] = {
    "requestBody": {
        "required": True,
        "content": {kind: {"schema": {"type": "string", "format": "binary"}} for kind in HDF5},
    }
}
_NAME: Final = r"^[A-Za-z0-9_][A-Za-z0-9_.\-]{0,95}\.h5$"


def _in_words(name: str) -> str:
    """Return a name as it is; refuse others in words, not by the pattern."""
    if not re.fullmatch(_NAME, name):
        raise ValueError(
            "a letter, digit or '_', up to 95 letters, digits, '_', '-' and '.', then .h5 are "
            "accepted, such as visit1.h5"
        )
    return of_a_file(name)


Name = Annotated[
    str,
    Path(
        description="Letters, digits, '_', '-' and '.'; ends with .h5",
        json_schema_extra={"pattern": _NAME},
    ),
    AfterValidator(_in_words),
]
router = APIRouter(prefix="/v1/studies", tags=["discoveries"])


class StudyFile(BaseModel):
    """One study in the folder of this machine."""

    name: Annotated[str, Field(description="As a discovery names it, such as visit1.h5")]
    bytes: int
    modified_utc: Annotated[str, Field(description="ISO 8601")]


class StudyList(BaseModel):
    """The studies in the folder of this machine, the newest first."""

    studies: list[StudyFile]


@router.get(
    "",
    dependencies=[Depends(needs("read"))],
    responses=problems.documented(problems.UnauthenticatedError, problems.MissingScopeError),
)
def list_studies(given: Given) -> StudyList:
    """List the studies that a discovery can name; those of calibrations are among them."""
    found = []
    for name, path in given.discoveries.store.studies().items():
        try:
            found.append(_described(name, path))
        except FileNotFoundError:
            continue  # somebody has just moved it
    return StudyList(studies=sorted(found, key=lambda one: one.modified_utc, reverse=True))


@router.put(
    "/{name}",
    dependencies=[Depends(needs("calibrate"))],
    status_code=201,
    openapi_extra=_BODY,
    responses=problems.documented(
        problems.UnauthenticatedError,
        problems.MissingScopeError,
        problems.PathNotFoundError,  # a name with a slash in it
        problems.StudyExistsError,
        problems.InvalidError,
        problems.TooLargeError,
        problems.UnsupportedMediaError,
        problems.BusyError,
        problems.NotStoredError,
    ),
)
async def put_study(name: Name, given: Given, request: Request) -> StudyFile:
    """Keep a `study/1` file in the folder of this machine; none is replaced."""
    require_media(request, *HDF5)
    limits: RequestLimits = request.app.state.limits
    with limits.uploads.held(address_of(request)):
        kept = await keep_study(request, given.config.studies, name, given.commands)
    return _described(name, kept)


def _described(name: str, path: FilePath) -> StudyFile:
    stat = path.stat()
    modified = datetime.fromtimestamp(stat.st_mtime, UTC).isoformat()
    return StudyFile(name=name, bytes=stat.st_size, modified_utc=modified)
