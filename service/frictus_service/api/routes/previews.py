"""What a texture would be, before it is in the library or on a rig."""

from typing import Annotated, Final, Literal

from fastapi import APIRouter, Depends, Query, Request
from pydantic import BaseModel, Field, FiniteFloat, TypeAdapter

from frictus.errors import TextureError
from frictus.messages import Applied
from frictus.names import Name
from frictus.textures import Texture
from frictus_hardware.physics.screen import Screen
from frictus_service.api import problems
from frictus_service.api.access import needs
from frictus_service.api.requests import JSON, large_body, parse_json, require_media
from frictus_service.api.routes.textures import TEXTURE_SCHEMA
from frictus_service.api.services import Given

_TEXTURE: Final[TypeAdapter[Texture]] = TypeAdapter(Texture)
router = APIRouter(prefix="/v1/preview", tags=["textures"])


class Asked(BaseModel):
    """For which finger and rig."""

    speed_mm_s: Annotated[FiniteFloat, Field(gt=0.0, le=1_000.0)] = 50.0
    """Of the finger; says which frequencies a spatial texture has for it."""
    rig: Name | None = None
    """Whose model and screen say what is feasible."""


class FrictionCourse(BaseModel):
    """Friction over the first 10 mm of way, or 0.1 s of time."""

    per: Literal["mm", "s"] = Field(description="Unit of the step")
    step: float
    friction_n: list[float]


class Preview(BaseModel):
    """What a texture asks for, and what of it a rig could give."""

    courses: list[FrictionCourse] = Field(
        description="One over way, one over time; none for a map"
    )
    rms_n: list[float] | None = Field(
        description="In third octaves, 31.5 Hz to 1 kHz, at the speed; null for a map"
    )
    applied: Applied | None = Field(
        description="On the rig's whole screen, with its active model; null without a rig"
    )


@router.post(
    "",
    dependencies=[Depends(needs("read"))],
    responses=problems.documented(
        problems.UnauthenticatedError,
        problems.MissingScopeError,
        problems.InvalidError,
        problems.NotFeasibleError,
        problems.RigNotFoundError,
        problems.UnreadableRigError,
        problems.NoLinkError,
        problems.TooLargeError,
        problems.UnsupportedMediaError,
    ),
    openapi_extra={
        "requestBody": {"required": True, "content": {JSON: {"schema": TEXTURE_SCHEMA}}}
    },
)
def preview(
    given: Given,
    request: Request,
    body: Annotated[bytes, Depends(large_body)],
    asked: Annotated[Asked, Query()],
) -> Preview:
    """Return what a texture would be; changes nothing."""
    require_media(request, JSON)
    texture = parse_json(_TEXTURE, body)
    # Compiled code, which a service that nobody asks for previews need not load: seconds, once.
    from frictus_service.fidelity.preview import feasible, stretch_of, sums_of, third_octaves_n

    try:
        sums = sums_of(texture)
        applied = None
        if asked.rig is not None:
            rig = given.link.rig(asked.rig)
            status, model = rig.status(), rig.model().model
            screen = Screen(peak_v=status.screen_peak_v, size_mm=status.screen_mm)
            applied = feasible(texture, model, screen, status.sample_rate_hz)
    except TextureError as error:
        raise problems.NotFeasibleError(str(error)) from error
    stretches = [stretch_of(each) for each in sums]
    return Preview(
        courses=[
            FrictionCourse(per=drawn.per, step=drawn.step, friction_n=drawn.friction_n.tolist())
            for drawn in stretches
        ],
        rms_n=third_octaves_n(sums, asked.speed_mm_s).tolist() if sums else None,
        applied=applied,
    )
