"""The safety state that a rig's threads share, and what becomes an event of it."""

import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Protocol, runtime_checkable

from frictus.errors import RefusedError
from frictus.messages import (
    ArmRequest,
    GuidanceState,
    LeaseRenewal,
    PointerState,
    Reply,
    Request,
)
from frictus_hardware.base import Backend
from frictus_hardware.errors import ConfigError, HardwareError
from frictus_service.config import Limits
from frictus_service.daemon.safety import (
    Arm,
    ClientVanished,
    Disarm,
    Event,
    FaultRaised,
    Refuse,
    Renew,
    Reset,
    Safety,
    Stop,
    Tick,
    Tripped,
    refusal,
    refusal_to_render,
    step,
)


@dataclass(frozen=True, slots=True)
class EndedLease:
    """How a lease ended.

    Attributes
    ----------
    owner : str
        Who held it.
    by : str or None
        The client whose doing it was; None for a fault or a renewal that did not come.
    reason : str
        For people.
    """

    owner: str
    by: str | None
    reason: str


def ended_lease(before: Safety, event: Event, after: Safety, now_s: float) -> EndedLease | None:
    """Return how the owner lost the rig between two states, or None where it did not.

    Parameters
    ----------
    before, after : Safety
        The states around the event.
    event : Event
        What happened, of `frictus_service.daemon.safety`.
    now_s : float
        Monotonic time of the event.
    """
    owner = before.owner
    if owner is None or (after.owner == owner and after.armings == before.armings):
        return None
    if now_s < before.lease_until_s:
        match event:
            case Stop(client):
                return EndedLease(owner, client or None, "stopped")
            case Disarm(client):
                return EndedLease(owner, client, "disarmed")
            case ClientVanished(client):
                return EndedLease(owner, None, "the owner's process or its link is gone")
            case FaultRaised(kind, reason):
                return EndedLease(owner, None, f"{kind} fault: {reason}")
    late = f"the lease of {1e3 * before.lease_s:g} ms was not renewed in time"
    return EndedLease(owner, None, late)


class Interlock:
    """Holds the state; the machine itself is `frictus_service.daemon.safety.step`.

    Parameters
    ----------
    initial : Safety
        Disarmed, with the fault to show if a rig was restarted after one.
    """

    def __init__(self, initial: Safety | None = None) -> None:
        self._lock = threading.Lock()
        self._state = initial or Safety()
        self._tick = Tick()
        self.revision = 0
        """Grows with every announced change."""
        self.trips = 0
        self.ended: EndedLease | None = None
        """How the last lease ended."""

    @property
    def state(self) -> Safety:
        """The state now."""
        return self._state

    def feed(self, event: Event, now_s: float) -> Refuse | None:
        """Take an event; return the refusal where it was not accepted.

        Parameters
        ----------
        event : Event
            What happened, of `frictus_service.daemon.safety`.
        now_s : float
            Monotonic time.
        """
        with self._lock:
            after, effects = step(self._state, event, now_s)
            # First the reason: whoever sees the new state also sees it.
            self.ended = ended_lease(self._state, event, after, now_s) or self.ended
            self._state = after
            refused = None
            for effect in effects:
                if isinstance(effect, Refuse):
                    refused = effect
                    continue
                self.trips += isinstance(effect, Tripped)
                self.revision += 1
            return refused

    def tick(self, now_s: float) -> Safety:
        """Let time pass and return the state."""
        self.feed(self._tick, now_s)
        return self._state


CONFIRM_S: Final = 0.5
"""A client that arms must show its token within this time."""


class ClientPresence:
    """Follows the tokens of clients. Any thread may call it; it never waits for long.

    A client may arm without a token, or be dead and its token fallen by the time its request is
    decided: such an owner is given `CONFIRM_S` to show one, not the whole lease.

    Parameters
    ----------
    vanish : callable
        Takes the rig from a client that is gone, if it holds it.
    """

    def __init__(self, vanish: Callable[[str], object]) -> None:
        self._vanish = vanish
        self._lock = threading.Lock()
        self._standing: set[str] = set()
        """No more than Zenoh itself holds."""
        self._confirming: dict[str, threading.Timer] = {}

    def on_token(self, client: str, present: bool) -> None:
        """Take note that a client's token stands, or has fallen."""
        with self._lock:
            (self._standing.add if present else self._standing.discard)(client)
        if not present:
            self._vanish(client)

    def on_armed(self, client: str) -> None:
        """Take note that a client has armed the rig."""
        with self._lock:
            if client in self._standing or client in self._confirming:
                return
            timer = threading.Timer(CONFIRM_S, self._confirm, (client,))
            timer.daemon = True
            self._confirming[client] = timer
        timer.start()

    def _confirm(self, client: str) -> None:
        with self._lock:
            self._confirming.pop(client, None)
            gone = client not in self._standing
        if gone:
            self._vanish(client)

    def close(self) -> None:
        """End what is still being confirmed."""
        with self._lock:
            timers = list(self._confirming.values())
        for timer in timers:
            timer.cancel()


