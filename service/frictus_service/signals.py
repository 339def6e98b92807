"""What a part of the service is told to stop by, and tells that it is ready with."""

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
