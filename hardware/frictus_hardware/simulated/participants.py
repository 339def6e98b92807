"""Participants: finger and skin of one person, and a population to draw them from."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import numpy as np
from pydantic import Field

from frictus_hardware.simulated.strict import NonNegative, Positive, StrictModel

if TYPE_CHECKING:
    from frictus_hardware.physics.friction import FrictionLaw
    from frictus_hardware.physics.mobility import Mobility
    from frictus_hardware.physics.simulator import Simulator


class ParticipantEffect(StrictModel):
    """An effect that a finger, or the rig under it, has beyond the law.

    Attributes
    ----------
    id : str
        One of `frictus_hardware.physics.effects.EFFECTS`.
    parameters : dict
        By name, in the units that the effect states.
    """

    id: str = Field(min_length=1, max_length=100)
    parameters: dict[str, float] = Field(default_factory=dict)


class Participant(StrictModel):
    """One person's finger on the screen. The defaults are the paper's values.

    Attributes
    ----------
    gain_n, cutoff_0_hz, slope_hz_per_mm_s : float
        The friction law.
    mass_kg, damping_n_s_m, stiffness_n_m : float
        The skin.
    friction_coefficient : float
        Of finger and glass without drive.
    effects : tuple of ParticipantEffect
        In the order in which they are added.
    """

    gain_n: Positive = 0.39
    cutoff_0_hz: Positive = 385.68
    slope_hz_per_mm_s: NonNegative = 13.811
    mass_kg: Positive = 0.0015
    damping_n_s_m: Positive = 1.3
    stiffness_n_m: Positive = 444.0
    friction_coefficient: float = Field(default=0.5, ge=0.0, le=5.0)
    effects: Annotated[tuple[ParticipantEffect, ...], Field(strict=False)] = ()

    @property
    def law(self) -> "FrictionLaw":
        """The friction law."""
        # Late, because a process that only reads a configuration needs no compiler.
        from frictus_hardware.physics.friction import FrictionLaw

        return FrictionLaw(self.gain_n, self.cutoff_0_hz, self.slope_hz_per_mm_s)

    @property
    def mobility(self) -> "Mobility":
        """The skin."""
        from frictus_hardware.physics.mobility import Mobility

        return Mobility(self.mass_kg, self.damping_n_s_m, self.stiffness_n_m)

    @property
    def simulator(self) -> "Simulator":
        """Law and skin, with the effects in them.

        Raises
        ------
        UnknownEffectError, EffectParameterError
            If an effect is not known, or a parameter missing, unknown or out of its range.
        """
        from frictus_hardware.physics.effects import extended
        from frictus_hardware.physics.simulator import Simulator

        bare = Simulator(law=self.law, mobility=self.mobility)
        return extended(bare, [(effect.id, effect.parameters) for effect in self.effects])


SPREAD = {
    "gain_n": 0.35,
    "cutoff_0_hz": 0.25,
    "slope_hz_per_mm_s": 0.30,
    "mass_kg": 0.30,
    "damping_n_s_m": 0.25,
    "stiffness_n_m": 0.35,
    "friction_coefficient": 0.30,
}
"""Standard deviation of the logarithm over the population. The paper shows box plots only;
these are assumed, of the size of its boxes."""


def draw_participant(rng: np.random.Generator) -> Participant:
    """Return a random participant; each parameter is lognormal around the paper's value.

    Parameters
    ----------
    rng : Generator
        Source of everything random.
    """
    middle = Participant().model_dump()
    return Participant(
        **{
            name: middle[name] * float(np.exp(spread * rng.standard_normal()))
            for name, spread in SPREAD.items()
        }
    )


@dataclass(frozen=True, slots=True)
class WithinPersonScatter:
    """What varies within a person, as shares of the value: standard deviations.

    The paper's residuals (72 % of the gain, 31 % of the middle cutoff) also hold the errors of
    its estimator; this is the part that is taken as true.

    Attributes
    ----------
    gain_per_trial : float
        The contact is made anew in each trial.
    cutoff_per_condition, skin_per_condition : float
        Of speed and force; `skin` of mass, damping and stiffness each.
    """

    gain_per_trial: float = 0.10
    cutoff_per_condition: float = 0.05
    skin_per_condition: float = 0.05
