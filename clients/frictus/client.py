"""Connecting to a network of rigs, and finding them."""

import atexit
import os
import secrets
import socket
from typing import Final, NamedTuple, cast

import zenoh

from frictus.calls import await_present, present_rigs
from frictus.closing import Closing, Held
from frictus.errors import ArgumentError, FrameError
from frictus.keys import RigKeys, any_rig_alive, rig_of
from frictus.mailbox import Arrival
from frictus.reception import Declared, Feed, OnSample
from frictus.rig import Rig
from frictus.session import DEFAULT_ROUTER, LEASE_MS, PATIENT_LEASE_MS, open_session
from frictus.tls import Tls

MAX_TIMEOUT_S: Final = 60.0
"""A request may be taken for so long after it was sent."""


class RigName(NamedTuple):
    """Where a rig stands and what it is called."""

    site: str
    name: str


class Presence(NamedTuple):
    """A rig appeared (`present`) or vanished."""

    rig: RigName
    present: bool


class Client(Closing):
    """A connection to the rigs behind one router. Made by `connect`; a context manager.

    All methods may be called from any thread.

    Parameters
    ----------
    session : zenoh.Session
        Open session; the client closes it.
    name : str
        Name of this client among all: letters, digits, ``-``, ``_`` and ``.``, at most 64.
    timeout_s : float
        Longest wait for a reply or for a first value.
    """

    def __init__(self, session: zenoh.Session, name: str, timeout_s: float) -> None:
        self.name = name
        self._session: zenoh.Session | None = session
        self._timeout_s = timeout_s
        self._rigs: dict[RigKeys, Rig] = {}
        self._held = Held()
        atexit.register(self.close)  # a program that ends without close() must still disarm

    @property
    def session(self) -> zenoh.Session:
        """The Zenoh session, for what this client does not cover.

        Raises
        ------
        RuntimeError
            If the client is closed.
        """
        if self._session is None:
            raise RuntimeError("this client is closed; connect again")
        return self._session

    def rigs(self, site: str = "*", wait_s: float = 2.0) -> list[RigName]:
        """Return the rigs that are present, sorted by site and name.

        A rig that appeared within the last milliseconds may still be missing; `presence`
        follows them.

        Parameters
        ----------
        site : str
            One site, or ``*`` for all.
        wait_s : float
            Longest wait for the router's answer; it usually takes milliseconds.

        Raises
        ------
        LinkError
            If the router is gone.
        """
        return [
            RigName(keys.site, keys.rig) for keys in present_rigs(self.session, site, wait_s)
        ]

    def presence(self, site: str = "*", *, timeout_s: float | None = None) -> Feed[Presence]:
        """Follow rigs as they appear and vanish, beginning with those already present.

        Parameters
        ----------
        site : str
            One site, or ``*`` for all.
        timeout_s : float or None
            Longest silence before `SilenceError`; None waits for ever.
        """
        liveliness = self.session.liveliness()

        def declare(callback: OnSample) -> Declared:
            subscriber = liveliness.declare_subscriber(
                any_rig_alive(site), callback, history=True
            )
            return cast(Declared, subscriber)

        return self._held.keep(Feed(declare, _presence, 1024, timeout_s))

    def rig(self, name: str, site: str = "lab", *, wait_s: float = 1.0) -> Rig:
        """Return a rig that is present.

        Parameters
        ----------
        name : str
            Name of the rig.
        site : str
            Its site.
        wait_s : float
            Longest wait for a rig that is only just starting.

        Raises
        ------
        NoRigError
            If it is not present; the text lists those that are.
        InvalidNameError
            If a rig or a site cannot have that name.
        LinkError
            If the router is gone.
        """
        keys = RigKeys(site, name)
        await_present(self.session, keys, wait_s)
        # In one step: of two that threads made at the same time one would never be closed.
        return self._rigs.setdefault(keys, Rig(self.session, keys, self.name, self._timeout_s))

    def close(self) -> None:
        """Disarm what is armed, end every feed and stream, and leave. Twice is harmless."""
        session, self._session = self._session, None
        if session is None:
            return
        atexit.unregister(self.close)
        with session:  # it goes too where a Ctrl-C ends the rest
            for rig in self._rigs.values():
                rig.close()
            self._held.close()


def _presence(arrival: Arrival) -> list[Presence]:
    try:
        keys = rig_of(arrival.key)
    except ValueError as error:  # somebody else's token
        raise FrameError(str(error)) from error
    return [Presence(RigName(keys.site, keys.rig), not arrival.deleted)]


def _own_name() -> str:
    host = "".join(letter if letter.isalnum() else "-" for letter in socket.gethostname())
    host = host.encode("ascii", "ignore").decode()[:40] or "client"
    return f"{host}-{os.getpid()}-{secrets.token_hex(3)}"


def connect(
    router: str = DEFAULT_ROUTER,
    name: str | None = None,
    *,
    timeout_s: float = 3.0,
    tls: Tls | None = None,
    patient: bool = False,
) -> Client:
    """Connect to the rigs behind a router.

    Parameters
    ----------
    router : str
        Zenoh endpoint, such as ``tcp/192.168.1.10:7447``.
    name : str or None
        Name of this client among all; made from host and process if None.
    timeout_s : float
        Longest wait for the router, for each reply and for each first value; up to 60.
    tls : Tls or None
        Our certificate, where `router` is a ``tls/`` endpoint.
    patient : bool
        Whether the link is kept while a busy machine sets the process aside for up to 4 s
        instead of 1 s, and what comes meanwhile is not lost. Not for a client that arms a real
        screen: that it has died is then known as much later.

    Raises
    ------
    ArgumentError
        If `router` is no endpoint, or `timeout_s` is not above 0 and up to 60 s.
    LinkError
        If no router answers there.
    CertificateError
        If our certificate or the router's is refused; the text says why.
    InvalidNameError
        If the name cannot stand in a key.
    """
    if not 0.0 < timeout_s <= MAX_TIMEOUT_S:
        raise ArgumentError(f"timeout_s {timeout_s}: above 0 and up to {MAX_TIMEOUT_S:g} s")
    name = _own_name() if name is None else name
    RigKeys("any", "any").client_alive(name)  # refuses a bad name before anything is opened
    lease_ms = PATIENT_LEASE_MS if patient else LEASE_MS
    return Client(open_session(router, timeout_s, tls, lease_ms), name, timeout_s)
