"""The lease: a rig drives its screen only while its owner keeps saying that it is there."""

import contextlib
import logging
import threading
import time
from types import TracebackType
from typing import Final, Self

import zenoh
from zenoh.handlers import Callback

from frictus.calls import Caller
from frictus.errors import FrameError, LinkError, NoRigError, RefusedError, SilenceError
from frictus.keys import Topics
from frictus.messages import LeaseRenewal, RigStatus
from frictus.reception import EndedError, Latest
from frictus.session import declare_publisher

log = logging.getLogger("frictus")

RENEWALS_PER_LEASE: Final = 4
CONFIRM_S: Final = 3.0  # a rig tells its status at least every second


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
    """

    def __init__(self, caller: Caller, status: Latest[RigStatus], lease_ms: int) -> None:
        self._caller = caller
        self._status = status
        self._lease_ms = lease_ms
        self._finished = threading.Event()
        self._lost = threading.Event()
        self._gone = threading.Event()
        self._reason = ""
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
            caller.call("arm", lease_ms=lease_ms)
            self._declared = undo.pop_all()
        self._armed_at_s = time.monotonic()
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
        """Why the lease is lost; empty while it is held."""
        return self._reason

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
        try:
            if not self.lost:
                self._caller.call("disarm")
        except RefusedError as error:
            if error.code not in ("not_owner", "not_armed", "tripped"):
                raise
        finally:
            self._finished.set()
            self._thread.join()
            self._declared.close()

    def _on_presence(self, sample: zenoh.Sample) -> None:
        if sample.kind == zenoh.SampleKind.DELETE:
            self._gone.set()

    def _renew(self) -> None:
        interval_s = self._lease_ms / 1_000 / RENEWALS_PER_LEASE
        due_s = self._armed_at_s
        confirmed = False
        while not self._finished.wait(max(0.0, due_s - time.monotonic())):
            confirmed, reason = self._judge(confirmed)
            if reason:
                self._lose(reason)
                return
            renewal = LeaseRenewal(
                client=self._caller.client, utc_ns=time.time_ns(), ttl_ms=self._lease_ms
            )
            try:
                self._publisher.put(renewal.to_json())
            except zenoh.ZError as error:
                self._lose(f"the session is gone: {error}")
                return
            # Missed deadlines are skipped, not caught up: one renewal is as good as ten.
            due_s = max(due_s + interval_s, time.monotonic())

    def _judge(self, confirmed: bool) -> tuple[bool, str]:
        """Return whether the rig has named us its owner yet, and why the lease is lost."""
        if self._gone.is_set():
            return confirmed, "the rig, or the link to it, is gone"
        try:
            status = self._status.value(0.0)
        except (SilenceError, FrameError, EndedError):
            status = None
        if status and status.owner == self._caller.client and status.state == "armed":
            return True, ""
        overdue = time.monotonic() - self._armed_at_s > CONFIRM_S
        if status is None or not (confirmed or overdue):
            return confirmed, ""  # a status from before we armed
        if status.fault is not None:
            return confirmed, f"the rig is {status.state}: {status.fault.reason}"
        return confirmed, f"the rig is {status.state}, its owner is {status.owner or 'nobody'}"

    def _lose(self, reason: str) -> None:
        self._reason = reason
        self._lost.set()
        log.warning("lease on rig %s lost: %s", self._caller.keys.rig, reason)

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


def _taken_back(declared: object) -> None:
    with contextlib.suppress(zenoh.ZError):  # the session went first
        declared.undeclare()  # type: ignore[attr-defined]
