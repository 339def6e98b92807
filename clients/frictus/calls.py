"""Calls to a rig: a JSON request with its age limit, one reply, refusals as errors."""

import contextlib
import queue
import time
from collections.abc import Iterable, Iterator
from math import ceil
from typing import Any, Final

import zenoh
from pydantic import ValidationError
from zenoh.handlers import Callback

from frictus.errors import (
    ArgumentError,
    FrameError,
    LinkError,
    NoRigError,
    OutcomeUnknownError,
    RefusedError,
    SilenceError,
    explain,
)
from frictus.keys import CALLS, RECORDER_CALLS, RigKeys, any_rig_alive, rig_of
from frictus.mailbox import Mailbox
from frictus.messages import MESSAGES, Reply
from frictus.session import DENIED, UNKNOWN, if_secured

ROUTER_GONE: Final = "the link to the router is gone; it is being tried again"
CLOSED: Final = "the client was closed; connect again"
ENDS: Final = ("stop", "disarm")
"""Calls that reach all who answer under the name of the rig: Zenoh gives a call to one of them,
and that one need not be the rig that drives the screen."""
LOOKS: Final = 2
"""That tell the same. Where the machine is busy, Zenoh ends an answer when the router has
answered, although it has not told all that it knows itself: of 600 rigs it told nobody in one
look of five."""
PAUSES_S: Final = (0.0, 0.0, 0.01, 0.02, 0.05, 0.1, 0.1, 0.1)
"""Before each look, until they tell the same; that nobody is there, all of them must tell."""


class Caller:
    """Calls one rig in the name of one client.

    Parameters
    ----------
    session : zenoh.Session
        Open session.
    keys : RigKeys
        The rig.
    client : str
        Name of this client; goes into every request.
    timeout_s : float
        Longest wait for a reply; also the time to live of each request.
    """

    def __init__(
        self, session: zenoh.Session, keys: RigKeys, client: str, timeout_s: float
    ) -> None:
        self.session = session
        self.keys = keys
        self.client = client
        self._timeout_s = timeout_s

    def call(self, name: str, /, *, timeout_s: float | None = None, **fields: Any) -> Reply:
        """Send a request and return the reply.

        Parameters
        ----------
        name : str
            A key of `frictus.keys.CALLS` or `RECORDER_CALLS`.
        timeout_s : float or None
            Longest wait for the reply, above 0 and up to 60 s, also the time to live; None is
            that of this caller.
        **fields
            What the request type holds beside client, time and time to live.

        Raises
        ------
        ArgumentError
            If a field is out of range; nothing was sent.
        RefusedError
            If the rig refused.
        NoRigError
            If the rig is not present.
        OutcomeUnknownError
            If it was sent and not answered in time, or with what cannot be read: it may have
            been done.
        LinkError
            If it was not sent: the router is gone, or allows it to nobody in our role.
        """
        timeout_s = self._timeout_s if timeout_s is None else timeout_s
        try:
            request = MESSAGES[(CALLS | RECORDER_CALLS)[name]].model_validate(
                {
                    "client": self.client,
                    "utc_ns": time.time_ns(),
                    "ttl_ms": ceil(1_000 * timeout_s),
                    **fields,
                }
            )
        except ValidationError as error:
            raise ArgumentError(f"{name}: {explain(error)}") from error
        reply = self._ask(name, request.to_json(), timeout_s)
        if not reply.ok:
            raise RefusedError(reply.code or "bad_request", reply.message)
        return reply

    def _ask(self, name: str, payload: bytes, timeout_s: float) -> Reply:
        if not self.session.info.transports():
            raise LinkError(f"{name} was not sent: {link_loss(self.session)}")
        in_time, unreadable = True, ""
        try:
            answers = self.session.get(
                self.keys.call(name),
                target=zenoh.QueryTarget.ALL if name in ENDS else None,
                consolidation=zenoh.ConsolidationMode.NONE,  # else the first waits for all
                payload=payload,
                encoding=zenoh.Encoding.APPLICATION_JSON,
                attachment=self.client,
                timeout=timeout_s,
                priority=zenoh.Priority.REAL_TIME,
                congestion_control=zenoh.CongestionControl.BLOCK,
                express=True,
            )
            for answer in answers:
                if answer.ok is None:
                    in_time = False
                    continue
                try:
                    return Reply.from_json(answer.ok.payload.to_bytes())
                except FrameError as error:  # of whoever answers under the name of the rig
                    unreadable = str(error)
        except zenoh.ZError as error:
            raise LinkError(f"{name} was not sent: {error}") from error
        if unreadable:
            raise OutcomeUnknownError(
                f"{name} was answered with what cannot be read; it may have been done: read "
                f"the rig's state before it is sent again. It was {unreadable}"
            )
        raise self._unanswered(name, in_time, timeout_s)

    def _unanswered(self, name: str, in_time: bool, timeout_s: float) -> LinkError:
        """Return why nobody answered: where the query was open to its end, nobody knows.

        Raises
        ------
        NoRigError
        """
        unknown = (
            f"{name} was sent to rig {self.keys.rig} at {self.keys.site} and not answered "
            f"within {timeout_s:g} s; it may have been done, or may still be: read the "
            "rig's state before it is sent again"
        )
        try:
            require_present(self.session, self.keys)
        except NoRigError:
            if self.session.info.transports():
                raise
            return OutcomeUnknownError(f"{unknown}. Now {ROUTER_GONE}")
        except LinkError as error:
            return OutcomeUnknownError(f"{unknown}. Now {error}")
        denied = if_secured(self.session, DENIED)
        if not in_time:
            return OutcomeUnknownError(unknown + denied)
        if name in RECORDER_CALLS:
            return LinkError(no_recorder(self.keys) + denied)
        return LinkError(
            f"rig {self.keys.rig} at {self.keys.site} is present but takes no {name}; it may "
            f"be starting or ending{denied}"
        )


