"""Arming, leases and stops: each request becomes one event of the safety machine."""

from collections.abc import Callable
from typing import Protocol, runtime_checkable

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
from frictus_service.daemon.interlock import Interlock
from frictus_service.daemon.safety import (
    Arm,
    ClientVanished,
    Disarm,
    Event,
    Renew,
    Reset,
    Stop,
    refusal,
)


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
        return self._feed(Arm(request.client, 1e-3 * request.lease_ms, request.share_with))

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
        source = self._backend.info.finger_source
        if source != "pointer" or not isinstance(self._backend, MovesFinger):
            raise RefusedError("not_feasible", f"no client drives this finger: it is {source}")
        held = refusal(self._interlock.state, request.client)
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
