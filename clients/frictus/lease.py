"""The lease: a rig drives its screen only while its owner keeps saying that it is there."""

import contextlib
import logging
import threading
import time
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from types import TracebackType
from typing import Final, Protocol, Self, TypeVar

import zenoh
from zenoh.handlers import Callback

from frictus.calls import Caller
from frictus.errors import ArgumentError, LeaseLostError, LinkError, NoRigError, RefusedError
from frictus.keys import Topics, spoken_name
from frictus.messages import LeaseRenewal, Reply, RigStatus
from frictus.reception import Latest
from frictus.session import declare_publisher

log = logging.getLogger("frictus")

RENEWALS_PER_LEASE: Final = 4
CONFIRM_S: Final = 3.0  # a rig tells its status at least every second
SILENT_S: Final = 5.0
"""Longer than that beyond the lease no status: the link stands still without having ended."""
JUMP_S: Final = 0.5
"""Of a clock: a rig refuses what is stamped so far ahead of its own, unless configured."""


def names_shared_with(names: Sequence[str]) -> tuple[str, ...]:
    """Return the names of others who may change what is rendered.

    Parameters
    ----------
    names : sequence of str
        As they were given to `arm`.

    Raises
    ------
    ArgumentError
        If it is one name alone: its letters would be taken for names.
    """
    if isinstance(names, str):
        raise ArgumentError(f"share_with {names!r}: a list of names is accepted, [{names!r}]")
    return tuple(names)


