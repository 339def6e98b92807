"""Paths of the texture library."""

import pathlib
import tempfile
from typing import Annotated, Final, Literal

from fastapi import APIRouter, Depends, Path, Query, Request, Response
from pydantic import BaseModel, Field, FiniteFloat, TypeAdapter

from frictus.recordings import ImportedTexture, import_texture
from frictus.textures import Texture
from frictus_service.api import problems
from frictus_service.api.access import needs
from frictus_service.api.requests import (
    JSON,
    Create,
    IfMatch,
    IfNoneMatch,
    large_body,
    not_modified,
    parse_json,
    quoted,
    require_media,
    required_match,
)
from frictus_service.api.services import Given
from frictus_service.library import (
    NAME,
    DamagedTextureError,
    Entry,
    TextureConflictError,
    TextureLibrary,
    UnknownTextureError,
    check_name,
)

Name = Annotated[
    str, Path(description="Name of the texture", json_schema_extra={"pattern": f"^{NAME}$"})
]
Positive = Annotated[FiniteFloat, Field(gt=0.0)]

WAV: Final = ("audio/wav", "audio/x-wav", "audio/wave", "audio/vnd.wave")
CSV: Final = "text/csv"
EFFECTS: Final = {
    "haptics/x-ahap": "ahap",
    "haptics/x-haptic": "haptic",
    "haptics/hjif": "hjif",
    "haptics/hmpg": "hmpg",
}
"""Media types of effect files, and their suffixes; RFC 9695 registers the last two."""
_BINARY: Final = (WAV[0], "haptics/hmpg")
_TEXTURE: Final[TypeAdapter[Texture]] = TypeAdapter(Texture)
_READ: Final = (
    problems.UnauthenticatedError,
    problems.MissingScopeError,
    problems.InvalidError,
)
_ONE: Final = (*_READ, problems.TextureNotFoundError, problems.DamagedFileError)
_WRITE: Final = (
    *_ONE,
    problems.ReadOnlyError,
    problems.ConflictError,
    problems.TooLargeError,
    problems.UnsupportedMediaError,
    problems.PreconditionRequiredError,
    problems.NotStoredError,
)
_KINDS: Final = ("Spectrum", "Profile", "Beta", "Slope", "Map")
TEXTURE_SCHEMA: Final = {
    "oneOf": [{"$ref": f"#/components/schemas/{kind}"} for kind in _KINDS],
    "discriminator": {"propertyName": "kind"},
}
_BODY: Final = {
    "requestBody": {
        "required": True,
        "content": {
            JSON: {"schema": TEXTURE_SCHEMA},
            **{kind: {"schema": {"type": "object"}} for kind in EFFECTS},
            **{
                kind: {"schema": {"type": "string", "contentMediaType": kind}}
                for kind in (*_BINARY, CSV)
            },
        },
    }
}
router = APIRouter(prefix="/v1/textures", tags=["textures"])


class Recording(BaseModel):
    """How a recording or effect in the body was made; a JSON texture needs none of it."""

    recording_speed_mm_s: Annotated[Positive, Field(le=1_000.0)] | None = None
    """Speed of the finger or probe: time becomes position. An effect needs none."""
    sample_rate_hz: Annotated[Positive, Field(le=1e7)] | None = None
    """Rate of a CSV with one column; a WAV, and a CSV with times, bring theirs."""
    scale_n: Annotated[Positive, Field(le=1e6)] | None = None
    """N per unit of a CSV, or at full scale of a WAV or an effect; 1 where none is given."""
    channel: Annotated[int, Field(ge=0, le=1_000)] = 0
    """Channel of a WAV."""
    part_from_s: Annotated[FiniteFloat, Field(ge=0.0)] = 0.0
    """Where the part begins that becomes the texture."""
    part_to_s: Annotated[Positive, Field(le=1e6)] | None = None
    """Where it ends; a texture over time holds 10 s. Without, all of it is taken."""


class TextureSummary(BaseModel):
    """A texture without its content."""

    name: str
    shipped: bool = Field(description="Comes with the package; read-only")
    kind: Literal["spectrum", "profile", "beta", "slope", "map"] | None = None
    etag: str | None = None
    damaged: str | None = Field(None, description="Why the file does not hold a texture")
    notes: list[str] = Field([], description="What a recording or effect lost when it was put")


class TexturePage(BaseModel):
    """Some of the textures, sorted by name."""

    textures: list[TextureSummary]
    next: str | None = Field(None, description="`after` of the next page; null on the last")


@router.get("", dependencies=[Depends(needs("read"))], responses=problems.documented(*_READ))
def list_textures(
    given: Given,
    after: Annotated[str, Query(max_length=64, description="Begin behind this name")] = "",
    limit: Annotated[int, Query(ge=1, le=1_000)] = 100,
) -> TexturePage:
    """List the textures of the library, the shipped ones among them."""
    names = [name for name in given.library.names() if name > after]
    page = [found for name in names[:limit] if (found := _summary(given.library, name))]
    return TexturePage(textures=page, next=names[limit - 1] if len(names) > limit else None)


