"""One subscription each, shared by all who watch it."""

import time
from collections import deque
from typing import Any, Final, Generic, TypeVar

import frictus
from frictus.block import Block
from frictus.keys import Topics
from frictus.messages import FingerState, Message
from frictus.reception import Feed
from frictus.watched_rig import BLOCKS
from frictus.websocket.messages import VALUES
from frictus_service.api.dashboard.messages import told

HISTORY_BLOCKS: Final = 512
"""Kept of a stream for viewers to take: 2.5 s of 5 ms blocks. Who is slower loses."""
FINGERS: Final = "fingers"
"""Name of the stream of all states of the finger; `finger` is the newest."""
ALWAYS_TOLD: Final = frozenset({"status", "scene", "model"})
"""Every rig has said these; on a busy machine the answer to a newcomer may be empty."""
ASK_AGAIN_S: Final = 1.0


T = TypeVar("T", Block, FingerState)


class Stream(Generic[T]):
    """The newest items of a stream: blocks, or states of the finger.

    All viewers share the items; each has only a cursor, so a viewer that does not read holds
    no memory and no other viewer up.

    Parameters
    ----------
    feed : Feed
        What arrives.
    kind : type
        Of the items.

    Attributes
    ----------
    count : int
        Items received: the cursor of who wants only what comes next.
    """

    def __init__(self, feed: Feed[Any], kind: type[T]) -> None:
        self._feed = feed
        self._kind: type[T] = kind
        self._newest: deque[T] = deque(maxlen=HISTORY_BLOCKS)
        self.count = 0

    def pump(self) -> None:
        """Take what has arrived, without waiting."""
        # What is missing shows in the sample counts, so gaps need no place of their own.
        for item in self._feed.drain():
            if isinstance(item, self._kind):
                self._newest.append(item)
                self.count += 1

    @property
    def overdue(self) -> bool:
        """Never: a stream holds nothing for who comes late."""
        return False

    def since(self, cursor: int) -> list[T]:
        """Return the items from a cursor on that are still held.

        Parameters
        ----------
        cursor : int
            A former `count`.
        """
        wanted = min(self.count - cursor, len(self._newest))
        return [self._newest[-back] for back in range(wanted, 0, -1)]

    def close(self) -> None:
        """Stop receiving."""
        self._feed.close()


class Value:
    """The newest message under a key.

    Attributes
    ----------
    count : int
        Messages received; 0: none.
    message : Message or None
        The newest.
    text : str
        The newest as a page gets it.
    """

    def __init__(self, rig: frictus.Rig, name: str) -> None:
        self._name = name
        self._rig = rig.name
        self._feed: Feed[Message] = rig.watch(VALUES[name], capacity=1)
        self._opened_s = time.monotonic()
        self.count = 0
        self.message: Message | None = None
        self.text = ""

    def pump(self) -> None:
        """Take what has arrived, without waiting."""
        if messages := self._feed.drain():
            self.message = messages[-1]
            self.text = told(self._name, self._rig, self.message)
            self.count += 1

    @property
    def overdue(self) -> bool:
        """Whether the rig should be asked again for what it said before we came."""
        waited_s = time.monotonic() - self._opened_s
        return self.count == 0 and self._name in ALWAYS_TOLD and waited_s > ASK_AGAIN_S

    def close(self) -> None:
        """Stop receiving."""
        self._feed.close()


Channel = Stream[Block] | Stream[FingerState] | Value


def open_channel(rig: frictus.Rig, name: str) -> Channel:
    """Subscribe to a stream or a value of a rig.

    Parameters
    ----------
    rig : Rig
        Present or not.
    name : str
        A key of `VALUES`, `FINGERS`, or the name of a stream.
    """
    if name in VALUES:
        return Value(rig, name)
    if name == FINGERS:
        return Stream(rig.watch(Topics.FINGER, capacity=HISTORY_BLOCKS), FingerState)
    assert name in BLOCKS
    return Stream(rig.blocks(name, capacity=HISTORY_BLOCKS), Block)  # type: ignore[arg-type]
