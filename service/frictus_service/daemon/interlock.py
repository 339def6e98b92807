"""The safety state that the threads of a rig share; each event is a short critical section."""

import threading
from dataclasses import dataclass

from frictus_service.daemon.safety import (
    ClientVanished,
    Disarm,
    Event,
    FaultRaised,
    Refuse,
    Safety,
    Stop,
    Tick,
    Tripped,
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
    if owner is None or after.owner == owner:
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
