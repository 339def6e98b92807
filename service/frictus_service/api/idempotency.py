"""The header that lets a request be sent again without being carried out again."""

from typing import Annotated

from fastapi import Header, Request

from frictus_service.registry.once import Once

IdempotencyKey = Annotated[
    str | None,
    Header(
        min_length=1,
        max_length=200,
        pattern=r"^[\x21-\x7e]+$",
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
