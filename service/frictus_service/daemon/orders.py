"""What other threads leave for the loop: slots of one, where the newest wins."""

import math
import threading
from collections import deque
from dataclasses import dataclass, field

from frictus_service.daemon.safety import Safety
from frictus_service.synthesis.inverse import Invertible
from frictus_service.synthesis.renderer import Playable
from frictus_service.synthesis.scene import CompiledScene


@dataclass(frozen=True, slots=True)
class SceneOrder:
    """Play this scene, or this excitation, from the next block on.

    Attributes
    ----------
    scene : CompiledScene or CompiledExcitation
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

    def ended(self, safety: Safety) -> bool:
        """Return whether the arming that it belongs to is over."""
        return not (self.standing or (safety.energised and safety.armings == self.arming))


@dataclass(frozen=True, slots=True)
class LawOrder:
    """Invert another law from now on, with a scene compiled for it; only while disarmed.

    Attributes
    ----------
    law : FrictionLaw or Inverse
    scene : CompiledScene
    done : threading.Event
        Set once it is in force.
    """

    law: Invertible
    scene: CompiledScene
    done: threading.Event = field(default_factory=threading.Event)


@dataclass(frozen=True, slots=True)
class Orders:
    """Slots of one: a deque's append and popleft need no lock."""

    scene: deque[SceneOrder] = field(default_factory=lambda: deque(maxlen=1))
    law: deque[LawOrder] = field(default_factory=lambda: deque(maxlen=1))
