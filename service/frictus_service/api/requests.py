"""What a request brings: its body, what it was made of, and whether it comes again."""

import asyncio
import math
import re
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Annotated, Any, Final, Literal, TypeVar

from fastapi import Depends, Header, Request, Response
from pydantic import BaseModel, TypeAdapter, ValidationError
from pydantic_core import from_json
from starlette.requests import ClientDisconnect

from frictus.names import Matching
from frictus_service.api.limits import LARGE_BYTES, RequestLimits, address_of
from frictus_service.api.problems import (
    ConflictError,
    GoneError,
    InvalidError,
    Place,
    PreconditionRequiredError,
    SlowBodyError,
    TooLargeError,
    UnsupportedMediaError,
    places,
)
from frictus_service.api.services import services
from frictus_service.json_text import without_mark
from frictus_service.registry.database import Once

T = TypeVar("T")
JSON: Final = "application/json"
MAX_PLACES: Final = 100
MAX_FAULTS: Final = 10_000
"""With more, none is listed: a list of them would be larger than the body."""
MOST: Final = {(b"[", b"{"): 100_000, (b",",): 2_000_000}
"""Most lists and objects, and most values, counted before anything is parsed: 10 MB of empty
lists would take half a gigabyte."""
BODY_S: Final = 10.0
SLOWEST_BYTES_S: Final = 100_000
"""A body may take `BODY_S`, and as long as it takes at this rate."""
# A number overflows by an exponent of three digits, or by 200 digits before a smaller one.
_MAYBE_NOT_FINITE: Final = re.compile(rb"NaN|Infinity|[eE]\+?0*[1-9]\d\d|\d{200}")


def media_type(request: Request) -> str:
    """Return the content type without its parameters; empty if there is none."""
    return request.headers.get("content-type", "").partition(";")[0].strip().lower()


async def raw_body(request: Request) -> AsyncIterator[bytes]:
    """Give the whole body of a command; a dependency. As `large_body`, but smaller."""
    async with _body(request, services(request).config.limits.max_payload_bytes) as body:
        yield body


async def large_body(request: Request) -> AsyncIterator[bytes]:
    """Give the whole body of a scene or a texture; a dependency.

    Reading stops as soon as the body is too large, whatever Content-Length says. Bodies share
    a bounded memory, and few large ones are parsed at once.

    Raises
    ------
    TooLargeError
        If it is larger than the rigs take scenes.
    SlowBodyError
        If it does not come in time.
    BusyError
        If there are too many at once.
    """
    async with _body(request, services(request).config.limits.max_scene_bytes) as body:
        yield body


@asynccontextmanager
async def _body(request: Request, limit_bytes: int) -> AsyncIterator[bytes]:
    limits: RequestLimits = request.app.state.limits
    announced = request.headers.get("content-length", "")
    most = int(announced[:20]) if announced.isdecimal() else limit_bytes
    if most > limit_bytes:
        raise _too_large(limit_bytes)
    with limits.bodies.held(address_of(request), most):
        allowed_s = BODY_S + most / SLOWEST_BYTES_S
        try:
            async with asyncio.timeout(allowed_s):
                body = await _read(request, limit_bytes)
        except TimeoutError:
            told = f"a body of up to {most} bytes is to come within {allowed_s:.0f} s"
            raise SlowBodyError(told, headers={"Connection": "close"}) from None
        except ClientDisconnect:
            raise GoneError("the connection ended before the body did") from None
        if len(body) <= LARGE_BYTES:
            yield body
        else:
            async with limits.large:
                yield body


async def _read(request: Request, limit_bytes: int) -> bytes:
    body = bytearray()
    async for chunk in request.stream():
        body += chunk
        if len(body) > limit_bytes:
            raise _too_large(limit_bytes)
    return bytes(body)


def require_media(request: Request, *accepted: str) -> str:
    """Return the content type.

    Raises
    ------
    UnsupportedMediaError
        If it is none of `accepted`, or the body is packed.
    """
    if (coding := request.headers.get("content-encoding", "identity").lower()) != "identity":
        raise UnsupportedMediaError(
            f"Content-Encoding {coding[:40]}: send the body as it is, not packed",
            headers={"Accept-Encoding": "identity"},
        )
    if (given := media_type(request)) not in accepted:
        raise UnsupportedMediaError(
            f"Content-Type {given or 'missing'}: send {' or '.join(accepted)}",
            headers={"Accept": ", ".join(accepted)},
        )
    return given


def parse_json(
    adapter: TypeAdapter[T], body: bytes, extra: Literal["forbid", "allow"] | None = "forbid"
) -> T:
    """Return what a JSON body holds.

    Types are not converted, numbers must be finite everywhere, and unknown fields are refused
    unless `extra` allows them (documents that are carried on with what newer writers add), or
    is None and the type itself does.

    Raises
    ------
    InvalidError
        With the place of every fault.
    """
    body = without_mark(body)
    for what, most in MOST.items():
        count = sum(body.count(byte) for byte in what)
        if count > most:
            raise InvalidError(f"the body has {count} of {what}: at most {most} are read here")
    try:
        faults = _not_finite(from_json(body)) if _MAYBE_NOT_FINITE.search(body) else []
    except ValueError as error:
        raise InvalidError(f"the body is not JSON: {error}") from error
    if faults:
        raise InvalidError("numbers must be finite (no NaN, no infinity, no 1e999)", faults)
    try:
        return adapter.validate_json(body, strict=True, extra=extra)
    except ValidationError as error:
        if error.error_count() > MAX_FAULTS:
            raise InvalidError(f"the body has {error.error_count()} faults") from None
        first = error.errors(include_url=False, include_input=False)[0]
        if first["type"] == "json_invalid":
            raise InvalidError(f"the body is not JSON: {first['ctx']['error']}") from error
        found = places(error.errors(include_url=False, include_input=False), ("body",))
        raise InvalidError(f"the body has {len(found)} fault(s), see errors", found) from error


