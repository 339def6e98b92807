"""The one state machine that decides whether the screen may be driven.

Pure: `step` takes a state, an event and the time, and returns the next state and its effects.
`docs/safety.md` draws it and lists the faults. What the device must do follows from the state
alone (`energised`, `may_render`), so that no lost message can leave the output on.
"""

from dataclasses import dataclass, replace
from typing import Final

from frictus.keys import person_of, spoken_name
from frictus.messages import Fault, FaultKind, LeaseEnd, RefusalCode, SafetyState

LATCHING: Final[frozenset[FaultKind]] = frozenset(
    {"device_lost", "stream_lost", "safety", "deadline", "internal"}
)
"""Faults that trip: the output stays off until an operator resets the rig."""

LASTING: Final[frozenset[FaultKind]] = frozenset({"sensor", "link_lost"})
"""Faults that hold for as long as their cause does, and then clear by themselves."""

ACTIONS: Final[dict[FaultKind, str]] = {
    "config": "Correct the configuration at the line that the message names; start again.",
    "transient": "Nothing; it was tried again in time. If it keeps coming, check the cable.",
    "stream_lost": "Check the machine's load, then reset the rig and arm again.",
    "device_lost": "Check the device's power and cable, then reset the rig and arm again.",
    "link_lost": "Check the network to the device; arm again once the fault is gone.",
    "sensor": "Check the sensor's cable and that the finger is in range; rendering resumes.",
    "safety": "Do not touch the screen. Find out why, then reset the rig and arm again.",
    "deadline": "Close other programs on the rig's machine, then reset the rig and arm again.",
    "internal": "Report the message to the maintainers; reset the rig and arm again.",
}
"""What an operator does about each kind of fault."""
AGAIN: Final = (
    "The rig is started again by itself, disarmed, and needs no reset. Its scene is gone, and "
    "its model is that of its start: set both again. Report the message to the maintainers."
)
"""What an operator does about a rig whose process has ended."""


@dataclass(frozen=True, slots=True)
class FormerRun:
    """How the run before ended, of a rig that was started again.

    Attributes
    ----------
    fault : Fault
        Shown until the rig is armed.
    last_end : LeaseEnd or None
        How the last lease ended; shown until the next one has.
    """

    fault: Fault
    last_end: LeaseEnd | None = None


@dataclass(frozen=True, slots=True)
class Arm:
    """A client takes the rig, or its owner takes it anew, for `lease_s`."""

    client: str
    lease_s: float
    share_with: tuple[str, ...] = ()
    """Clients and people who may change what is rendered meanwhile."""
    keep_model: bool = False
    """Whether the model stays as it is until the lease ends."""


@dataclass(frozen=True, slots=True)
class Renew:
    """The owner is alive."""

    client: str


@dataclass(frozen=True, slots=True)
class Disarm:
    """The owner gives the rig back."""

    client: str


@dataclass(frozen=True, slots=True)
class Stop:
    """Anybody wants the output off, now."""

    client: str


@dataclass(frozen=True, slots=True)
class Reset:
    """An operator has seen the trip and its cause."""


@dataclass(frozen=True, slots=True)
class Tick:
    """Time has passed; ends a lease that was not renewed."""


@dataclass(frozen=True, slots=True)
class ClientVanished:
    """A client's liveliness token fell."""

    client: str


@dataclass(frozen=True, slots=True)
class FaultRaised:
    """A typed fault."""

    kind: FaultKind
    reason: str


@dataclass(frozen=True, slots=True)
class FaultCleared:
    """The cause of a lasting fault is gone, or a lost device answers again."""

    kind: FaultKind


@dataclass(frozen=True, slots=True)
class OutputQuiet:
    """The ramp has been played to its end: the screen is at zero."""


Event = (
    Arm
    | Renew
    | Disarm
    | Stop
    | Reset
    | Tick
    | ClientVanished
    | FaultRaised
    | FaultCleared
    | OutputQuiet
)


@dataclass(frozen=True, slots=True)
class Refuse:
    """The event was not accepted; the sender is told."""

    code: RefusalCode
    message: str


