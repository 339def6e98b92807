"""Paths of calibrations: started, followed by events, cancelled, resumed, published."""

from collections.abc import AsyncIterator
from typing import Annotated, Final

from fastapi import APIRouter, Depends, Path, Query, Request, Response
from fastapi.sse import EventSourceResponse, ServerSentEvent
from pydantic import BaseModel, Field, TypeAdapter

from frictus_service.api import problems
from frictus_service.api.access import needs
from frictus_service.api.event_stream import LastEventId, follow, place
from frictus_service.api.requests import (
    JSON,
    IdempotencyKey,
    once_of,
    parse_json,
    raw_body,
    require_media,
)
from frictus_service.api.routes.models import body_of
from frictus_service.api.services import Services, services
from frictus_service.calibration.job import CalibrationSpec
from frictus_service.registry.calibrations import ACTIVE
from frictus_service.registry.documents import (
    NAME,
    Calibration,
    CalibrationEvent,
    CalibrationPage,
    CalibrationState,
    Published,
)

Given = Annotated[Services, Depends(services)]
Id = Annotated[
    str, Path(pattern=r"^[0-9a-f-]{1,64}$", description="Id of the calibration, as it was made")
]

_READ: Final = (
    problems.UnauthenticatedError,
    problems.MissingScopeError,
    problems.InvalidError,
    problems.CalibrationNotFoundError,
    problems.NoRegistryError,
)
_WRITE: Final = (*_READ, problems.WrongStateError)
_SPEC: Final[TypeAdapter[CalibrationSpec]] = TypeAdapter(CalibrationSpec)
router = APIRouter(prefix="/v1/calibrations", tags=["calibrations"])


class Publication(BaseModel):
    """How the model of a calibration is published."""

    name: Annotated[
        str | None,
        Field(
            max_length=200,
            description="null: RIG/PARTICIPANT",
            json_schema_extra={"pattern": f"^{NAME}$"},
        ),
    ] = None
    comment: Annotated[str, Field(max_length=1_000)] = ""


_PUBLICATION: Final[TypeAdapter[Publication]] = TypeAdapter(Publication)


@router.post(
    "",
    status_code=202,
    responses=problems.documented(
        *_READ,
        problems.RigNotFoundError,
        problems.NoLinkError,
        problems.RigCalibratingError,
        problems.IdempotencyKeyReusedError,
        problems.TooLargeError,
        problems.UnsupportedMediaError,
    ),
    openapi_extra=body_of(CalibrationSpec),
)
def start_calibration(
    given: Given,
    by: Annotated[str, Depends(needs("calibrate"))],
    request: Request,
    response: Response,
    body: Annotated[bytes, Depends(raw_body)],
    idempotency_key: IdempotencyKey = None,
) -> Calibration:
    """Start a calibration; `Location` is where it can be followed, cancelled and published.

    One runs on a rig at a time. The quick protocol learns its prior from the published models
    of other participants unless `prior` brings some.
    """
    require_media(request, JSON)
    spec = parse_json(_SPEC, body, extra=None)
    given.link.rig(spec.rig)  # 404 now, rather than a calibration that fails
    once = once_of(request, idempotency_key, by, body)
    calibration = given.jobs.start(spec, by=by, once=once)
    response.headers["Location"] = f"/v1/calibrations/{calibration.id}"
    return calibration


@router.get("", dependencies=[Depends(needs("read"))], responses=problems.documented(*_READ))
def list_calibrations(
    given: Given,
    rig: Annotated[str | None, Query(max_length=64)] = None,
    participant: Annotated[str | None, Query(max_length=64)] = None,
    state: CalibrationState | None = None,
    after: Annotated[str, Query(max_length=200, description="`next` of the page before")] = "",
    limit: Annotated[int, Query(ge=1, le=1_000)] = 100,
) -> CalibrationPage:
    """List calibrations, newest first."""
    given.jobs.recover()
    return given.registry.calibrations.find(
        rig=rig, participant=participant, state=state, after=after, limit=limit
    )


def existing(calibration: Id, given: Given) -> Calibration:
    """Return the calibration that a path names; a dependency."""
    given.jobs.recover()
    return given.registry.calibrations.get(calibration)


Existing = Annotated[Calibration, Depends(existing)]


@router.get(
    "/{calibration}",
    dependencies=[Depends(needs("read"))],
    responses=problems.documented(*_READ),
)
def get_calibration(found: Existing) -> Calibration:
    """Return where a calibration stands: state, progress, result, published model."""
    return found


@router.get(
    "/{calibration}/events",
    dependencies=[Depends(needs("read")), Depends(place)],
    response_class=EventSourceResponse,
    responses=problems.documented(*_READ),
)
async def follow_calibration(
    found: Existing,
    given: Given,
    last_event_id: LastEventId = 0,
) -> AsyncIterator[ServerSentEvent]:
    """Follow a calibration: `state` and `progress` events, from the first one on.

    The stream ends when the calibration does not run any more. After a break, `Last-Event-ID`
    gives what was missed.
    """
    kept = given.registry.calibrations

    def active() -> bool:
        return kept.get(found.id).state in ACTIVE

    def events(after: int) -> list[CalibrationEvent]:
        return kept.events(found.id, after)

    async for event in follow(active, events, lambda: given.jobs.closing, last_event_id):
        yield event


@router.delete(
    "/{calibration}",
    status_code=202,
    dependencies=[Depends(needs("calibrate"))],
    responses=problems.documented(*_WRITE),
)
def cancel_calibration(calibration: Id, given: Given) -> Calibration:
    """Cancel a calibration; it ends, the rig disarmed, within moments. Its trials are kept."""
    return given.jobs.cancel(calibration)


@router.post(
    "/{calibration}/resume",
    status_code=202,
    dependencies=[Depends(needs("calibrate"))],
    responses=problems.documented(*_WRITE, problems.RigCalibratingError),
)
def resume_calibration(calibration: Id, given: Given) -> Calibration:
    """Go on with a calibration that was interrupted or failed; finished trials are kept."""
    return given.jobs.resume(calibration)


@router.post(
    "/{calibration}/publish",
    status_code=201,
    responses=problems.documented(
        *_WRITE, problems.TooLargeError, problems.UnsupportedMediaError
    ),
    openapi_extra=body_of(Publication),
)
def publish_calibration(
    calibration: Id,
    given: Given,
    by: Annotated[str, Depends(needs("calibrate"))],
    request: Request,
    response: Response,
    body: Annotated[bytes, Depends(raw_body)],
) -> Published:
    """Publish the model of a calibration. It is published once: again gets the same answer."""
    require_media(request, JSON)
    wanted = parse_json(_PUBLICATION, body)
    published = given.jobs.publish(calibration, name=wanted.name, by=by, comment=wanted.comment)
    response.headers["Location"] = f"/v1/models/{published.reference}"
    return published
