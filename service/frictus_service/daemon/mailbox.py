"""Bounded boxes of messages between callbacks that must not wait and a thread that does."""

import threading
from collections import deque
from collections.abc import Mapping
from typing import Generic, TypeVar

Item = TypeVar("Item")


class Mailbox(Generic[Item]):
    """Named boxes, served in their order; a full box loses its oldest item, and counts it.

    Parameters
    ----------
    sizes : mapping of box name to number of items
        The first box that holds something is served first. A size of 1 means that the newest
        wins.
    """

    def __init__(self, sizes: Mapping[str, int]) -> None:
        self._boxes: dict[str, deque[Item]] = {
            name: deque(maxlen=size) for name, size in sizes.items()
        }
        self._filled = threading.Condition()
        self._closed = False
        self.lost = dict.fromkeys(sizes, 0)
        """Items that gave way to newer ones, per box."""

    def post(self, box: str, item: Item) -> None:
        """Put an item in a box; never waits for room."""
        with self._filled:
            held = self._boxes[box]
            self.lost[box] += len(held) == held.maxlen
            held.append(item)
            self._filled.notify()

    def take(self) -> tuple[str, Item] | None:
        """Wait for an item and return it with its box's name, or None once closed."""
        with self._filled:
            while not self._closed:
                for name, held in self._boxes.items():
                    if held:
                        return name, held.popleft()
                self._filled.wait()
        return None

    def close(self) -> None:
        """Wake whoever waits, for good."""
        with self._filled:
            self._closed = True
            self._filled.notify_all()
