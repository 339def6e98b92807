"""Paths of the registry's models: versions, aliases, comparison, audit, downloads."""

from typing import Annotated, Any, Final, Literal

from fastapi import APIRouter, Depends, Path, Query, Request, Response
from pydantic import BaseModel, ConfigDict, Field

from frictus import names
from frictus.model import Model
from frictus_service.api import problems
from frictus_service.api.access import needs
from frictus_service.api.requests import (
    JSON,
    Create,
    IdempotencyKey,
    IfMatch,
    IfNoneMatch,
    body_of,
    json_body,
    not_modified,
    once_of,
    quoted,
    raw_body,
    required_match,
)
from frictus_service.api.services import Given
from frictus_service.errors import AliasConflictError, UnknownModelError
from frictus_service.registry import documents
from frictus_service.registry.aliases import Aliases
from frictus_service.registry.comparison import Comparison, compare
from frictus_service.registry.documents import Alias, Audit, Published, VersionPage

_OF_NAMES: Final = {"pattern": f"^{documents.NAME}$"}
_OF_REFERENCES: Final = {"pattern": f"^{documents.REFERENCE}$"}
Reference = Annotated[
    str,
    Path(
        max_length=200,
        description="NAME, NAME@VERSION or NAME@ALIAS; rig1/P01@3",
        json_schema_extra={**_OF_REFERENCES},
    ),
]
Name = Annotated[
    str,
    Path(
        max_length=200,
        description="Name of a model, such as rig1/P01",
        json_schema_extra={**_OF_NAMES},
    ),
]
Compared = Annotated[
    str,
    Query(
        max_length=200,
        description="Reference, such as rig1/P01@1",
        json_schema_extra={**_OF_REFERENCES},
    ),
]
AliasName = Annotated[
    str,
    Path(
        max_length=64,
        description="Such as production",
        json_schema_extra={"pattern": f"^{documents.ALIAS}$"},
    ),
]
Text = Annotated[str, Field(max_length=1_000)]

MATLAB: Final = "application/x-matlab-data"
_READ: Final = (
    problems.UnauthenticatedError,
    problems.MissingScopeError,
    problems.InvalidError,
    problems.ModelNotFoundError,
    problems.NoRegistryError,
)
_WRITE: Final = (*_READ, problems.TooLargeError, problems.UnsupportedMediaError)
_CURRENT: Final[dict[int | str, dict[str, Any]]] = {
    304: {"description": "Your copy is current"}
}
router = APIRouter(prefix="/v1/models", tags=["models"])


class NewVersion(BaseModel):
    """A model to be published."""

    model_config = ConfigDict(extra="forbid")

    name: Annotated[
        str,
        Field(
            max_length=200,
            description="population, or rig1/P01",
            json_schema_extra={**_OF_NAMES},
        ),
    ]
    rig: Annotated[names.Name | None, Field(None)]
    """On which it was measured."""
    comment: Text = ""
    model: Model


class AliasTarget(BaseModel):
    """Where an alias shall stand."""

    version: Annotated[int, Field(ge=1, le=999_999_999)]
    reason: Text = ""


class AliasList(BaseModel):
    """The aliases of a model, sorted."""

    aliases: list[Alias]


@router.get("", dependencies=[Depends(needs("read"))], responses=problems.documented(*_READ))
def list_models(
    given: Given,
    name: Annotated[str | None, Query(max_length=200)] = None,
    participant: Annotated[str | None, Query(max_length=64)] = None,
    rig: Annotated[str | None, Query(max_length=64)] = None,
    response: Literal["friction", "mobility"] | None = None,
    population: Annotated[
        bool | None, Query(description="true: of no participant; false: of participants")
    ] = None,
    newest: Annotated[bool, Query(description="The newest version of each name only")] = False,
    after: Annotated[
        int, Query(ge=0, le=2**31 - 1, description="`next` of the page before")
    ] = 0,
    limit: Annotated[int, Query(ge=1, le=1_000)] = 100,
) -> VersionPage:
    """List published versions, newest first."""
    return given.registry.find(
        name=name,
        participant=participant,
        rig=rig,
        response=response,
        population=population,
        newest=newest,
        after=after,
        limit=limit,
    )


@router.post(
    "",
    status_code=201,
    responses=problems.documented(*_WRITE, problems.IdempotencyKeyReusedError),
    openapi_extra=body_of(NewVersion),
)
def publish_model(
    given: Given,
    by: Annotated[str, Depends(needs("calibrate"))],
    request: Request,
    response: Response,
    body: Annotated[bytes, Depends(raw_body)],
    new: Annotated[NewVersion, json_body(NewVersion, extra=None)],
    idempotency_key: IdempotencyKey = None,
) -> Published:
    """Publish a model as the next version of its name; it never changes afterwards.

    With an `Idempotency-Key` the request may be sent again, after a crash of either side too:
    it gets the first one's answer.
    """
    published = given.registry.publish(
        new.model,
        new.name,
        by=by,
        rig=new.rig,
        comment=new.comment,
        once=once_of(request, idempotency_key, by, body),
    )
    response.headers["Location"] = f"/v1/models/{published.reference}"
    return published


@router.get(
    "/compare",
    dependencies=[Depends(needs("read"))],
    responses=problems.documented(*_READ),
)
def compare_models(
    given: Given,
    a: Compared,
    b: Compared,
) -> Comparison:
    """Set two models side by side: parameters, cutoff by speed, intervals, origin."""
    return compare(given.registry.get(a), given.registry.get(b))