def link_loss(session: zenoh.Session) -> str:
    """Return why a session has no link.

    Parameters
    ----------
    session : zenoh.Session
        Open, or closed by this program.
    """
    return CLOSED if session.is_closed() else ROUTER_GONE


def no_recorder(keys: RigKeys) -> str:
    """Return what to tell somebody to whom no recorder answers.

    Parameters
    ----------
    keys : RigKeys
        The rig that was to be recorded.
    """
    return (
        f"no recorder of rig {keys.rig} at {keys.site} answers: `frictus serve` starts one, "
        "`frictus recorder` starts one alone"
    )


def present_rigs(session: zenoh.Session, site: str = "*", wait_s: float = 2.0) -> list[RigKeys]:
    """Return the rigs that are alive, sorted by site and name.

    Parameters
    ----------
    session : zenoh.Session
        Open session.
    site : str
        One site, or ``*`` for all.
    wait_s : float
        Longest wait for the router's answer; it usually takes milliseconds.

    Raises
    ------
    LinkError
        If the router is gone, or has not answered in time.
    """
    if not session.info.transports():
        raise LinkError(link_loss(session))
    looks: list[set[RigKeys]] = []
    found: set[RigKeys] = set()
    silences = 0
    for pause_s in PAUSES_S:
        time.sleep(pause_s)
        answers = list(_tokens(session, any_rig_alive(site), wait_s))
        silences += any(answer.ok is None for answer in answers)
        looks.append(_rigs_in(answers))
        found |= looks[-1]
        if silences == LOOKS or (found and looks.count(found) == LOOKS):
            break
    if silences == LOOKS and not found:  # that nobody is there would be a claim
        raise LinkError(f"the router has not answered within {wait_s:g} s; try again")
    return sorted(found, key=lambda keys: (keys.site, keys.rig))


def _rigs_in(answers: Iterable[zenoh.Reply]) -> set[RigKeys]:
    """Return the rigs whose tokens are among some answers."""
    rigs = set()
    for answer in answers:
        if answer.ok is not None:
            with contextlib.suppress(ValueError):  # somebody else's token
                rigs.add(rig_of(str(answer.ok.key_expr)))
    return rigs


def _tokens(session: zenoh.Session, key: str, wait_s: float) -> Iterator[zenoh.Reply]:
    """Yield the liveliness tokens below a key.

    They are put into a queue without a bound: what Zenoh knows already it tells within `get`
    itself, which stands still for ever, and its session with it, where its own channel is full.
    """
    answers: queue.SimpleQueue[zenoh.Reply | None] = queue.SimpleQueue()
    told = Callback(answers.put, lambda: answers.put(None), indirect=False)
    session.liveliness().get(key, told, timeout=wait_s)
    while (answer := answers.get()) is not None:
        yield answer


def await_present(session: zenoh.Session, keys: RigKeys, wait_s: float) -> None:
    """Wait until a rig is present; raise `NoRigError`, listing those that are, if it is not.

    Parameters
    ----------
    session : zenoh.Session
        Open session.
    keys : RigKeys
        The rig.
    wait_s : float
        Longest wait for a rig that is only just starting.
    """
    if keys in present_rigs(session):
        return
    mailbox = Mailbox(8)
    subscriber = session.liveliness().declare_subscriber(
        keys.alive, Callback(mailbox.put, indirect=False), history=True
    )
    try:
        while mailbox.take(wait_s).deleted:
            pass
    except SilenceError:
        require_present(session, keys)
    finally:
        subscriber.undeclare()  # type: ignore[no-untyped-call]


def require_present(session: zenoh.Session, keys: RigKeys) -> None:
    """Raise `NoRigError`, listing the rigs that are there, unless this one is.

    Parameters
    ----------
    session : zenoh.Session
        Open session.
    keys : RigKeys
        The rig.
    """
    present = present_rigs(session)
    if keys not in present:
        names = ", ".join(f"{other.rig} at {other.site}" for other in present) or "none"
        raise NoRigError(
            f"no rig {keys.rig!r} at site {keys.site!r}; present: {names}"
            + (if_secured(session, UNKNOWN) if not present else "")
        )
