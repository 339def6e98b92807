"""Request bodies, read strictly: bounded, typed, finite, and without unknown fields."""

import math
from typing import Any, Final, Literal, TypeVar

from fastapi import Request
from pydantic import TypeAdapter, ValidationError
from pydantic_core import from_json

from frictus_service.api.problems import (
    InvalidError,
    Place,
    TooLargeError,
    UnsupportedMediaError,
    places,
)
from frictus_service.api.services import services

T = TypeVar("T")
JSON: Final = "application/json"
MAX_PLACES: Final = 100


def media_type(request: Request) -> str:
    """Return the content type without its parameters; empty if there is none."""
    return request.headers.get("content-type", "").partition(";")[0].strip().lower()


async def raw_body(request: Request) -> bytes:
    """Return the whole body; a dependency.

    Reading stops as soon as the body is too large, whatever Content-Length says.

    Raises
    ------
    TooLargeError
        If it is larger than the rigs take scenes.
    """
    limit_bytes = services(request).config.limits.max_scene_bytes
    announced = request.headers.get("content-length", "")
    if announced.isdecimal() and int(announced[:20]) > limit_bytes:
        raise _too_large(limit_bytes)
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
        If it is none of `accepted`.
    """
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
    try:
        faults = _not_finite(from_json(body))
    except ValueError as error:
        raise InvalidError(f"the body is not JSON: {error}") from error
    if faults:
        raise InvalidError("numbers must be finite (no NaN, no infinity, no 1e999)", faults)
    try:
        return adapter.validate_json(body, strict=True, extra=extra)
    except ValidationError as error:
        found = places(error.errors(include_url=False, include_input=False), ("body",))
        raise InvalidError(f"the body has {len(found)} fault(s), see errors", found) from error


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
