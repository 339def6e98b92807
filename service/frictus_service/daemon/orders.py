"""What other threads leave for the loop: slots of one, where the newest wins."""

import math
import threading
from collections import deque
from dataclasses import dataclass, field

from frictus_hardware.physics.friction import FrictionLaw
from frictus_service.synthesis.scene import CompiledScene


@dataclass(frozen=True, slots=True)
class SceneOrder:
    """Play this scene from the next block on.

    Attributes
    ----------
    scene : CompiledScene
    until_s : float
        Monotonic time after which it must not be felt any more; infinite for a standing scene.
    afterwards : CompiledScene or None
        What to fade to then: what a stream feels like without updates.
    """

    scene: CompiledScene
    until_s: float = math.inf
    afterwards: CompiledScene | None = None

    @property
    def standing(self) -> bool:
        """Whether the scene stays when its client goes."""
        return self.afterwards is None


@dataclass(frozen=True, slots=True)
class LawOrder:
    """Invert another law from now on, with a scene compiled for it; only while disarmed.

    Attributes
    ----------
    law : FrictionLaw
    scene : CompiledScene
    done : threading.Event
        Set once it is in force.
    """

    law: FrictionLaw
    scene: CompiledScene
    done: threading.Event = field(default_factory=threading.Event)


@dataclass(frozen=True, slots=True)
class Orders:
    """Slots of one: a deque's append and popleft need no lock."""

    scene: deque[SceneOrder] = field(default_factory=lambda: deque(maxlen=1))
    law: deque[LawOrder] = field(default_factory=lambda: deque(maxlen=1))
