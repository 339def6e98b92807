"""An effect: an extension of the simulator with a name, bounds and units."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Literal

from frictus_hardware.physics.schedule import Term
from frictus_hardware.physics.simulator import Simulator

Values = Mapping[str, float]


@dataclass(frozen=True, slots=True)
class Parameter:
    """One number of an effect.

    Attributes
    ----------
    name, unit : str
        As people read it, and its unit.
    low, high : float
        Accepted, both included.
    step : float
        A small change, at which a derivative may be taken.
    default : float or None
        Of a parameter that may be left out. The first of an effect has none: it is the dose,
        and 0 of it is no effect.
    """

    name: str
    unit: str
    low: float
    high: float
    step: float
    default: float | None = None


@dataclass(frozen=True, slots=True)
class EffectDefinition:
    """What an effect does to the simulator.

    Attributes
    ----------
    id : str
        The same as that of its cause in discovery's catalogue.
    equation : str
        In one sentence, as the catalogue prints it.
    response : {'friction', 'mobility', 'both'}
        In which it shows.
    scope : {'participant', 'instrument'}
        Whose parameters they are: each finger's own, or the rig's.
    parameters : tuple of Parameter
        The dose first.
    apply : callable
        ``apply(simulator, values)`` returns the simulator with the effect, given the value of
        every parameter.
    """

    id: str
    equation: str
    response: Literal["friction", "mobility", "both"]
    scope: Literal["participant", "instrument"]
    parameters: tuple[Parameter, ...]
    apply: Callable[[Simulator, Values], Simulator]

    def extend(self, simulator: Simulator, given: Values) -> Simulator:
        """Return the simulator with the effect in it.

        Parameters
        ----------
        simulator : Simulator
            A rig and one finger.
        given : mapping of str to float
            What is not given is at its default. Bounds are not checked here, but in
            `effects.extended`.
        """
        usual = {
            each.name: each.default for each in self.parameters if each.default is not None
        }
        return self.apply(simulator, {**usual, **given})


def with_term(
    simulator: Simulator,
    part: Literal["gain_factors", "cutoff_factors", "cutoff_terms_hz"],
    term: Term,
) -> Simulator:
    """Return the simulator with one term more in a part of its schedule.

    Parameters
    ----------
    simulator : Simulator
        To extend.
    part : {'gain_factors', 'cutoff_factors', 'cutoff_terms_hz'}
        Of its schedule.
    term : Term
        Factors have no unit, terms of the cutoff are in Hz.
    """
    terms = (*getattr(simulator.schedule, part), term)
    return replace(simulator, schedule=replace(simulator.schedule, **{part: terms}))
