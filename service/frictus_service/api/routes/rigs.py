"""Paths of the rigs: status, scene, compensation, model, adaptation, time, stop and reset."""

from typing import Annotated, Final

import anyio
from fastapi import APIRouter, Depends, Path, Request, Response
from pydantic import BaseModel, Field, TypeAdapter

from frictus.messages import AdaptationPolicy, Applied, RigStatus, SafetyState, TimeState
from frictus.model import Compensation, Model
from frictus.names import Name
from frictus.textures import Scene
from frictus_service.api import problems
from frictus_service.api.access import acts_as, needs
from frictus_service.api.limits import RequestLimits
from frictus_service.api.requests import (
    JSON,
    IfMatch,
    IfNoneMatch,
    body_of,
    json_body,
    large_body,
    not_modified,
    parse_json,
    quoted,
    require_media,
    required_match,
)
from frictus_service.api.services import Given

RigName = Annotated[Name, Path(description="Name of the rig")]

_SCENE: Final[TypeAdapter[Scene]] = TypeAdapter(Scene)
_RIG: Final[tuple[type[problems.ApiError], ...]] = (
    problems.UnauthenticatedError,
    problems.MissingScopeError,
    problems.RigNotFoundError,
    problems.InvalidError,
    problems.UnreadableRigError,
    problems.NoLinkError,
)
_COMMAND: Final = (*_RIG, problems.UnknownOutcomeError)
REPLACE: Final[tuple[type[problems.ApiError], ...]] = (
    *_COMMAND,
    *problems.REFUSALS.values(),
    problems.ConflictError,
    problems.UnsupportedMediaError,
    problems.PreconditionRequiredError,
)
router = APIRouter(prefix="/v1/rigs", tags=["rigs"])


class RigList(BaseModel):
    """The rigs that are present."""

    site: str
    rigs: list[str] = Field(description="Names, sorted")


class SceneApplied(BaseModel):
    """What the rig made of the active scene."""

    etag: str
    source: str = Field(description="scene, or stream while a client streams a texture")
    applied: Applied


class RigState(BaseModel):
    """State of the rig after a command."""

    state: SafetyState


class Adaptation(BaseModel):
    """What a tracker may do with the model of a rig."""

    policy: AdaptationPolicy = Field(
        description="observe, suggest, or adapt: have gain and cutoff follow the finger"
    )


class AdaptationChoice(Adaptation):
    """What a tracker may do from now on, and what becomes of the model."""

    undo: bool = Field(
        default=False, description="Put the model back that was set before it was adapted"
    )


def _body(name: str) -> dict[str, object]:
    schema = {"$ref": f"#/components/schemas/{name}"}
    return {"requestBody": {"required": True, "content": {JSON: {"schema": schema}}}}


@router.get(
    "",
    dependencies=[Depends(needs("read"))],
    responses=problems.documented(*_RIG[:2], *_RIG[5:]),
)
def list_rigs(given: Given) -> RigList:
    """List the rigs of this site that are present."""
    return RigList(site=given.link.site, rigs=given.link.names())


@router.get(
    "/{rig}", dependencies=[Depends(needs("read"))], responses=problems.documented(*_RIG)
)
def get_status(rig: RigName, given: Given) -> RigStatus:
    """Return the newest status of a rig: state, owner, fault, counters, loop timing."""
    return given.link.rig(rig).status()


@router.get(
    "/{rig}/time", dependencies=[Depends(needs("read"))], responses=problems.documented(*_RIG)
)
def get_time(rig: RigName, given: Given) -> TimeState:
    """Return the fit of the device's sample counter to UTC."""
    return given.link.rig(rig).time()


@router.get(
    "/{rig}/scene",
    dependencies=[Depends(needs("read"))],
    response_model=Scene,
    responses=problems.documented(*_RIG) | {304: {"description": "Your copy is current"}},
)
def get_scene(
    rig: RigName, given: Given, response: Response, if_none_match: IfNoneMatch = None
) -> Scene | Response:
    """Return the active scene, as PUT takes it."""
    active = given.link.rig(rig).scene()
    return not_modified(if_none_match, active.etag, response) or active.scene


@router.get(
    "/{rig}/applied",
    dependencies=[Depends(needs("read"))],
    responses=problems.documented(*_RIG),
)
def get_applied(rig: RigName, given: Given) -> SceneApplied:
    """Return what the rig made of the active scene: gain, bias, and what was left out."""
    active = given.link.rig(rig).scene()
    return SceneApplied(etag=active.etag, source=active.source, applied=active.applied)


@router.put(
    "/{rig}/scene",
    responses=problems.documented(*REPLACE),
    openapi_extra=_body("Scene"),
)
def put_scene(
    rig: RigName,
    given: Given,
    client: Annotated[str, Depends(acts_as("render"))],
    request: Request,
    response: Response,
    body: Annotated[bytes, Depends(large_body)],
    if_match: IfMatch = None,
) -> Applied:
    """Replace the scene, with a cross-fade, and return what the rig made of it.

    A rig that somebody else has armed refuses with `not_owner` and names who holds it, unless
    they share it with whoever asks.
    """
    require_media(request, JSON)
    scene = parse_json(_SCENE, body)
    asked = given.link.rig(rig)
    replaces = required_match(if_match, asked.scene().etag)
    state = asked.on_behalf_of(client).set_scene(scene, None if replaces == "*" else replaces)
    response.headers["ETag"] = quoted(state.etag)
    return state.applied