@dataclass(frozen=True, slots=True)
class Announce:
    """Observers should hear of the new state at once."""


@dataclass(frozen=True, slots=True)
class Tripped:
    """A fault latched; it is counted."""

    kind: FaultKind


Effect = Refuse | Announce | Tripped


@dataclass(frozen=True, slots=True)
class Safety:
    """Where the rig stands.

    Attributes
    ----------
    state : str
        `disarmed`, `armed`, `stopping` (ramping to zero) or `tripped` (latched).
    owner : str or None
        The client that holds the lease; None unless armed.
    share_with : tuple of str
        Clients and people whom the owner lets change what is rendered; empty unless armed.
    lease_s, lease_until_s : float
        Length of the lease and its end on the monotonic clock.
    fault : tuple of kind and reason, or None
        What tripped the rig, or the latest fault until the next arming, or until it is over
        where the lease went on.
    lasting : tuple of faults
        Faults whose cause is still there, one per kind, oldest first.
    device_ready : bool
        False from the loss of the device until it answers again.
    armings : int
        Counts the armings: what one owner began does not outlive it, and the output goes
        through zero between two of them.
    keep_model : bool
        Whether the owner keeps the model as it is; False unless armed.
    """

    state: SafetyState = "disarmed"
    owner: str | None = None
    lease_s: float = 0.0
    lease_until_s: float = 0.0
    fault: tuple[FaultKind, str] | None = None
    lasting: tuple[tuple[FaultKind, str], ...] = ()
    device_ready: bool = True
    armings: int = 0
    share_with: tuple[str, ...] = ()
    keep_model: bool = False

    @property
    def energised(self) -> bool:
        """Whether the device may stay armed; where not, it is told to ramp down and disarm."""
        return self.state == "armed"

    def may_render(self, now_s: float) -> bool:
        """Return whether output other than a ramp to zero is allowed."""
        return self.state == "armed" and now_s < self.lease_until_s and not self.lasting

    def keeps_model_from(self, client: str) -> bool:
        """Return whether the owner keeps the model as it is, and is not this client.

        Parameters
        ----------
        client : str
            Who would change it; empty for a tracker, which is never the owner.
        """
        return self.keep_model and client != self.owner


Outcome = tuple[Safety, tuple[Effect, ...]]


def step(state: Safety, event: Event, now_s: float) -> Outcome:
    """Return the next state and what else must happen.

    Parameters
    ----------
    state : Safety
        Before the event.
    event : Event
        What happened, of `frictus_service.daemon.safety`.
    now_s : float
        Monotonic time, never the wall clock.

    Returns
    -------
    state : Safety
    effects : tuple of Effect
        At most one `Refuse`.
    """
    if state.state == "armed" and now_s >= state.lease_until_s:
        # The lease is checked before anything else, so that a late renewal cannot revive it.
        stopped, effects = _ramp(state), (Announce(),)
        if isinstance(event, Tick):
            return stopped, effects
        after, more = step(stopped, event, now_s)
        return after, (*effects, *more)
    match event:
        case Arm():
            return _arm(state, event, now_s)
        case Renew():
            return _renew(state, event, now_s)
        case Disarm():
            return _disarm(state, event)
        case Stop() | ClientVanished():
            return _stop(state, event)
        case Reset():
            return _reset(state)
        case FaultRaised():
            return _raise(state, event)
        case FaultCleared():
            return _clear(state, event)
        case OutputQuiet() if state.state == "stopping":
            return replace(state, state="disarmed"), (Announce(),)
        case OutputQuiet() | Tick():
            return state, ()


def refusal(state: Safety, client: str) -> Refuse | None:
    """Return why `client` may not command the rig now, or None.

    While armed only the owner may; otherwise anybody, since nothing is felt.
    """
    if state.state == "armed" and client != state.owner:
        message = f"{spoken_name(state.owner)} holds the rig; wait until it disarms"
        return Refuse("not_owner", message)
    return None