class Lease:
    """The right to drive one rig's screen; a context manager that disarms. Made by `Rig.arm`.

    A thread renews the lease four times per lease. If this process dies, freezes or loses its
    link, the renewals stop and the rig ramps its output to zero.

    Parameters
    ----------
    caller : Caller
        Calls the rig.
    status : Latest of RigStatus
        The rig's status as it comes in.
    lease_ms : int
        How long the rig goes on without a renewal, 100 to 10000 ms.
    on_lost : callable
        Called once with the error, from the renewing thread, when the lease is lost.
    share_with : sequence of str
        Others who may change what is rendered meanwhile.
    keep_model : bool
        Whether no tracker may change the model meanwhile.
    still_there : callable
        Asked by the renewing thread before each renewal, which goes out only where it is true.
    """

    def __init__(
        self,
        caller: Caller,
        status: Latest[RigStatus],
        lease_ms: int,
        on_lost: Callable[[LeaseLostError], None],
        share_with: Sequence[str] = (),
        keep_model: bool = False,
        still_there: Callable[[], bool] = lambda: True,
    ) -> None:
        self._caller = caller
        self._status = status
        self._lease_ms = lease_ms
        self._finished = threading.Event()
        self._lost = threading.Event()
        self._gone = threading.Event()
        self._loss: LeaseLostError | None = None
        self._on_lost = on_lost
        self._still_there = still_there
        session, keys = caller.session, caller.keys
        self._declared: contextlib.ExitStack = contextlib.ExitStack()
        with contextlib.ExitStack() as undo:
            # The token first: the rig sees it fall when this process dies.
            token = session.liveliness().declare_token(keys.client_alive(caller.client))
            undo.callback(_taken_back, token)
            presence = session.liveliness().declare_subscriber(
                keys.alive, Callback(self._on_presence, indirect=False)
            )
            undo.callback(_taken_back, presence)
            self._publisher = declare_publisher(session, keys.of(Topics.LEASE), Topics.LEASE)
            undo.callback(_taken_back, self._publisher)
            reply = caller.call(
                "arm",
                lease_ms=lease_ms,
                share_with=names_shared_with(share_with),
                keep_model=keep_model,
            )
            self._declared = undo.pop_all()
        self._lease_ms = int(lease_ms)  # which may have come as a text or a float
        self._armed_at_s = self._heard_at_s = time.monotonic()
        self._heard: RigStatus | None = None
        self._ahead_s = _clock_ahead_s()
        self._armed_utc_ns = reply.utc_ns
        expect_state(status, reply, CONFIRM_S)
        self._thread = threading.Thread(target=self._renew, name="frictus-lease", daemon=True)
        self._thread.start()

    @property
    def lost(self) -> bool:
        """Whether the rig took the lease away or is gone; `reason` says why."""
        return self._lost.is_set()

    @property
    def finished(self) -> bool:
        """Whether it was given back."""
        return self._finished.is_set()

    @property
    def reason(self) -> str:
        """Why the lease is lost, by whom and when; empty while it is held."""
        return "" if self._loss is None else self._loss.reason

    @property
    def loss(self) -> LeaseLostError | None:
        """What `fingers()` and `TextureStream.send` raise once it is lost; None before."""
        return self._loss

    def wait_lost(self, timeout_s: float | None = None) -> bool:
        """Wait until the lease is lost; return whether it is.

        Parameters
        ----------
        timeout_s : float or None
            Longest wait; None waits for ever.
        """
        return self._lost.wait(timeout_s)

    def disarm(self) -> None:
        """Ramp the output to zero and give the rig back. Disarming twice is harmless.

        Raises
        ------
        RefusedError, NoRigError, LinkError
            As for every call; the output ramps to zero all the same, since the renewals end.
        """
        if self._finished.is_set():
            return
        # First the renewals: where nobody answers, the output ends with the lease.
        self._finished.set()
        self._thread.join()
        try:
            if not self.lost:
                expect_state(self._status, self._caller.call("disarm"), CONFIRM_S)
        except RefusedError as error:
            if error.code not in ("not_owner", "not_armed", "tripped"):
                raise
        finally:
            self._declared.close()

    def _on_presence(self, sample: zenoh.Sample) -> None:
        if sample.kind == zenoh.SampleKind.DELETE:
            self._gone.set()

    def _renew(self) -> None:
        interval_s = self._lease_ms / 1_000 / RENEWALS_PER_LEASE
        due_s = self._armed_at_s
        confirmed = False
        while not self._finished.wait(max(0.0, due_s - time.monotonic())):
            confirmed, loss = self._judge(confirmed)
            if loss is not None:
                self._lose(loss)
                return
            try:
                if self._still_there():
                    self._publisher.put(self._renewal().to_json())
            except zenoh.ZError as error:
                self._lose(LeaseLostError(f"the session is gone: {error}"))
                return
            except Exception as error:  # of whoever is asked: nothing is renewed from now on
                self._lose(LeaseLostError(f"still_there has failed: {error!r}"))
                return
            # Missed deadlines are skipped, not caught up: one renewal is as good as ten.
            due_s = max(due_s + interval_s, time.monotonic())

    def _renewal(self) -> LeaseRenewal:
        return LeaseRenewal(
            client=self._caller.client, utc_ns=time.time_ns(), ttl_ms=self._lease_ms
        )

    def _judge(self, confirmed: bool) -> tuple[bool, LeaseLostError | None]:
        """Return whether the rig has named us its owner yet, and why the lease is lost."""
        if self._gone.is_set():
            return confirmed, LeaseLostError("the rig, or the link to it, is gone")
        try:
            status = self._status.newest()
        except LinkError:
            status = None
        if status is not self._heard:
            self._heard, self._heard_at_s = status, time.monotonic()
        silent_s = time.monotonic() - self._heard_at_s
        if silent_s > self._lease_ms / 1_000 + SILENT_S:
            return confirmed, LeaseLostError(
                f"nothing has come from the rig for {silent_s:.0f} s: the link to it stands "
                "still, and a rig that hears no renewals ramps its output to zero by itself"
            )
        if status and status.owner == self._caller.client and status.state == "armed":
            return True, None
        overdue = time.monotonic() - self._armed_at_s > CONFIRM_S
        armed_ns = self._armed_utc_ns
        if status is None or not (
            confirmed or overdue or (armed_ns is not None and status.utc_ns >= armed_ns)
        ):
            return confirmed, None  # a status from before we armed
        return confirmed, _loss(status, self._caller.client)

    def _lose(self, loss: LeaseLostError) -> None:
        jump_s = _clock_ahead_s() - self._ahead_s
        if loss.by is None and abs(jump_s) >= JUMP_S:
            loss = LeaseLostError(
                f"{loss.reason}; this machine's clock jumped by {jump_s:+.1f} s meanwhile (it "
                "was set, or the machine slept): a rig refuses renewals that are stamped too "
                "far from its own clock",
                utc_ns=loss.utc_ns,
            )
        self._loss = loss
        self._lost.set()
        log.warning("lease on rig %s lost: %s", self._caller.keys.rig, loss.reason)
        self._on_lost(loss)

    def __enter__(self) -> Self:
        """Return self."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Disarm; an error that is already on its way is not replaced by one of disarming."""
        try:
            self.disarm()
        except (RefusedError, NoRigError, LinkError):
            if error is None:
                raise