@router.get(
    "/{reference:path}/model.json",
    dependencies=[Depends(needs("read"))],
    response_model=Model,
    responses=problems.documented(*_READ) | _CURRENT,
)
def download_json(
    reference: Reference, given: Given, response: Response, if_none_match: IfNoneMatch = None
) -> Response:
    """Return the `model/1` document as it was published; a rig names it by the same ETag."""
    published = given.registry.get(reference)
    current = not_modified(if_none_match, published.etag, response)
    return current or Response(
        published.model.to_json(), headers=dict(response.headers), media_type=JSON
    )


@router.get(
    "/{reference:path}/model.mat",
    dependencies=[Depends(needs("read"))],
    response_class=Response,
    responses=problems.documented(*_READ) | _CURRENT | {200: {"content": {MATLAB: {}}}},
)
def download_mat(
    reference: Reference, given: Given, response: Response, if_none_match: IfNoneMatch = None
) -> Response:
    """Return the model as a MATLAB file; `docs/registry.md` lists its variables."""
    from frictus_service.registry.documents import to_mat

    published = given.registry.get(reference)
    file = f"{published.name.replace('/', '-')}-{published.version}.mat"
    headers = {"Content-Disposition": f'attachment; filename="{file}"'}
    current = not_modified(if_none_match, f"{published.etag}-mat", response)
    headers |= {"ETag": response.headers["ETag"]}
    return current or Response(to_mat(published), headers=headers, media_type=MATLAB)


@router.get(
    "/{name:path}/aliases",
    dependencies=[Depends(needs("read"))],
    responses=problems.documented(*_READ),
)
def list_aliases(name: Name, given: Given) -> AliasList:
    """List the aliases of a model."""
    given.registry.get(name)  # 404 where nothing was published under this name
    return AliasList(aliases=given.registry.aliases.of(name))


@router.get(
    "/{name:path}/aliases/{alias}",
    dependencies=[Depends(needs("read"))],
    response_model=Alias,
    responses=problems.documented(*_READ) | _CURRENT,
)
def get_alias(
    name: Name,
    alias: AliasName,
    given: Given,
    response: Response,
    if_none_match: IfNoneMatch = None,
) -> Alias | Response:
    """Return where an alias stands, with the ETag that moving it takes."""
    found = _alias(given.registry.aliases, name, alias)
    return not_modified(if_none_match, found.etag, response) or found


@router.put(
    "/{name:path}/aliases/{alias}",
    responses=problems.documented(
        *_WRITE, problems.ConflictError, problems.PreconditionRequiredError
    )
    | {201: {"model": Alias}},
    openapi_extra=body_of(AliasTarget),
)
def move_alias(
    name: Name,
    alias: AliasName,
    given: Given,
    by: Annotated[str, Depends(needs("admin"))],
    response: Response,
    target: Annotated[AliasTarget, json_body(AliasTarget)],
    if_match: IfMatch = None,
    create: Create = None,
) -> Alias:
    """Make an alias (`If-None-Match: *`) or move it (`If-Match`); the audit keeps who, why."""
    replaces = _replaced(given.registry.aliases, name, alias, if_match, create)
    moved = given.registry.aliases.move(
        name, alias, target.version, by=by, reason=target.reason, replaces=replaces
    )
    response.headers["ETag"] = quoted(moved.etag)
    if moved.revision == 1:
        response.status_code = 201
        response.headers["Location"] = f"/v1/models/{name}/aliases/{alias}"
    return moved


@router.get(
    "/{name:path}/audit",
    dependencies=[Depends(needs("read"))],
    responses=problems.documented(*_READ),
)
def get_audit(
    name: Name, given: Given, limit: Annotated[int, Query(ge=1, le=1_000)] = 100
) -> Audit:
    """Return who moved which alias, and which rigs were given a version; newest first."""
    given.registry.get(name)
    return Audit(
        name=name,
        moves=given.registry.aliases.moves(name, limit),
        activations=given.registry.activations.of(name, limit),
    )


@router.get(
    "/{reference:path}",
    dependencies=[Depends(needs("read"))],
    responses=problems.documented(*_READ),
)
def get_model(reference: Reference, given: Given) -> Published:
    """Return a published version: of a number, of an alias, or the newest."""
    return given.registry.get(reference)


def _alias(aliases: Aliases, name: str, alias: str) -> Alias:
    found = aliases.get(name, alias)
    if found is None:
        raise UnknownModelError(f"no alias {name}@{alias} was made")
    return found


def _replaced(
    aliases: Aliases, name: str, alias: str, if_match: str | None, create: str | None
) -> str | None:
    """Return the etag to replace, ``*`` for any, None to make a new alias."""
    if create is not None:
        if create.strip() != "*" or if_match is not None:
            raise problems.InvalidError("send If-None-Match: * to make one, or If-Match alone")
        return None
    if if_match is None:
        raise problems.PreconditionRequiredError(
            "send If-None-Match: * to make a new alias, or If-Match with the ETag of the one "
            "that is moved (* for any)"
        )
    found = aliases.get(name, alias)
    if found is None:
        raise AliasConflictError(f"there is no alias {name}@{alias} to move")
    return required_match(if_match, found.etag)