def json_body(
    kind: type[BaseModel], extra: Literal["forbid", "allow"] | None = "forbid"
) -> Any:
    """Return the dependency that gives what a JSON body holds, as `parse_json` reads it.

    Parameters
    ----------
    kind : type
        What is accepted.
    extra : str or None
        What becomes of unknown fields.
    """
    adapter = TypeAdapter(kind)

    def read(request: Request, body: Annotated[bytes, Depends(raw_body)]) -> BaseModel:
        require_media(request, JSON)
        return parse_json(adapter, body, extra)

    return Depends(read)


def body_of(kind: type[BaseModel]) -> dict[str, object]:
    """Return the entry of the OpenAPI page for a body that is read by `parse_json`."""
    schema = kind.model_json_schema(ref_template="#/components/schemas/{model}")
    schema.pop("$defs", None)
    return {"requestBody": {"required": True, "content": {JSON: {"schema": schema}}}}


def _not_finite(document: Any) -> list[Place]:
    found: list[Place] = []
    waiting: list[tuple[list[str | int], Any]] = [([], {"body": document})]
    while waiting and len(found) < MAX_PLACES:
        where, holder = waiting.pop()
        for key, value in holder.items() if isinstance(holder, dict) else enumerate(holder):
            if isinstance(value, float):
                if not math.isfinite(value):
                    what = f"{value} is not a finite number"
                    found.append(Place(where=[*where, key], what=what))
            elif isinstance(value, dict | list):
                waiting.append(([*where, key], value))
    return found[:MAX_PLACES]


def _too_large(limit_bytes: int) -> TooLargeError:
    return TooLargeError(f"the body is larger than the {limit_bytes} bytes that are read here")


_TAG: Final = r'(W/)?"([\x21\x23-\x7e\x80-\xff]*)"'
_TAGS: Final = rf"{_TAG}( *, *{_TAG})*"
_HEADER: Final = {"pattern": rf"^(\*|{_TAGS})$", "minLength": 1}
IfMatch = Annotated[
    str | None,
    Header(description="ETag of what is replaced; * for any", json_schema_extra={**_HEADER}),
]
IfNoneMatch = Annotated[
    str | None,
    Header(description="ETag of the copy that you have", json_schema_extra={**_HEADER}),
]
Create = Annotated[
    str | None,
    Header(
        alias="If-None-Match",
        description="* to make a new one",
        json_schema_extra={"const": "*"},
    ),
]


def quoted(etag: str) -> str:
    """Return an etag as it stands in a header."""
    return f'"{etag}"'


def not_modified(if_none_match: str | None, etag: str, response: Response) -> Response | None:
    """Put the etag on a response; return the 304 that goes instead if the copy is current.

    Parameters
    ----------
    if_none_match : str or None
        The header.
    etag : str
        What stands there now.
    response : Response
        Of the document itself.
    """
    response.headers["ETag"] = quoted(etag)
    if if_none_match is None:
        return None
    tags = _tags(if_none_match, "If-None-Match")
    if tags is None or any(tag == etag for _, tag in tags):
        return Response(status_code=304, headers={"ETag": quoted(etag)})
    return None


def required_match(if_match: str | None, etag: str) -> str:
    """Return the etag that is to be replaced; ``*`` where the caller accepts any.

    Parameters
    ----------
    if_match : str or None
        The header.
    etag : str
        What stands there now.

    Raises
    ------
    PreconditionRequiredError
        If there is no header.
    ConflictError
        If the header names others only.
    """
    if if_match is None:
        raise PreconditionRequiredError(
            "say which version is replaced: If-Match with the ETag of a GET, or * for any"
        )
    tags = _tags(if_match, "If-Match")
    if tags is None:
        return "*"
    if not any(tag == etag and not weak for weak, tag in tags):  # strong comparison
        raise ConflictError(f"it has changed: its ETag is now {quoted(etag)}; read it again")
    return etag


def _tags(header: str, name: str) -> list[tuple[bool, str]] | None:
    """Return (weak, tag) of each; None for ``*``, any."""
    if header.strip() == "*":
        return None
    if not re.fullmatch(_TAGS, header.strip()):
        raise InvalidError(
            f'{name} {header[:100]!r}: "etag" in quotes, several with commas, or *'
        )
    return [(weak != "", tag) for weak, tag in re.findall(_TAG, header)]


IdempotencyKey = Annotated[
    Annotated[str, Matching(r"^[\x21-\x7e]+$", "visible ASCII characters are accepted")] | None,
    Header(
        min_length=1,
        max_length=200,
        description="A new one for each request; the same again gets the same answer",
    ),
]


def once_of(request: Request, key: str | None, by: str, body: bytes) -> Once | None:
    """Return what identifies a request; None where it bears no key.

    Parameters
    ----------
    request : Request
        As FastAPI gives it.
    key : str or None
        The header.
    by : str
        Who asks: keys of others are not known to them, and are refused.
    body : bytes
        Of the request.
    """
    if key is None:
        return None
    content = (request.method.encode(), request.url.path.encode(), by.encode(), body)
    return Once.of(key, *content)
