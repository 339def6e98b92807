"""Conditional requests (RFC 9110, section 13): what a caller saw, and what it may replace."""

import re
from typing import Annotated, Final

from fastapi import Header, Response

from frictus_service.api.problems import ConflictError, InvalidError, PreconditionRequiredError

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
