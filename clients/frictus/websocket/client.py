"""Connecting to the API of a service, and finding its rigs."""

import asyncio
import contextlib
import json
import ssl
import urllib.error
import urllib.request
from collections.abc import AsyncIterator
from http.client import HTTPException
from typing import Final

from frictus.errors import ArgumentError, LinkError, NoRigError, RefusedError
from frictus.messages import SafetyState
from frictus.websocket.messages import MAX_RATE_HZ
from frictus.websocket.opening import PATH, opened
from frictus.websocket.rig import AsyncRig
from frictus.websocket.session import Session

DEFAULT_URL: Final = "ws://127.0.0.1:8420"
STOP_S: Final = 10.0
MAX_REPLY_BYTES: Final = 65_536
_UNREADABLE: Final = (ValueError, LookupError, TypeError, HTTPException)


class _Rest:
    """The one request that goes by REST: whoever may look may stop."""

    def __init__(
        self, url: str, token: str | None, key: str, tls: ssl.SSLContext | None
    ) -> None:
        self._url = "http" + url.rstrip("/").removeprefix("ws")
        self._headers = {"Frictus-Page": key}
        if token is not None:
            self._headers["Authorization"] = f"Bearer {token}"
        self._tls = tls

    def stop(self, rig: str) -> SafetyState:
        """Stop a rig; blocks."""
        request = urllib.request.Request(
            f"{self._url}/v1/rigs/{rig}/stop", method="POST", headers=self._headers
        )
        try:
            with urllib.request.urlopen(request, timeout=STOP_S, context=self._tls) as reply:
                state: SafetyState = json.loads(reply.read(MAX_REPLY_BYTES))["state"]
                return state
        except urllib.error.HTTPError as error:
            with error, contextlib.suppress(*_UNREADABLE):
                problem = json.loads(error.read(MAX_REPLY_BYTES))
                raise RefusedError(str(problem["code"]), str(problem["detail"])) from None
            raise LinkError(f"stopping rig {rig!r} was answered with {error.code}") from None
        except (OSError, *_UNREADABLE) as error:
            raise LinkError(f"rig {rig!r} was not stopped over {self._url}: {error}") from None


class AsyncClient:
    """A connection to the rigs behind one API. Made by `connect`.

    It belongs to one event loop. Methods raise `LinkError` once the connection is lost; it is
    not opened again: whoever held a rig is to look before it goes on.

    Parameters
    ----------
    session : Session
        What its rigs share, connected.
    rest : _Rest
        Stops rigs.
    timeout_s : float
        Longest wait for an answer or for a first value.
    """

    def __init__(self, session: Session, rest: _Rest, timeout_s: float) -> None:
        welcome = session.connection.welcome
        self.name = welcome.client
        self.site = welcome.site
        self._session = session
        self._rest = rest
        self._timeout_s = timeout_s

    async def rigs(self) -> list[str]:
        """Return the names of the rigs that are present, sorted.

        A rig that appeared within the last milliseconds may still be missing.

        Raises
        ------
        LinkError
            If the service does not reach its router.
        """
        await self._session.await_rigs(lambda rigs: rigs.link, self._timeout_s)
        rigs = self._session.rigs
        if rigs is None or not rigs.link:
            raise LinkError("the service does not reach the router of the rigs")
        return list(rigs.rigs)

    async def rig(self, name: str, *, wait_s: float = 1.0) -> AsyncRig:
        """Return a rig that is present.

        Parameters
        ----------
        name : str
            Name of the rig.
        wait_s : float
            Longest wait for a rig that is only just starting.

        Raises
        ------
        NoRigError
            If it is not present; the text lists those that are.
        LinkError
            If the service does not reach its router.
        """
        await self.rigs()
        await self._session.await_rigs(lambda rigs: name in rigs.rigs, wait_s)
        present = await self.rigs()
        if name not in present:
            there = ", ".join(present) or "none"
            raise NoRigError(f"no rig {name!r} at site {self.site!r}; present: {there}")
        return AsyncRig(self._session, name, self._timeout_s, self._rest.stop)


@contextlib.asynccontextmanager
async def connect(
    url: str = DEFAULT_URL,
    token: str | None = None,
    *,
    rate_hz: float = MAX_RATE_HZ,
    timeout_s: float = 10.0,
    tls: ssl.SSLContext | None = None,
) -> AsyncIterator[AsyncClient]:
    """Connect to the API of a service within ``async with``; leaving it disarms.

    Parameters
    ----------
    url : str
        Of the service: ``ws://HOST:PORT``, or ``wss://`` behind a proxy that ends TLS.
    token : str or None
        One of the configuration; None where it has none.
    rate_hz : float
        Most frames of a stream, and messages of a kind, per second: 1 to 60.
    timeout_s : float
        Longest wait for each answer and for each first value.
    tls : ssl.SSLContext or None
        For ``wss://``; None: the certificates that this machine trusts.

    Raises
    ------
    ArgumentError
        If the address or the rate is none.
    ImportError
        If the package `websockets` is not installed.
    RefusedError
        If the token is not accepted.
    LinkError
        If no service of this protocol answers there.
    """
    if not url.startswith(("ws://", "wss://")):
        raise ArgumentError(f"{url!r}: ws://HOST:PORT or wss://HOST:PORT accepted")
    if not 1.0 <= rate_hz <= MAX_RATE_HZ:
        raise ArgumentError(f"rate_hz {rate_hz}: 1 to {MAX_RATE_HZ:g} accepted")
    url = url.rstrip("/").removesuffix(PATH)  # as other programs are given it
    session = Session(float(rate_hz))
    async with opened(url, token, tls, session.hear, session.fail) as connection:
        session.connection = connection
        watching = asyncio.create_task(session.watch_for_ever())
        try:
            key = connection.welcome.key
            yield AsyncClient(session, _Rest(url, token, key, tls), timeout_s)
        finally:
            watching.cancel()
            await asyncio.wait([watching])
