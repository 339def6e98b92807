"""Telling systemd how the service is: ready, alive, and what it said last.

The protocol is one datagram per message to the socket that systemd names in the environment
(sd_notify(3)). Elsewhere, and on Windows, nothing is sent.
"""

import contextlib
import os
import socket
import time
from collections.abc import Callable, Mapping
from typing import Final

KEEP_ALIVES: Final = 4
"""Sent so often within the time after which systemd would act."""
STEP_US: Final = 120_000_000
"""What systemd grants from each line of the start on: it must not end one that gets on."""


class ServiceManager:
    """Whoever started this process and waits to hear from it.

    Parameters
    ----------
    environment : mapping
        With `NOTIFY_SOCKET` and `WATCHDOG_USEC` where systemd asks for them.
    monotonic_s : callable
        Monotonic clock, s.
    """

    def __init__(
        self,
        environment: Mapping[str, str] = os.environ,
        monotonic_s: Callable[[], float] = time.monotonic,
    ) -> None:
        address = environment.get("NOTIFY_SOCKET", "")
        # A leading @ stands for the zero byte of Linux's abstract names.
        self._address = f"\0{address[1:]}" if address.startswith("@") else address
        self._every_s = 1e-6 * int(environment.get("WATCHDOG_USEC", "0")) / KEEP_ALIVES
        self._monotonic_s = monotonic_s
        self._due_s = 0.0
        self._started = False

    def ready(self) -> None:
        """Say that the service has started."""
        self._started = True
        self._send("READY=1")

    def stopping(self) -> None:
        """Say that the service is about to end."""
        self._send("STOPPING=1")

    def status(self, line: str) -> None:
        """Show a line in `systemctl status`; during the start it also asks for more time."""
        more_time = "" if self._started else f"\nEXTEND_TIMEOUT_USEC={STEP_US}"
        self._send(f"STATUS={line.splitlines()[0] if line else ''}{more_time}")

    def keep_alive(self) -> None:
        """Say that all is well, if it is time to; silence has systemd start the unit again."""
        now_s = self._monotonic_s()
        if self._every_s > 0.0 and now_s >= self._due_s:
            self._due_s = now_s + self._every_s
            self._send("WATCHDOG=1")

    def _send(self, message: str) -> None:
        if not self._address:
            return
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sender:
            sender.setblocking(False)  # the watch over the rig waits for nobody
            # Who does not hear us acts on our silence; there is nobody else to tell.
            with contextlib.suppress(OSError):
                sender.sendto(message.encode(), self._address)
