"""The path by which a rig is given a published model."""

from typing import Annotated

from fastapi import APIRouter, Depends
from pydantic import BaseModel, Field

from frictus_service.api import problems
from frictus_service.api.access import acts_as, needs
from frictus_service.api.requests import IfMatch, body_of, json_body, quoted, required_match
from frictus_service.api.routes.rigs import REPLACE, RigName
from frictus_service.api.services import Given
from frictus_service.errors import RegistryUnavailableError
from frictus_service.registry.documents import REFERENCE, Activation

router = APIRouter(prefix="/v1/rigs", tags=["models"])


class Wanted(BaseModel):
    """Which model a rig shall apply."""

    model: Annotated[
        str,
        Field(
            max_length=200,
            description="Reference: rig1/P01@production",
            json_schema_extra={"pattern": f"^{REFERENCE}$"},
        ),
    ]


class Activated(Activation):
    """What the rig made of it."""

    as_published: Annotated[
        bool, Field(description="Whether what the rig applies is what was published")
    ]
    message: Annotated[
        str,
        Field(
            description="What the rig has to say of it, and whether it is another rig's model"
        ),
    ]


@router.post(
    "/{rig}/model/activate",
    responses=problems.documented(
        *REPLACE,
        problems.ModelNotFoundError,
        problems.NoRegistryError,
        problems.NotNotedError,
    ),
    openapi_extra=body_of(Wanted),
)
def activate(
    rig: RigName,
    given: Given,
    by: Annotated[str, Depends(needs("calibrate"))],
    client: Annotated[str, Depends(acts_as("calibrate"))],
    wanted: Annotated[Wanted, json_body(Wanted)],
    if_match: IfMatch = None,
) -> Activated:
    """Give a rig a published model, only while it is disarmed, and return what it confirmed.

    `If-Match`, if it is sent, names the model that the rig must have now.
    """
    version = given.registry.get(wanted.model)
    asked = given.link.rig(rig)
    simulated = asked.status().simulated
    replaces = "*"
    if if_match is not None:
        replaces = required_match(if_match, asked.model().etag)
    etag, remarks = asked.on_behalf_of(client).apply_model(
        version.model, None if replaces == "*" else replaces
    )
    try:
        activation = given.registry.activations.record(
            version, site=given.link.site, rig=rig, confirmed=etag, by=by
        )
    except RegistryUnavailableError as error:
        raise problems.NotNotedError(
            f"rig {rig!r} applies it now, and its model has the ETag {quoted(etag)}; but that "
            f"could not be written down, so activate it again later: {error}"
        ) from error
    return Activated(
        **activation.model_dump(),
        as_published=etag == version.etag,
        message="; ".join(filter(None, (remarks, version.remark_on(rig, simulated)))),
    )
