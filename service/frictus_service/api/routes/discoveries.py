"""Paths of discoveries: started, followed by events, cancelled, and their reports."""

from collections.abc import AsyncIterator
from typing import Annotated, Final

from fastapi import APIRouter, Depends, Path, Request, Response
from fastapi.responses import FileResponse
from fastapi.sse import EventSourceResponse, ServerSentEvent
from pydantic import TypeAdapter

from frictus_service.api import problems
from frictus_service.api.access import needs
from frictus_service.api.event_stream import LastEventId, follow, place
from frictus_service.api.requests import JSON, parse_json, raw_body, require_media
from frictus_service.api.routes.models import body_of
from frictus_service.api.services import Services, services
from frictus_service.discovery.document import DOCUMENT, REPORT, Discovery
from frictus_service.discovery.jobs import (
    DiscoveryEvent,
    DiscoveryJob,
    DiscoveryJobs,
    DiscoverySpec,
)
from frictus_service.job_folder import ACTIVE

Given = Annotated[Services, Depends(services)]
Id = Annotated[
    str, Path(pattern=r"^[0-9a-f-]{1,64}$", description="Id of the discovery, as it was made")
]

_READ: Final = (
    problems.UnauthenticatedError,
    problems.MissingScopeError,
    problems.InvalidError,
    problems.DiscoveryNotFoundError,
)
_WRITE: Final = (*_READ, problems.WrongStateError)
_SPEC: Final[TypeAdapter[DiscoverySpec]] = TypeAdapter(DiscoverySpec)
router = APIRouter(prefix="/v1/discoveries", tags=["discoveries"])


@router.post(
    "",
    status_code=202,
    responses=problems.documented(
        *_READ[:3],
        problems.StudyNotFoundError,
        problems.TooLargeError,
        problems.UnsupportedMediaError,
    ),
    openapi_extra=body_of(DiscoverySpec),
)
def start_discovery(
    given: Given,
    by: Annotated[str, Depends(needs("calibrate"))],
    request: Request,
    response: Response,
    body: Annotated[bytes, Depends(raw_body)],
) -> DiscoveryJob:
    """Find out what a model gets wrong in a study; `Location` is where it can be followed.

    One runs at a time; others wait for their turn.
    """
    require_media(request, JSON)
    job = given.discoveries.start(parse_json(_SPEC, body, extra=None), by)
    response.headers["Location"] = f"/v1/discoveries/{job.id}"
    return job


@router.get(
    "", dependencies=[Depends(needs("read"))], responses=problems.documented(*_READ[:2])
)
def list_discoveries(given: Given) -> DiscoveryJobs:
    """List the discoveries in this machine's folder of studies, newest first."""
    return DiscoveryJobs(discoveries=given.discoveries.shelf.all())


def existing(discovery: Id, given: Given) -> DiscoveryJob:
    """Return the discovery that a path names; a dependency."""
    return given.discoveries.shelf.get(discovery)


Existing = Annotated[DiscoveryJob, Depends(existing)]


@router.get(
    "/{discovery}",
    dependencies=[Depends(needs("read"))],
    responses=problems.documented(*_READ),
)
def get_discovery(found: Existing) -> DiscoveryJob:
    """Return where a discovery stands: state, progress, verdict."""
    return found


@router.get(
    "/{discovery}/events",
    dependencies=[Depends(needs("read")), Depends(place)],
    response_class=EventSourceResponse,
    responses=problems.documented(*_READ),
)
async def follow_discovery(
    found: Existing,
    given: Given,
    last_event_id: LastEventId = 0,
) -> AsyncIterator[ServerSentEvent]:
    """Follow a discovery: `state` and `progress` events, from the first one on.

    The stream ends when the discovery does not run any more. After a break, `Last-Event-ID`
    gives what was missed.
    """
    jobs = given.discoveries

    def active() -> bool:
        return jobs.shelf.get(found.id).state in ACTIVE

    def events(after: int) -> list[DiscoveryEvent]:
        return jobs.shelf.events(found.id, after)

    async for event in follow(active, events, lambda: jobs.closing, last_event_id):
        yield event


@router.delete(
    "/{discovery}",
    status_code=202,
    dependencies=[Depends(needs("calibrate"))],
    responses=problems.documented(*_WRITE),
)
def cancel_discovery(discovery: Id, given: Given) -> DiscoveryJob:
    """Cancel a discovery; it ends within moments. What trials said is kept for the next one."""
    return given.discoveries.cancel(discovery)


def finished(found: Existing) -> DiscoveryJob:
    """Return a discovery that has a report; a dependency."""
    if found.state != "done":
        raise problems.WrongStateError(
            f"discovery {found.id} is {found.state}: there is a report once it is done"
        )
    return found


Finished = Annotated[DiscoveryJob, Depends(finished)]


@router.get(
    "/{discovery}/report",
    dependencies=[Depends(needs("read"))],
    responses=problems.documented(*_WRITE),
)
def get_report(found: Finished, given: Given) -> Discovery:
    """Return the report: causes, what is unexplained, the extended model (`discovery/1`)."""
    path = given.discoveries.shelf.folder(found.id) / DOCUMENT
    return Discovery.model_validate_json(path.read_bytes())


@router.get(
    "/{discovery}/report.html",
    dependencies=[Depends(needs("read"))],
    response_class=FileResponse,
    responses=problems.documented(*_WRITE),
)
def get_page(found: Finished, given: Given) -> FileResponse:
    """Return the report as a page with figures."""
    path = given.discoveries.shelf.folder(found.id) / REPORT
    return FileResponse(path, media_type="text/html")