def refusal_to_render(state: Safety, client: str) -> Refuse | None:
    """Return why `client` may not change what is rendered now, or None.

    While armed the owner may, and with whom it shares the rig.
    """
    if client in state.share_with or person_of(client) in state.share_with:
        return None
    refused = refusal(state, client)
    if refused is None:
        return None
    advice = f" or have it armed with share_with {person_of(client)!r}"
    return replace(refused, message=refused.message + advice)


def _ramp(state: Safety) -> Safety:
    return replace(state, state="stopping", owner=None, share_with=(), keep_model=False)


def _arm(state: Safety, event: Arm, now_s: float) -> Outcome:
    held = refusal(state, event.client)
    if held is not None:
        return state, (held,)
    if state.state == "tripped":
        return state, (Refuse("tripped", _latched(state)),)
    if state.lasting:
        kind, reason = state.lasting[0]
        return state, (Refuse("unavailable", f"{kind} fault: {reason}. {ACTIONS[kind]}"),)
    armed = Safety(
        "armed",
        event.client,
        event.lease_s,
        now_s + event.lease_s,
        armings=state.armings + (state.state != "armed"),
        share_with=event.share_with,
        keep_model=event.keep_model,
    )
    return armed, (Announce(),)


def _renew(state: Safety, event: Renew, now_s: float) -> Outcome:
    held = refusal(state, event.client)
    if held is not None:
        return state, (held,)
    if state.state != "armed":
        return state, (Refuse("not_armed", "the lease has ended; arm again"),)
    return replace(state, lease_until_s=now_s + state.lease_s), ()


def _disarm(state: Safety, event: Disarm) -> Outcome:
    held = refusal(state, event.client)
    if held is not None:
        return state, (held,)
    if state.state == "armed":
        return _ramp(state), (Announce(),)
    return state, ()  # already off: what was asked for holds


def _stop(state: Safety, event: Stop | ClientVanished) -> Outcome:
    if isinstance(event, ClientVanished) and event.client != state.owner:
        return state, ()
    # Who stopped is told also where nothing was driven.
    return (_ramp(state) if state.state == "armed" else state), (Announce(),)


def _reset(state: Safety) -> Outcome:
    if state.state != "tripped":
        return state, ()
    if not state.device_ready:
        return state, (Refuse("unavailable", f"the device is not back yet. {_latched(state)}"),)
    lasts = state.lasting[-1] if state.lasting else None
    return replace(state, state="disarmed", fault=lasts), (Announce(),)


def _raise(state: Safety, event: FaultRaised) -> Outcome:
    fault = (event.kind, event.reason)
    gone = event.kind in ("device_lost", "stream_lost", "link_lost")
    ready = state.device_ready and not gone
    if event.kind in LATCHING:
        if state.state == "tripped":  # the first cause is the one an operator needs to see
            return replace(state, device_ready=ready), ()
        tripped = replace(_ramp(state), state="tripped", fault=fault, device_ready=ready)
        return tripped, (Tripped(event.kind), Announce())
    if event.kind not in LASTING:
        return state, ()  # transient ones are counted by the loop; config refuses to start
    if any(kind == event.kind for kind, _ in state.lasting):
        return replace(state, device_ready=ready), ()
    shown = state.fault if state.state == "tripped" else fault
    lasts = replace(state, fault=shown, lasting=(*state.lasting, fault), device_ready=ready)
    if event.kind == "link_lost" and state.state == "armed":
        lasts = _ramp(lasts)
    return lasts, (Announce(),)


def _clear(state: Safety, event: FaultCleared) -> Outcome:
    back = event.kind in ("device_lost", "stream_lost", "link_lost")
    lasting = tuple(fault for fault in state.lasting if fault[0] != event.kind)
    # Where it ended no lease, rendering goes on: nothing is wrong any more.
    over = state.state == "armed" and lasting != state.lasting
    cleared = replace(
        state,
        fault=(lasting[-1] if lasting else None) if over else state.fault,
        lasting=lasting,
        device_ready=state.device_ready or back,
    )
    return cleared, (Announce(),) if cleared != state else ()


def _latched(state: Safety) -> str:
    kind, reason = state.fault or ("internal", "unknown")
    return f"tripped by a {kind} fault: {reason}. {ACTIONS[kind]}"
