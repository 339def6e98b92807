"""Bounded boxes between threads: commands on their way, and what others leave for the loop."""

import contextlib
import math
import threading
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final, Generic, TypeVar

import zenoh

from frictus.messages import ModelState, Reply
from frictus_service.daemon.safety import Safety
from frictus_service.synthesis.compensation import Inverse
from frictus_service.synthesis.renderer import Playable
from frictus_service.synthesis.scene import CompiledScene

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


@dataclass(frozen=True, slots=True)
class SceneUpdate:
    """Play this scene, or this excitation, from the next block on.

    Attributes
    ----------
    scene : CompiledScene or CompiledExcitation
        What is played.
    until_s : float
        Monotonic time after which it must not be felt any more; infinite for a standing scene.
    afterwards : CompiledScene or None
        What to fade to then: what a stream feels like without updates.
    arming : int or None
        The arming that it ends with, as `Safety.armings` counts; None: it stays when its
        client goes.
    """

    scene: Playable
    until_s: float = math.inf
    afterwards: CompiledScene | None = None
    arming: int | None = None

    @property
    def standing(self) -> bool:
        """Whether the scene stays when its client goes."""
        return self.arming is None

    def early(self, safety: Safety) -> bool:
        """Return whether the arming that it belongs to began after this state."""
        return self.arming is not None and self.arming > safety.armings

    def ended(self, safety: Safety) -> bool:
        """Return whether the arming that it belongs to is over."""
        return not (self.standing or (safety.energised and safety.armings == self.arming))


@dataclass(frozen=True, slots=True)
class CompensationUpdate:
    """Undo this instead of the model from the next block on, until an arming ends.

    Attributes
    ----------
    inverse : Inverse
        What is undone.
    arming : int
        The arming that it ends with, as `Safety.armings` counts.
    """

    inverse: Inverse
    arming: int

    def ended(self, safety: Safety) -> bool:
        """Return whether the arming that it belongs to is over."""
        return not (safety.energised and safety.armings == self.arming)


@dataclass(frozen=True, slots=True)
class RenderedModel:
    """A model, and what is undone for it.

    Attributes
    ----------
    state : ModelState
        With the etag by which everybody names it.
    inverse : Inverse
        What is undone.
    """

    state: ModelState
    inverse: Inverse


@dataclass(frozen=True, slots=True, eq=False)
class ModelUpdate:
    """Render with another model from now on.

    Attributes
    ----------
    model : RenderedModel
        Published and inverted.
    scene : CompiledScene
        The standing scene, compiled for it.
    stream : SceneUpdate or None
        What is streamed over it, if anything, compiled for it.
    fades : bool
        Whether it may come while there is output, with a cross-fade: a model that was adapted,
        or is put back. Another is taken only where nothing is felt.
    client : str
        Who asked for it, where it may keep the model from others; empty for a tracker.
    done : threading.Event
        Set once all are in force.
    """

    model: RenderedModel
    scene: CompiledScene
    stream: SceneUpdate | None = None
    fades: bool = False
    client: str = ""
    done: threading.Event = field(default_factory=threading.Event)

    def allowed(self, safety: Safety, energised: bool) -> bool:
        """Return whether it may be put in force now.

        Parameters
        ----------
        safety : Safety
            The state now.
        energised : bool
            Whether the device is armed.
        """
        return not safety.keeps_model_from(self.client) if self.fades else not energised


class ModelSlot:
    """The model in force, and at most one that waits to replace it.

    What waits is either taken, which puts it in force, or withdrawn, after which it never
    will be: one lock decides, so that nobody can hear one and the loop do the other.

    Parameters
    ----------
    in_force : RenderedModel
        To begin with.
    """

    def __init__(self, in_force: RenderedModel) -> None:
        self._lock = threading.Lock()
        self._in_force = in_force
        self._waiting: ModelUpdate | None = None

    @property
    def in_force(self) -> RenderedModel:
        """What the loop renders with."""
        return self._in_force

    def offer(self, order: ModelUpdate) -> None:
        """Leave an order for the loop; the newest wins."""
        with self._lock:
            self._waiting = order

    def take(self, safety: Safety, energised: bool) -> ModelUpdate | None:
        """Put what waits in force, if it is allowed now, and return it; the loop's part alone.

        Parameters
        ----------
        safety : Safety
            The state now.
        energised : bool
            Whether the device is armed.
        """
        if self._waiting is None:
            return None
        with self._lock:
            order = self._waiting
            if order is None or not order.allowed(safety, energised):
                return None
            self._waiting = None
            self._in_force = order.model
            return order

    def withdraw(self, order: ModelUpdate) -> bool:
        """Take an order back; return False where it is in force already."""
        with self._lock:
            waits = self._waiting is order
            if waits:
                self._waiting = None
            return waits


@dataclass(frozen=True, slots=True)
class LoopInbox:
    """Slots of one; where they are deques, append and popleft need no lock."""

    model: ModelSlot
    scene: deque[SceneUpdate] = field(default_factory=lambda: deque(maxlen=1))
    standing: deque[SceneUpdate] = field(default_factory=lambda: deque(maxlen=1))
    compensation: deque[CompensationUpdate] = field(default_factory=lambda: deque(maxlen=1))

    def stand(self, scene: CompiledScene) -> None:
        """Leave a standing scene; what is ordered over it before it is taken does not lose it.

        Parameters
        ----------
        scene : CompiledScene
            To be played until another stands, or something is played over it.
        """
        update = SceneUpdate(scene)
        self.scene.append(update)
        self.standing.append(update)  # last: whatever is taken between, the newest stands


@dataclass(frozen=True, slots=True)
class IncomingCommand:
    """A payload with the call it is to answer, if it is one."""

    name: str
    payload: bytes = b""
    sender: str = ""
    """As the attachment names it; empty without one."""
    query: zenoh.Query | None = None
    key: str = ""
    """Of the call; a query may have asked under a wildcard, a reply must not."""
    reply: Reply | None = None
    """Once it is decided."""

    def answer(self) -> None:
        """Send the reply."""
        if self.query is None or self.reply is None:
            return
        # Whoever asked may be gone; that must not end the thread that keeps the rig safe.
        with contextlib.suppress(Exception), self.query:
            self.query.reply(
                self.key,
                self.reply.to_json(),
                encoding=zenoh.Encoding.APPLICATION_JSON,
            )
