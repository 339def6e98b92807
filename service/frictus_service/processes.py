"""What a part of the service is told to stop by, says that it is ready with, listens at."""

import socket
from typing import Protocol


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
