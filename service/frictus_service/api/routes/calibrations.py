"""Paths of calibrations: started, followed by events, cancelled, resumed, published."""

from typing import Annotated

from fastapi import Depends, Query, Request, Response
from pydantic import BaseModel, Field

from frictus_service.api import problems
from frictus_service.api.access import needs
from frictus_service.api.requests import IdempotencyKey, body_of, json_body, once_of, raw_body
from frictus_service.api.routes.jobs import BODY, JobRoutes, id_of
from frictus_service.api.services import Given
from frictus_service.calibration.job import CalibrationSpec
from frictus_service.job_folder import State
from frictus_service.registry.documents import NAME, Calibration, CalibrationPage, Published

jobs = JobRoutes(
    "calibration",
    "calibrations",
    Calibration,
    lambda given: given.calibrations,
    problems.CalibrationNotFoundError,
    problems.NoRegistryError,
)
router = jobs.router


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


@router.post(
    "",
    status_code=202,
    responses=problems.documented(
        *jobs.read,
        problems.RigNotFoundError,
        problems.NoLinkError,
        problems.RigCalibratingError,
        problems.NotStoredError,
        problems.IdempotencyKeyReusedError,
        *BODY,
    ),
    openapi_extra=body_of(CalibrationSpec),
)
def start_calibration(
    given: Given,
    by: Annotated[str, Depends(needs("calibrate"))],
    request: Request,
    response: Response,
    body: Annotated[bytes, Depends(raw_body)],
    spec: Annotated[CalibrationSpec, json_body(CalibrationSpec, extra=None)],
    idempotency_key: IdempotencyKey = None,
) -> Calibration:
    """Start a calibration; `Location` is where it can be followed, cancelled and published.

    One runs on a rig at a time. The quick protocol learns its prior from the published models
    of other participants unless `prior` brings some.
    """
    once = once_of(request, idempotency_key, by, body)
    if once is None or given.calibrations.store.made_by(once) is None:
        given.link.rig(spec.rig)  # 404 now, rather than a calibration that fails
    calibration = given.calibrations.start(spec, by=by, once=once)
    response.headers["Location"] = f"/v1/calibrations/{calibration.id}"
    return calibration


@router.get(
    "", dependencies=[Depends(needs("read"))], responses=problems.documented(*jobs.read)
)
def list_calibrations(
    given: Given,
    rig: Annotated[str | None, Query(max_length=64)] = None,
    participant: Annotated[str | None, Query(max_length=64)] = None,
    state: State | None = None,
    after: Annotated[str, Query(max_length=200, description="`next` of the page before")] = "",
    limit: Annotated[int, Query(ge=1, le=1_000)] = 100,
) -> CalibrationPage:
    """List calibrations, newest first."""
    given.calibrations.recover()
    return given.calibrations.store.find(
        rig=rig, participant=participant, state=state, after=after, limit=limit
    )


jobs.add_get("Return where a calibration stands: state, progress, result, published model.")
jobs.add_events(lambda given: given.calibrations.store.events)
jobs.add_cancel(
    "Cancel a calibration; it ends, the rig disarmed, within moments. Its trials are kept."
)
jobs.add_resume(
    "Go on with a calibration that was interrupted or failed; finished trials are kept."
)


@router.post(
    "/{calibration}/publish",
    status_code=201,
    responses=problems.documented(*jobs.write, *BODY),
    openapi_extra=body_of(Publication),
)
def publish_calibration(
    calibration: Annotated[str, id_of("calibration")],
    given: Given,
    by: Annotated[str, Depends(needs("calibrate"))],
    response: Response,
    wanted: Annotated[Publication, json_body(Publication)],
) -> Published:
    """Publish the model of a calibration. It is published once: again gets the same answer."""
    published = given.calibrations.publish(
        calibration, name=wanted.name, by=by, comment=wanted.comment
    )
    response.headers["Location"] = f"/v1/models/{published.reference}"
    return published
