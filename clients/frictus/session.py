"""Zenoh sessions as frictus needs them. A session is a context manager: always close it."""

import json
import re
from collections.abc import Mapping, Sequence
from typing import Final, cast

import zenoh
import zenoh.ext

from frictus.errors import ArgumentError, CertificateError, LinkError
from frictus.keys import Topic
from frictus.reception import Declared, OnSample
from frictus.tls import SCHEME, Tls, why_refused

DENIED: Final = (
    "; or the router does not allow it to the role in your certificate: only a controller may "
    "command a rig (`frictus pki show FILE` tells the role)"
)
"""Where a call was not answered."""
UNKNOWN: Final = (
    "; or the router does not know the name in your certificate: put the certificate, not its "
    "key, into the router's folder of members, and start the router again"
)
"""Where nobody is present."""


def if_secured(session: zenoh.Session, hint: str) -> str:
    """Return what to add; empty without certificates.

    Parameters
    ----------
    session : zenoh.Session
        Open session.
    hint : str
        `DENIED` or `UNKNOWN`.
    """
    secured = any(str(link.dst).startswith(SCHEME) for link in session.info.links())
    return hint if secured else ""


DEFAULT_ROUTER: Final = "tcp/127.0.0.1:7447"
_ENDPOINT: Final = re.compile(r"(tcp|tls)/.+:[0-9]+")
LEASE_MS: Final = 1_000  # a frozen peer's token falls after 0.75 s instead of 9.5 s
PATIENT_LEASE_MS: Final = 4_000
"""For the router, and for who only reads. A busy machine sets a process aside for longer than a
second: what comes meanwhile is kept, but what comes while a link is made anew is lost."""
QUEUE: Final = 16  # the default of 2 loses messages under load
PRIORITIES: Final = ("real_time", "interactive_high", "data_high", "data")


def _config(
    mode: str,
    listen: list[str],
    connect: list[str],
    timeout_s: float,
    lease_ms: int = LEASE_MS,
) -> zenoh.Config:
    config = zenoh.Config()
    settings = {
        "mode": mode,
        "listen/endpoints": listen,
        "connect/endpoints": connect,
        "connect/timeout_ms": int(1_000 * timeout_s),
        "connect/exit_on_failure": True,
        # No scouting: parts meet at the router that the configuration names, never by chance.
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "scouting/delay": 0,  # a router would wait half a second for what we never look for
        "timestamping/enabled": True,  # without it samples carry no time and caches no history
        "transport/shared_memory/enabled": False,  # no gain at these sizes, leaves files behind
        "transport/link/tx/lease": lease_ms,
        "transport/link/tx/queue/size": dict.fromkeys(PRIORITIES, QUEUE),
    }
    for key, value in settings.items():
        config.insert_json5(key, json.dumps(value))
    return config


def _secure(config: zenoh.Config, endpoint: str, tls: Tls | None, side: str) -> None:
    """Have `config` present certificates as the `side` that listens or connects."""
    if (tls is not None) != endpoint.startswith(SCHEME):
        raise CertificateError(
            f"{endpoint} and certificates: give both a {SCHEME}HOST:PORT endpoint and "
            "certificates (`tls`, or [security] in the configuration), or neither"
        )
    if tls is None:
        return
    settings = {
        "root_ca_certificate": str(tls.authority),
        f"{side}_certificate": str(tls.certificate),
        f"{side}_private_key": str(tls.key),
        "enable_mtls": True,
        "verify_name_on_connect": True,
        "close_link_on_expiration": True,
    }
    # Zenoh would try an expired one until the time is up, or listen with it and refuse all.
    tls.name(listens=side == "listen")
    config.insert_json5("transport/link/tls", json.dumps(settings))
    config.insert_json5("transport/link/protocols", '["tls"]')


def open_router(
    endpoint: str = DEFAULT_ROUTER,
    tls: Tls | None = None,
    access: Mapping[str, object] | None = None,
    links: Sequence[str] = (),
) -> zenoh.Session:
    """Host a router in this process, listening at `endpoint`.

    Parameters
    ----------
    endpoint : str
        Zenoh endpoint, such as ``tcp/0.0.0.0:7447`` for all interfaces.
    tls : Tls or None
        The router's certificate; every client must present one of the same authority.
    access : mapping or None
        Zenoh's ``access_control``: who may do what.
    links : sequence of str
        Endpoints of other routers, without certificates: together they are one network, which
        forms as they come, in any order, and again after each has been gone.

    Raises
    ------
    LinkError
        If nothing can listen there.
    CertificateError
        If the certificate cannot be used.
    """
    config = _config("router", [endpoint], list(links), 1.0, PATIENT_LEASE_MS)
    if links:
        config.insert_json5("connect/exit_on_failure", "false")
        config.insert_json5("connect/timeout_ms", "-1")  # tries for ever, beside all else
    _secure(config, endpoint, tls, "listen")
    if access is not None:
        config.insert_json5("access_control", json.dumps(access))
    try:
        return _opened(config)
    except zenoh.ZError as error:
        reason = re.sub(r" at \S+\.rs:\d+\.?", "", str(error))  # no lines of Zenoh's source
        raise LinkError(
            f"cannot listen at {endpoint}: {reason}. If another router runs there, end it, or "
            "give `endpoint` in [router] of the configuration another port"
        ) from error


