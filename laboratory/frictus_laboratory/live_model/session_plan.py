"""What a simulated session is to be: person, texture, motion, disturbance."""

from dataclasses import dataclass, field

from frictus.messages import AdaptationPolicy
from frictus.model import Model
from frictus.textures import Texture
from frictus_hardware.simulated.config import SimulatedConfig, SimulatedParticipant
from frictus_hardware.simulated.human import HumanStrokes
from frictus_hardware.simulated.strokes import SteadyStrokes
from frictus_laboratory.live_model.disturbances import Disturbance
from frictus_laboratory.live_model.motion import (
    KnownMotion,
    Motion,
    PredictedPath,
)


@dataclass(frozen=True, slots=True)
class SessionPlan:
    """What a session is made of.

    Attributes
    ----------
    person : SimulatedParticipant
        Whose finger explores.
    texture : Texture
        Played as strongly as the drive allows.
    seconds : float
        How long.
    seed : int
        Of strokes and noise.
    first : Model
        In force at the beginning.
    policy : {'observe', 'suggest', 'adapt'}
        What becomes of the estimate.
    disturbance : Disturbance
        What is not as the tracker takes it to be.
    known_motion : bool
        Whether the rig knows the finger's motion, or predicts it from its sensors.
    lift_probability : float
        How often the finger leaves the screen between two strokes.
    steady_mm_s : float or None
        Of strokes at one speed; None: free ones.
    """

    person: SimulatedParticipant
    texture: Texture
    seconds: float
    seed: int
    first: Model
    policy: AdaptationPolicy = "observe"
    disturbance: Disturbance = field(default_factory=Disturbance)
    known_motion: bool = False
    lift_probability: float = 0.0
    steady_mm_s: float | None = None


def config_of(plan: SessionPlan) -> SimulatedConfig:
    """Return the rig and the finger of a session.

    Parameters
    ----------
    plan : SessionPlan
        What it is made of.
    """
    finger: HumanStrokes | SteadyStrokes
    if plan.steady_mm_s is None:
        finger = HumanStrokes(lift_probability=plan.lift_probability)
    else:
        finger = SteadyStrokes(speed_mm_s=plan.steady_mm_s)
    return SimulatedConfig(seed=plan.seed, finger=finger, participant=plan.person)


def motion_of(plan: SessionPlan) -> Motion:
    """Return the finger's motion, and what the rig takes it to be.

    Parameters
    ----------
    plan : SessionPlan
        What the session is made of.
    """
    config = config_of(plan)
    return KnownMotion(config) if plan.known_motion else PredictedPath(config, plan.seconds)
