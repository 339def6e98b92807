"""Which parameters of which effects are tried: all of the catalogue that the base has not."""

from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from frictus_hardware.physics.effect import EffectDefinition
from frictus_hardware.physics.effects import EFFECTS
from frictus_hardware.physics.prediction import Probe, predict
from frictus_hardware.physics.schedule import SlidingConditions
from frictus_hardware.physics.simulator import Simulator
from frictus_service.discovery.evidence.spectral_lines import MAINS_HZ
from frictus_service.discovery.problem.nuisance import ResponseName

MODE_HZ: Final = tuple(float(round(f)) for f in np.geomspace(80.0, 800.0, 13))
"""Where a further mode of the skin is looked for."""


@dataclass(frozen=True, slots=True)
class Candidate:
    """One parameter of an effect, the others held.

    Attributes
    ----------
    effect : str
        Id in `frictus_hardware.physics.effects`.
    parameter : str
        The one that is tried.
    step : float
        At which the derivative is taken.
    held : tuple of (str, float)
        The effect's other parameters.
    squared : bool
        Data follow the square of the parameter (a power), and so the signature is per square.
    positive : bool
        It cannot be negative.
    """

    effect: str
    parameter: str
    step: float
    held: tuple[tuple[str, float], ...] = ()
    squared: bool = False
    positive: bool = False

    @property
    def limits(self) -> tuple[float, float]:
        """Between which coefficients a step more changes something."""
        bounds = next(p for p in EFFECTS[self.effect].parameters if p.name == self.parameter)
        if self.squared:
            return 0.0, bounds.high**2 - self.step**2
        return bounds.low, bounds.high - self.step

    def extend(self, simulator: Simulator, coefficient: float) -> Simulator:
        """Return the simulator with the effect in it.

        Parameters
        ----------
        simulator : Simulator
            A rig and one finger.
        coefficient : float
            The parameter, or its square where data follow that. Limited to its bounds.
        """
        if coefficient == 0.0:
            return simulator
        value = np.sqrt(max(coefficient, 0.0)) if self.squared else coefficient
        effect = EFFECTS[self.effect]
        bounds = next(p for p in effect.parameters if p.name == self.parameter)
        limited = float(np.clip(value, bounds.low, bounds.high))
        return effect.extend(simulator, {**dict(self.held), self.parameter: limited})


def candidates_of(response: ResponseName, present: Collection[str] = ()) -> list[Candidate]:
    """Return the candidates, by id.

    Parameters
    ----------
    response : {'friction', 'mobility'}
    present : collection of str
        Effects that the base model has already.
    """
    found = []
    for name in sorted(EFFECTS):
        effect = EFFECTS[name]
        if effect.response in (response, "both") and name not in present:
            found.extend(_of(effect))
    return found


def _of(effect: EffectDefinition) -> list[Candidate]:
    dose = effect.parameters[0]
    one = Candidate(
        effect.id,
        dose.name,
        dose.step,
        squared=_goes_with_square(effect),
        positive=dose.low >= 0.0,
    )
    if effect.id == "mains_interference":
        return [replace(one, held=(("frequency_hz", line),)) for line in MAINS_HZ]
    if any(parameter.name == "frequency_hz" for parameter in effect.parameters):
        return [replace(one, held=(("frequency_hz", f),)) for f in MODE_HZ]
    return [one]


def _goes_with_square(effect: EffectDefinition) -> bool:
    """Return whether data follow the square of the dose: twice the dose, four times as much."""
    once, twice = (_shown(effect, times) for times in (1.0, 2.0))
    return bool(once > 0.0 and twice > 3.0 * once)


def _shown(effect: EffectDefinition, times: float) -> float:
    """Return the power that a dose puts into a slow stroke without drive."""
    dose = effect.parameters[0]
    one = np.ones(1)
    at = SlidingConditions(10.0 * one, 0.4 * one, 35.0 * one, one, 0.0 * one)
    probe = Probe(100.0 * one, np.zeros(1, dtype=np.complex128), 0.0 * one, 0.0 * one, at)
    simulator = effect.extend(Simulator(), {dose.name: times * dose.step})
    seen = predict(simulator, probe, Simulator().mount)
    return float(np.square(seen.line_n[0]) + seen.low_n2[0])
