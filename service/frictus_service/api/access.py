"""Who may do what: bearer tokens and their scopes."""

import ipaddress
from collections.abc import Awaitable, Callable, Collection
from typing import Annotated, Final

from fastapi import Depends, Header, Request
from fastapi.security import HTTPAuthorizationCredentials, HTTPBearer

from frictus_service.api.problems import MissingScopeError, UnauthenticatedError
from frictus_service.api.services import PAGE_HEADER, services
from frictus_service.config import LOCAL, Scope, Token

_BEARER: Final = HTTPBearer(auto_error=False, description="A token of [[api.tokens]]")
_REALM: Final = 'Bearer realm="frictus"'


def is_loopback(name: str) -> bool:
    """Return whether a host name or address can only mean this machine."""
    if name == "localhost":
        return True
    try:
        return ipaddress.ip_address(name).is_loopback
    except ValueError:
        return False


def needs(scope: Scope) -> Callable[..., Awaitable[str]]:
    """Return the dependency that lets requests with `scope` through, and says whose they are.

    Without any token configured (then the server is bound to loopback) every request passes,
    as one of `LOCAL`. A scope implies no other.
    """

    async def check(
        request: Request,
        given: Annotated[HTTPAuthorizationCredentials | None, Depends(_BEARER)],
    ) -> str:
        tokens = services(request).config.api.tokens
        if not tokens:
            return LOCAL
        if given is None:
            raise UnauthenticatedError(
                "send the header Authorization: Bearer TOKEN",
                headers={"WWW-Authenticate": _REALM},
            )
        token = find(given.credentials, tokens)
        if token is None:
            raise UnauthenticatedError(
                "the token is not known here",
                headers={"WWW-Authenticate": f'{_REALM}, error="invalid_token"'},
            )
        if scope not in token.scopes:
            challenge = f'{_REALM}, error="insufficient_scope", scope="{scope}"'
            raise MissingScopeError(
                f"this needs the scope {scope!r}; the token {token.name!r} has "
                f"{', '.join(sorted(token.scopes))}",
                headers={"WWW-Authenticate": challenge},
            )
        return token.name

    return check


def has(scope: Scope) -> Callable[..., Awaitable[bool]]:
    """Return the dependency that says whether whoever asks has `scope`; all pass."""

    async def check(
        request: Request,
        given: Annotated[HTTPAuthorizationCredentials | None, Depends(_BEARER)],
    ) -> bool:
        tokens = services(request).config.api.tokens
        token = None if given is None else find(given.credentials, tokens)
        return not tokens or (token is not None and scope in token.scopes)

    return check


def acts_as(scope: Scope) -> Callable[..., Awaitable[str]]:
    """Return the dependency that lets requests with `scope` through, and names their client.

    Rigs know whoever asks by that name.
    """

    async def name(
        request: Request,
        person: Annotated[str, Depends(needs(scope))],
        page: Annotated[
            str | None,
            Header(alias=PAGE_HEADER, max_length=64, description="Key of a connected page"),
        ] = None,
    ) -> str:
        return services(request).pages.client_of(person, page)

    return name


def find(given: str, tokens: Collection[Token]) -> Token | None:
    """Return the token that was given; None if it is none of `tokens`.

    Parameters
    ----------
    given : str
        As it was presented.
    tokens : collection of Token
        Those of the configuration.
    """
    matching = [token for token in tokens if token.matches(given)]  # all: no timing tells which
    return matching[0] if matching else None