@router.get(
    "/{name}",
    dependencies=[Depends(needs("read"))],
    response_model=Texture,
    responses=problems.documented(*_ONE) | {304: {"description": "Your copy is current"}},
)
def get_texture(
    name: Name, given: Given, response: Response, if_none_match: IfNoneMatch = None
) -> Texture | Response:
    """Return a texture, as PUT takes it and as a region of a scene holds it."""
    entry = given.library.get(name)
    return not_modified(if_none_match, entry.etag, response) or entry.texture


@router.put(
    "/{name}",
    dependencies=[Depends(needs("render"))],
    responses=problems.documented(*_WRITE) | {201: {"model": TextureSummary}},
    openapi_extra=_BODY,
)
def put_texture(
    name: Name,
    given: Given,
    request: Request,
    response: Response,
    body: Annotated[bytes, Depends(large_body)],
    recording: Annotated[Recording, Query()],
    if_match: IfMatch = None,
    create: Create = None,
) -> TextureSummary:
    """Make a texture (`If-None-Match: *`) or replace one (`If-Match`).

    The body is a texture in JSON, a recording in WAV or CSV, or an effect (AHAP, .haptic,
    HJIF). A recording needs `recording_speed_mm_s`, the speed of the finger or probe, so that
    time becomes position; an effect without it repeats over time.
    """
    check_name(name)
    imported = _texture_in(request, body, recording, name)
    replaces = _replaced(given.library, name, if_match, create)
    entry = given.library.put(name, imported.texture, replaces)
    response.headers["ETag"] = quoted(entry.etag)
    if replaces is None:
        response.status_code = 201
        response.headers["Location"] = f"/v1/textures/{name}"
    return _summarised(entry, imported.notes)


@router.delete(
    "/{name}",
    dependencies=[Depends(needs("render"))],
    status_code=204,
    response_class=Response,
    responses=problems.documented(*_WRITE),
)
def delete_texture(name: Name, given: Given, if_match: IfMatch = None) -> None:
    """Delete a texture."""
    given.library.delete(name, required_match(if_match, _etag(given.library, name)))


def _texture_in(
    request: Request, body: bytes, recording: Recording, name: str
) -> ImportedTexture:
    given = require_media(request, JSON, CSV, *WAV, *EFFECTS)
    if given == JSON:
        return ImportedTexture(parse_json(_TEXTURE, body))
    if recording.recording_speed_mm_s is None and given not in EFFECTS:
        raise problems.InvalidError(
            "a recording needs the query parameter recording_speed_mm_s",
            [problems.Place(where=["query", "recording_speed_mm_s"], what="Field required")],
        )
    suffix = "csv" if given == CSV else EFFECTS.get(given, "wav")
    to_s = recording.part_to_s
    if recording.part_from_s > 0.0 and to_s is None:
        raise problems.InvalidError(
            "part_from_s goes with part_to_s",
            [problems.Place(where=["query", "part_to_s"], what="Field required")],
        )
    with tempfile.TemporaryDirectory(prefix="frictus-") as folder:
        # Refusals name the file.
        file = pathlib.Path(folder) / f"{name}.{suffix}"
        file.write_bytes(body)
        return import_texture(
            file,
            recording.recording_speed_mm_s,
            recording.sample_rate_hz,
            recording.scale_n,
            channel=recording.channel,
            part_s=None if to_s is None else (recording.part_from_s, to_s),
        )


def _replaced(
    library: TextureLibrary, name: str, if_match: str | None, create: str | None
) -> str | None:
    """Return the etag to replace, ``*`` for any, None to make a new texture."""
    if create is not None:
        if create.strip() != "*" or if_match is not None:
            raise problems.InvalidError("send If-None-Match: * to make one, or If-Match alone")
        return None
    if if_match is None:
        raise problems.PreconditionRequiredError(
            "send If-None-Match: * to make a new texture, or If-Match with the ETag of the "
            "one that is replaced (* for any)"
        )
    try:
        return required_match(if_match, _etag(library, name))
    except UnknownTextureError as error:
        raise TextureConflictError(f"there is no texture {name!r} to replace") from error


def _etag(library: TextureLibrary, name: str) -> str:
    try:
        return library.get(name).etag
    except DamagedTextureError:
        return ""  # no tag but * matches: a damaged file can be replaced knowingly


def _summary(library: TextureLibrary, name: str) -> TextureSummary | None:
    try:
        return _summarised(library.get(name))
    except UnknownTextureError:  # deleted since it was listed
        return None
    except DamagedTextureError as error:
        return TextureSummary(name=name, shipped=False, damaged=str(error))


def _summarised(entry: Entry, notes: tuple[str, ...] = ()) -> TextureSummary:
    return TextureSummary(
        name=entry.name,
        shipped=entry.shipped,
        kind=entry.texture.kind,
        etag=entry.etag,
        notes=list(notes),
    )
