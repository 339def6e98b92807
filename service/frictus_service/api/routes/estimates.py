"""Paths of what a rig's tracker knows of the finger on it, and its way into the registry."""

from typing import Annotated, Final

from fastapi import APIRouter, Depends, Response
from pydantic import Field

from frictus.errors import LinkError
from frictus.messages import EstimateState
from frictus.names import Name
from frictus.rig import Rig
from frictus_service.api import problems
from frictus_service.api.access import needs
from frictus_service.api.requests import body_of, json_body
from frictus_service.api.routes.calibrations import Publication
from frictus_service.api.routes.jobs import BODY
from frictus_service.api.routes.rigs import RigName
from frictus_service.api.services import Given
from frictus_service.registry.documents import Published

router = APIRouter(prefix="/v1/rigs", tags=["rigs"])
_READ: Final = (
    problems.UnauthenticatedError,
    problems.MissingScopeError,
    problems.InvalidError,
    problems.RigNotFoundError,
    problems.NoEstimateError,
    problems.UnreadableRigError,
    problems.NoLinkError,
)


class EstimatePublication(Publication):
    """How an estimate is published."""

    participant: Annotated[
        Name | None,
        Field(
            description="Pseudonym; null: of whom the model in force is, unless another finger "
            "was noticed"
        ),
    ] = None


def _estimate(rig: Rig) -> EstimateState:
    try:
        return rig.estimate()
    except LinkError as error:
        raise problems.NoEstimateError(str(error)) from error


@router.get(
    "/{rig}/estimate",
    dependencies=[Depends(needs("read"))],
    responses=problems.documented(*_READ),
)
def get_estimate(rig: RigName, given: Given) -> EstimateState:
    """Return what is known of the finger on the screen now, twice a second anew."""
    return _estimate(given.link.rig(rig))


@router.post(
    "/{rig}/estimate/publish",
    status_code=201,
    responses=problems.documented(*_READ, problems.NoRegistryError, *BODY),
    openapi_extra=body_of(EstimatePublication),
)
def publish_estimate(
    rig: RigName,
    given: Given,
    by: Annotated[str, Depends(needs("calibrate"))],
    response: Response,
    wanted: Annotated[EstimatePublication, json_body(EstimatePublication)],
) -> Published:
    """Publish the estimate as the next version of a name, with the provenance `live`."""
    shown = given.link.rig(rig)
    estimate = _estimate(shown)
    model = estimate.model
    if model is None:
        raise problems.NoEstimateError(
            "nothing was felt yet: play a texture, and slide over it at 10 to 150 mm/s"
        )
    participant = wanted.participant or model.participant
    if estimate.new_fingers and wanted.participant is None:
        raise problems.InvalidError(
            f"participant: another finger was noticed ({estimate.new_fingers} times), so that "
            "it may not be that of the model in force; say whose finger it is"
        )
    if participant is None:
        raise problems.InvalidError(
            "participant: the model in force is of nobody in particular; say whose finger it is"
        )
    told = model.provenance | {"simulated": shown.status().simulated}
    published = given.registry.publish(
        model.model_copy(update={"participant": participant, "provenance": told}),
        wanted.name or f"{rig}/{participant}",
        by=by,
        rig=rig,
        comment=wanted.comment,
    )
    response.headers["Location"] = f"/v1/models/{published.reference}"
    return published