def open_session(
    router: str = DEFAULT_ROUTER,
    timeout_s: float = 3.0,
    tls: Tls | None = None,
    lease_ms: int = LEASE_MS,
) -> zenoh.Session:
    """Open a client session to the router at `router`.

    Parameters
    ----------
    router : str
        Zenoh endpoint, such as ``tcp/192.168.1.10:7447``.
    timeout_s : float
        How long to try.
    tls : Tls or None
        Our certificate, where the router asks for one.
    lease_ms : int
        How long the router waits for a sign of life before it drops the link, and our
        liveliness tokens with it; see `PATIENT_LEASE_MS`.

    Raises
    ------
    ArgumentError
        If `router` is no such endpoint.
    LinkError
        If no router answers there.
    CertificateError
        If our certificate or the router's is refused.
    """
    if not _ENDPOINT.match(router):
        raise ArgumentError(
            f"router {router!r}: tcp/HOST:PORT is accepted, such as {DEFAULT_ROUTER}, or "
            "tls/HOST:PORT with certificates"
        )
    config = _config("client", [], [router], timeout_s, lease_ms)
    _secure(config, router, tls, "connect")
    try:
        session = _opened(config)
    except zenoh.ZError as error:
        _explain_refusal(router, tls, timeout_s)
        raise LinkError(
            f"no router answers at {router} within {timeout_s:g} s. "
            "Is `frictus serve` running there"
            + ("?" if tls else ", and does it do without certificates (tcp, not tls)?")
        ) from error
    # open() may succeed without a link, after a refused certificate for example.
    if not session.info.transports():
        session.close()  # type: ignore[no-untyped-call]
        _explain_refusal(router, tls, timeout_s)
        raise LinkError(f"connected to {router}, but it gave no transport: check certificates")
    return session


def _opened(config: zenoh.Config) -> zenoh.Session:
    try:
        return zenoh.open(config)
    except BaseException as error:
        # What Rust panics with derives from no Exception, and can be told by its name only.
        if type(error).__name__ != "PanicException":
            raise
        raise LinkError(
            f"Zenoh cannot start here: {error}. It needs memory and some ten threads: look at "
            "the limits of this process (ulimit -a)"
        ) from error


def _explain_refusal(router: str, tls: Tls | None, timeout_s: float) -> None:
    why = why_refused(router, tls, timeout_s) if tls is not None else ""
    if why:
        raise CertificateError(
            f"{router} refused the connection: {why}. `frictus pki show FILE` tells whose a "
            "certificate is, in which role, and until when; `frictus pki issue` makes a new one"
        )


def declare_reader(
    session: zenoh.Session, key: str, topic: Topic, callback: OnSample
) -> Declared:
    """Declare a subscriber; where the topic is cached, the present value comes first.

    Parameters
    ----------
    session : zenoh.Session
        Open session.
    key : str
        Full key.
    topic : Topic
        Its row in the table of keys.
    callback : zenoh.handlers.Callback
        Must only enqueue.
    """
    if not topic.latest:
        return cast(Declared, session.declare_subscriber(key, callback))
    history = zenoh.ext.HistoryConfig(detect_late_publishers=True, max_samples=1)
    subscriber = zenoh.ext.declare_advanced_subscriber(session, key, callback, history=history)
    return cast(Declared, subscriber)


def declare_publisher(session: zenoh.Session, key: str, topic: Topic) -> zenoh.Publisher:
    """Declare a plain publisher with the service that the table of keys gives the topic.

    Parameters
    ----------
    session : zenoh.Session
        Open session.
    key : str
        Full key.
    topic : Topic
        Its row in the table of keys.
    """
    qos = topic.qos
    return session.declare_publisher(
        key,
        priority=getattr(zenoh.Priority, qos.priority),
        congestion_control=(
            zenoh.CongestionControl.BLOCK if qos.block else zenoh.CongestionControl.DROP
        ),
        express=qos.express,
        reliability=zenoh.Reliability.RELIABLE,
    )


def is_read(publisher: zenoh.Publisher) -> bool:
    """Return whether anybody subscribes; what nobody reads need not be packed either.

    Known within a millisecond of a subscription, at the same time as `put` knows it.

    Parameters
    ----------
    publisher : zenoh.Publisher
        As `declare_publisher` returns it.
    """
    return bool(publisher.matching_status.matching)  # type: ignore[attr-defined]


def declare_latest_publisher(
    session: zenoh.Session, key: str, topic: Topic
) -> zenoh.ext.AdvancedPublisher:
    """Declare a publisher whose last value late joiners get: for topics marked `latest`.

    Parameters
    ----------
    session : zenoh.Session
        The rig's session.
    key : str
        Full key.
    topic : Topic
        Its row in the table of keys.
    """
    qos = topic.qos
    return zenoh.ext.declare_advanced_publisher(
        session,
        key,
        priority=getattr(zenoh.Priority, qos.priority),
        congestion_control=(
            zenoh.CongestionControl.BLOCK if qos.block else zenoh.CongestionControl.DROP
        ),
        express=qos.express,
        cache=zenoh.ext.CacheConfig(max_samples=1),
        publisher_detection=True,  # so that a subscriber that came first asks again
    )
