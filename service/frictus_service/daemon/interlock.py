"""The safety state that the threads of a rig share; each event is a short critical section."""

import threading

from frictus_service.daemon.safety import Event, Refuse, Safety, Tick, Tripped, step


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

    @property
    def state(self) -> Safety:
        """The state now."""
        return self._state

    def feed(self, event: Event, now_s: float) -> Refuse | None:
        """Take an event; return the refusal where it was not accepted.

        Parameters
        ----------
        event : Event
        now_s : float
            Monotonic time.
        """
        with self._lock:
            self._state, effects = step(self._state, event, now_s)
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