@runtime_checkable
class MovesFinger(Protocol):
    """A backend whose virtual finger goes where it is told; from any thread."""

    def move_finger(
        self, x_mm: float, y_mm: float, in_contact: bool, normal_force_n: float
    ) -> None:
        """Move it."""
        ...


@runtime_checkable
class FollowsGuidance(Protocol):
    """A backend whose virtual finger does what a participant is asked to; from any thread."""

    @property
    def follows_guidance(self) -> bool:
        """Whether it is configured to."""
        ...

    def guide_finger(
        self, speed_mm_s: float, force_n: float, span_mm: tuple[float, float]
    ) -> None:
        """Tell it what to do."""
        ...


class Control:
    """Answers what concerns the right to drive the screen.

    Parameters
    ----------
    interlock : Interlock
        Holds the safety state.
    backend : Backend
        Whose virtual finger clients may move, if it has one.
    limits : Limits
        Of what a rig accepts.
    monotonic_s : callable
        Monotonic clock, s.
    """

    def __init__(
        self,
        interlock: Interlock,
        backend: Backend,
        limits: Limits,
        monotonic_s: Callable[[], float],
    ) -> None:
        self._interlock = interlock
        self._backend = backend
        self._limits = limits
        self._monotonic_s = monotonic_s

    def arm(self, request: ArmRequest) -> Reply:
        """Give the rig to a client for the length of its lease.

        Raises
        ------
        RefusedError
            `bad_request` for a longer lease than is granted, or what the safety machine says.
        """
        if request.lease_ms > self._limits.max_lease_ms:
            raise RefusedError(
                "bad_request",
                f"lease_ms: {request.lease_ms}; at most {self._limits.max_lease_ms} is granted",
            )
        lease_s = 1e-3 * request.lease_ms
        return self._feed(Arm(request.client, lease_s, request.share_with, request.keep_model))

    def disarm(self, request: Request) -> Reply:
        """Take the rig back from its owner."""
        return self._feed(Disarm(request.client))

    def stop(self, client: str) -> Reply:
        """Ramp the output to zero, whoever asks."""
        return self._feed(Stop(client))

    def reset(self, _request: Request) -> Reply:
        """Unlatch a trip."""
        return self._feed(Reset())

    def renew(self, request: LeaseRenewal) -> None:
        """Extend the owner's lease."""
        self._feed(Renew(request.client))

    def vanish(self, client: str) -> None:
        """Take note that a client is gone."""
        self._feed(ClientVanished(client))

    def point(self, request: PointerState) -> None:
        """Move the virtual finger.

        Raises
        ------
        RefusedError
            `not_feasible` where the finger is not driven by a client, or `not_owner`.
        """
        info = self._backend.info
        follows = info.finger_source == "pointer" or info.finger_takeover
        if not (follows and isinstance(self._backend, MovesFinger)):
            source = info.finger_source
            raise RefusedError("not_feasible", f"no client drives this finger: it is {source}")
        # A finger that can be taken over is part of a simulation that the holder may share.
        may = refusal_to_render if info.finger_takeover else refusal
        held = may(self._interlock.state, request.client)
        if held is not None:
            raise RefusedError(held.code, held.message)
        try:
            self._backend.move_finger(
                request.x_mm, request.y_mm, request.in_contact, request.normal_force_n
            )
        except HardwareError as error:
            raise RefusedError("unavailable", str(error)) from error

    @property
    def follows_guidance(self) -> bool:
        """Whether the finger is a virtual participant."""
        backend = self._backend
        return isinstance(backend, FollowsGuidance) and backend.follows_guidance

    def guide(self, guidance: GuidanceState) -> None:
        """Show a virtual participant what it is asked to do; it rests outside of trials.

        Raises
        ------
        RefusedError
            `not_feasible` where the finger follows no guidance, or cannot follow this.
        """
        backend = self._backend
        if not isinstance(backend, FollowsGuidance) or not backend.follows_guidance:
            raise RefusedError("not_feasible", "this finger follows no guidance")
        moves = guidance.phase in ("approach", "record")
        speed = guidance.target_speed_mm_s if moves else 0.0
        try:
            backend.guide_finger(speed, guidance.target_force_n, guidance.span_mm)
        except ConfigError as error:
            raise RefusedError("not_feasible", str(error)) from error
        except HardwareError as error:
            raise RefusedError("unavailable", str(error)) from error

    def _feed(self, event: Event) -> Reply:
        refused = self._interlock.feed(event, self._monotonic_s())
        if refused is not None:
            raise RefusedError(refused.code, refused.message)
        return Reply(ok=True)
