"""The counter by which a supervisor sees that a block loop turns."""

from typing import Protocol


class Heartbeat(Protocol):
    """A number in shared memory, written by the loop alone; 0 says that nobody need watch."""

    value: int
