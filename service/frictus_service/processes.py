"""What the processes of the service share: signals, heartbeat, priorities, free ports."""

import socket
from typing import Final, Protocol

LOOP_PRIORITY: Final = 20
PUBLISHER_PRIORITY: Final = 10
"""Real time too: a publisher that is set aside while it holds the interpreter's lock holds up
the loop, whatever the loop's own priority is."""


class StopSignal(Protocol):
    """Such as an Event, of a thread or of a process."""

    def is_set(self) -> bool:
        """Return whether to stop."""
        ...


class ReadySignal(Protocol):
    """Such as an Event, of a thread or of a process."""

    def set(self) -> None:
        """Take note that calls or connections are answered."""
        ...


class Heartbeat(Protocol):
    """A number in shared memory, written by the loop alone; 0 says that nobody need watch."""

    value: int


def free_port() -> int:
    """Return a port of this machine that nobody uses just now."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def free_endpoint() -> str:
    """Return a Zenoh endpoint of this machine at a free port."""
    return f"tcp/127.0.0.1:{free_port()}"
