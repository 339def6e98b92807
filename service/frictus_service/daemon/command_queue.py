"""Bounded boxes of messages between callbacks that must not wait and a thread that does."""

import threading
from collections import deque
from collections.abc import Mapping
from typing import Final, Generic, TypeVar

Item = TypeVar("Item")
SENDERS: Final = 64
"""Senders whose items one box holds at the most."""


class CommandQueue(Generic[Item]):
    """Named boxes, served in their order, and within a box one sender after the other.

    A sender who fills its part of a box loses its own oldest item, never another's, and it is
    counted. Of more than `SENDERS` who wait at once, the one who has waited longest loses.

    Parameters
    ----------
    sizes : mapping of box name to number of items for each sender
        The first box that holds something is served first. A size of 1 means that the newest
        wins.
    """

    def __init__(self, sizes: Mapping[str, int]) -> None:
        self._sizes = dict(sizes)
        self._boxes: dict[str, dict[str, deque[Item]]] = {name: {} for name in sizes}
        self._filled = threading.Condition()
        self._closed = False
        self.lost = dict.fromkeys(sizes, 0)
        """Items that gave way to newer ones, per box."""

    def post(self, box: str, item: Item, sender: str = "") -> list[Item]:
        """Put an item in a box; never waits for room. Return what gave way to it."""
        gone: list[Item] = []
        with self._filled:
            waiting = self._boxes[box]
            if sender not in waiting:
                if len(waiting) == SENDERS:
                    gone = list(waiting.pop(next(iter(waiting))))
                waiting[sender] = deque()
            elif len(waiting[sender]) == self._sizes[box]:
                gone = [waiting[sender].popleft()]
            waiting[sender].append(item)
            self.lost[box] += len(gone)
            self._filled.notify()
        return gone

    def take(self) -> tuple[str, Item] | None:
        """Wait for an item and return it with its box's name, or None once closed."""
        with self._filled:
            while not self._closed:
                for name, waiting in self._boxes.items():
                    if waiting:
                        sender = next(iter(waiting))
                        held = waiting.pop(sender)
                        item = held.popleft()
                        if held:
                            waiting[sender] = held  # behind the others
                        return name, item
                self._filled.wait()
        return None

    def close(self) -> None:
        """Wake whoever waits, for good."""
        with self._filled:
            self._closed = True
            self._filled.notify_all()