@router.get(
    "/{rig}/compensation",
    dependencies=[Depends(needs("read"))],
    responses=problems.documented(*_RIG),
)
def get_compensation(rig: RigName, given: Given) -> Compensation:
    """Return the compensation mode in force: `model`, unless the holder chose another."""
    return given.link.rig(rig).status().compensation


@router.put(
    "/{rig}/compensation",
    responses=problems.documented(
        *_COMMAND, *problems.REFUSALS.values(), problems.UnsupportedMediaError
    ),
    openapi_extra=_body("Compensation"),
)
def put_compensation(
    rig: RigName,
    given: Given,
    client: Annotated[str, Depends(acts_as("render"))],
    asked: Annotated[Compensation, json_body(Compensation)],
) -> Compensation:
    """Choose the compensation mode until the lease ends, and return what is in force.

    Only while whoever asks holds the rig, or shares it: `not_armed` or `not_owner` otherwise.
    No If-Match is asked for, since nothing is lost that somebody has composed.
    """
    found = given.link.rig(rig).on_behalf_of(client)
    return found.compensate(asked.mode, speed_mm_s=asked.speed_mm_s)


@router.get(
    "/{rig}/model",
    dependencies=[Depends(needs("read"))],
    response_model=Model,
    responses=problems.documented(*_RIG) | {304: {"description": "Your copy is current"}},
)
def get_model(
    rig: RigName, given: Given, response: Response, if_none_match: IfNoneMatch = None
) -> Model | Response:
    """Return the active friction model, a `model/1` document."""
    active = given.link.rig(rig).model()
    return not_modified(if_none_match, active.etag, response) or active.model


@router.put(
    "/{rig}/model",
    status_code=204,
    response_class=Response,
    responses=problems.documented(*REPLACE),
    openapi_extra=_body("Model"),
)
def put_model(
    rig: RigName,
    given: Given,
    client: Annotated[str, Depends(acts_as("calibrate"))],
    response: Response,
    model: Annotated[Model, json_body(Model, extra="allow")],
    if_match: IfMatch = None,
) -> None:
    """Replace the friction model; only while the rig is disarmed.

    Fields that this version does not know are kept, as `model/1` demands.
    """
    asked = given.link.rig(rig)
    replaces = required_match(if_match, asked.model().etag)
    etag = asked.on_behalf_of(client).set_model(model, None if replaces == "*" else replaces)
    response.headers["ETag"] = quoted(etag)


@router.get(
    "/{rig}/adaptation",
    dependencies=[Depends(needs("read"))],
    responses=problems.documented(*_RIG),
)
def get_adaptation(rig: RigName, given: Given) -> Adaptation:
    """Return what a tracker may do with the model; the status counts what it has done."""
    return Adaptation(policy=given.link.rig(rig).status().adaptation)


@router.put(
    "/{rig}/adaptation",
    responses=problems.documented(
        *_COMMAND, *problems.REFUSALS.values(), problems.UnsupportedMediaError
    ),
    openapi_extra=body_of(AdaptationChoice),
)
def put_adaptation(
    rig: RigName,
    given: Given,
    client: Annotated[str, Depends(acts_as("calibrate"))],
    asked: Annotated[AdaptationChoice, json_body(AdaptationChoice)],
) -> Adaptation:
    """Choose what a tracker may do with the model, whoever holds the rig.

    With `undo` the model that was set before it was adapted comes back, with a cross-fade.
    """
    found = given.link.rig(rig).on_behalf_of(client)
    return Adaptation(policy=found.set_adaptation(asked.policy, undo=asked.undo))


@router.post(
    "/{rig}/stop", responses=problems.documented(*_COMMAND, *problems.REFUSALS.values())
)
async def stop(
    rig: RigName,
    given: Given,
    client: Annotated[str, Depends(acts_as("read"))],
    request: Request,
) -> RigState:
    """Ramp the output to zero now, whoever owns the rig. Anyone who may look may stop."""

    def stopped() -> RigState:
        return RigState(state=given.link.rig(rig).on_behalf_of(client).stop())

    limits: RequestLimits = request.app.state.limits
    return await anyio.to_thread.run_sync(stopped, limiter=limits.stops)


@router.post(
    "/{rig}/reset", responses=problems.documented(*_COMMAND, *problems.REFUSALS.values())
)
def reset(
    rig: RigName, given: Given, client: Annotated[str, Depends(acts_as("admin"))]
) -> RigState:
    """Clear a latched trip, as the operator who has removed its cause."""
    return RigState(state=given.link.rig(rig).on_behalf_of(client).reset())
