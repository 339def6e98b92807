"""An effect of one's own: friction that grows while the skin warms up, and then stays.

An effect turns a simulator into another one. Put it in a module of
`frictus_hardware/physics/effects/`, and models and the twin know it; put a `Cause` of the same
id in a module of `frictus_service/discovery/catalogue/causes/`, and discovery looks for it.
"""

from dataclasses import dataclass

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.effect import EffectDefinition, Parameter, Values, with_term
from frictus_hardware.physics.friction import FrictionLaw
from frictus_hardware.physics.schedule import SlidingConditions
from frictus_hardware.physics.simulator import Probe, Simulator, predict


@dataclass(frozen=True, slots=True)
class WarmUp:
    """``1 + rise (1 - exp(-t / tau))``, t since the session began."""

    rise: float
    tau_minutes: float

    def at(self, circumstances: SlidingConditions) -> FloatArray:
        """Return it in given circumstances."""
        return 1.0 + self.rise * (1.0 - np.exp(-circumstances.minutes / self.tau_minutes))


def apply(simulator: Simulator, parameters: Values) -> Simulator:
    """Return a simulator whose gain follows the skin's temperature."""
    factor = WarmUp(parameters["rise"], parameters["tau_minutes"])
    return with_term(simulator, "gain_factors", factor)


EFFECT = EffectDefinition(
    id="skin_warm_up",
    equation="The gain rises while the skin warms: ``g (1 + a (1 - exp(-t / tau)))``.",
    response="friction",
    scope="participant",
    parameters=(
        Parameter("rise", "1", 0.0, 1.0, 0.01),
        Parameter("tau_minutes", "min", 0.5, 60.0, 0.1, default=5.0),
    ),
    apply=apply,
)

minutes = np.array([0.0, 5.0, 30.0])
ones = np.ones(minutes.size)
probe = Probe(
    tone_hz=100.0 * ones,
    message=0.5 * ones.astype(np.complex128),
    message_mean=0.5 * ones,
    message_power=0.125 * ones,
    circumstances=SlidingConditions(60.0 * ones, 0.4 * ones, 35.0 * ones, ones, minutes),
)
base = Simulator(law=FrictionLaw())
warm = EFFECT.extend(base, {"rise": 0.3, "tau_minutes": 5.0})
cold_n, warm_n = (np.abs(predict(each, probe, None).friction) for each in (base, warm))
for minute, ratio in zip(minutes, warm_n / cold_n, strict=True):
    print(f"after {minute:4.1f} min: {ratio:.3f} of the cold finger's friction")
