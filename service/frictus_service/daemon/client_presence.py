"""Which clients are gone: an owner whose token falls loses the rig, at once or as it arms."""

import threading
from collections.abc import Callable
from typing import Final

FALLEN: Final = 4096
"""Names of clients whose token fell last that are kept."""
CONFIRM_S: Final = 0.5
"""A client that arms after its token fell must show it again within this time."""


class ClientPresence:
    """Follows the tokens of clients. Any thread may call it; it never waits for long.

    A request to arm may be decided after its client has died and its token has fallen: such
    an owner is given `CONFIRM_S` to show a token, not the whole lease.

    Parameters
    ----------
    vanish : callable
        Takes the rig from a client that is gone, if it holds it.
    """

    def __init__(self, vanish: Callable[[str], object]) -> None:
        self._vanish = vanish
        self._lock = threading.Lock()
        self._fallen: dict[str, None] = {}
        self._confirming: dict[str, threading.Timer] = {}

    def on_token(self, client: str, present: bool) -> None:
        """Take note that a client's token stands, or has fallen."""
        with self._lock:
            self._fallen.pop(client, None)
            if not present:
                if len(self._fallen) == FALLEN:
                    del self._fallen[next(iter(self._fallen))]
                self._fallen[client] = None
        if not present:
            self._vanish(client)

    def on_armed(self, client: str) -> None:
        """Take note that a client has armed the rig."""
        with self._lock:
            if client not in self._fallen or client in self._confirming:
                return
            timer = threading.Timer(CONFIRM_S, self._confirm, (client,))
            timer.daemon = True
            self._confirming[client] = timer
        timer.start()

    def _confirm(self, client: str) -> None:
        with self._lock:
            self._confirming.pop(client, None)
            gone = client in self._fallen
        if gone:
            self._vanish(client)

    def close(self) -> None:
        """End what is still being confirmed."""
        with self._lock:
            timers = list(self._confirming.values())
        for timer in timers:
            timer.cancel()
