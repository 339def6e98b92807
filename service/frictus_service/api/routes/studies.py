"""The path of the studies: which there are on this machine."""

from datetime import UTC, datetime
from typing import Annotated

from fastapi import APIRouter, Depends
from pydantic import BaseModel, Field

from frictus_service.api import problems
from frictus_service.api.access import needs
from frictus_service.api.services import Services, services

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
def list_studies(given: Annotated[Services, Depends(services)]) -> StudyList:
    """List the studies that a discovery can name; those of calibrations are among them."""
    found = []
    for name, path in given.discoveries.store.studies().items():
        try:
            stat = path.stat()
        except FileNotFoundError:
            continue  # somebody has just moved it
        modified = datetime.fromtimestamp(stat.st_mtime, UTC).isoformat()
        found.append(StudyFile(name=name, bytes=stat.st_size, modified_utc=modified))
    return StudyList(studies=sorted(found, key=lambda one: one.modified_utc, reverse=True))