def _clock_ahead_s() -> float:
    """Return how far the clock is ahead of one that nobody sets."""
    return 1e-9 * time.time_ns() - time.monotonic()


def expect_state(status: Latest[RigStatus], reply: Reply, within_s: float) -> None:
    """Have the next status read include what a reply confirmed.

    Parameters
    ----------
    status : Latest of RigStatus
        Newest status of the rig.
    reply : Reply
        Of a rig that says when it answered; else nothing is expected.
    within_s : float
        Longest wait for it.
    """
    if reply.utc_ns is not None:
        status.expect(reply.utc_ns, within_s)


def stream_end(status: RigStatus | None, opened: Reply) -> LeaseLostError | None:
    """Return how a stream has ended; None while it is played, as far as the rig says.

    Parameters
    ----------
    status : RigStatus or None
        The rig's newest.
    opened : Reply
        Of the call that opened the stream.
    """
    if status is None or opened.utc_ns is None or status.utc_ns < opened.utc_ns:
        return None
    if status.scene_etag == opened.etag:
        return None
    if status.state == "armed":
        return LeaseLostError(
            f"the stream has ended: {spoken_name(status.owner)} holds the rig, and what it "
            f"plays now is {status.scene_etag!r}"
        )
    return _loss(status, "" if status.last_end is None else status.last_end.owner)


def _loss(status: RigStatus, client: str) -> LeaseLostError:
    """Return how the lease of a client ended, as far as the rig says."""
    end = status.last_end
    if end is not None and end.owner == client:
        when = datetime.fromtimestamp(end.utc_ns // 10**9, UTC).strftime("%H:%M:%S UTC")
        who = f" by {spoken_name(end.by)}" if end.by is not None else ""
        reason = f"the rig is {status.state}: {end.reason}{who} at {when}"
        return LeaseLostError(reason, end.by, end.utc_ns)
    if status.fault is not None:
        return LeaseLostError(f"the rig is {status.state}: {status.fault.reason}")
    return LeaseLostError(
        f"the rig is {status.state}, its owner is {spoken_name(status.owner)}"
    )


def _taken_back(declared: object) -> None:
    with contextlib.suppress(zenoh.ZError):  # the session went first
        declared.undeclare()  # type: ignore[attr-defined]


class LeaseDependent(Protocol):
    """A feed or a stream that ends with a lease."""

    @property
    def closed(self) -> bool:
        """Whether it has ended."""
        ...

    def fail(self, error: Exception, /) -> None:
        """End it with an error.

        Parameters
        ----------
        error : Exception
            Why.
        """
        ...


F = TypeVar("F", bound=LeaseDependent)


class Leases:
    """The leases of one client on one rig, and what ends with a lost one. For any thread."""

    def __init__(self) -> None:
        self._changing = threading.Lock()
        self._leases: list[Lease] = []
        self._followers: list[LeaseDependent] = []

    def hold(self, lease: Lease) -> Lease:
        """Keep a new lease until it is finished, and return it; lost ones are let go of.

        Parameters
        ----------
        lease : Lease
            Made with `fail_followers` for its loss.
        """
        with self._changing:
            held = [other for other in self._leases if not (other.finished or other.lost)]
            self._leases = [*held, lease]
        return lease

    def follow(self, follower: F) -> F:
        """Return a feed or stream that fails when a lease is lost.

        Parameters
        ----------
        follower : LeaseDependent
            Let go of once it is closed.
        """
        with self._changing:
            open_ones = [other for other in self._followers if not other.closed]
            self._followers = [*open_ones, follower]
        for lease in self._leases:  # after it was listed: no loss falls between the two
            if lease.loss is not None and not lease.finished:
                follower.fail(lease.loss)
        return follower

    def fail_followers(self, loss: LeaseLostError) -> None:
        """End what follows, as a lease was lost.

        Parameters
        ----------
        loss : LeaseLostError
            Who took it, when and why.
        """
        for follower in self._followers:
            follower.fail(loss)

    def disarms(self) -> list[Callable[[], None]]:
        """Let go of every lease; return what disarms each."""
        with self._changing:
            leases, self._leases = self._leases, []
        return [lease.disarm for lease in leases]
