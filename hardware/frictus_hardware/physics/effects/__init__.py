"""The catalogue of effects, found by walking this package: each module names its `EFFECTS`."""

from collections.abc import Iterable, Mapping
from importlib import import_module
from pkgutil import iter_modules
from types import MappingProxyType
from typing import Final

from frictus_hardware.errors import EffectParameterError, UnknownEffectError
from frictus_hardware.physics.effect import EffectDefinition, Parameter
from frictus_hardware.physics.forms import FORMS
from frictus_hardware.physics.simulator import Simulator

__all__ = ["EFFECTS", "FORMS", "KNOWN", "EffectDefinition", "Parameter", "extended"]


def _found() -> dict[str, EffectDefinition]:
    modules = [import_module(f"{__name__}.{module.name}") for module in iter_modules(__path__)]
    effects: list[EffectDefinition] = [
        effect for module in modules for effect in module.EFFECTS
    ]
    return {effect.id: effect for effect in sorted(effects, key=lambda effect: effect.id)}


EFFECTS: Final[Mapping[str, EffectDefinition]] = MappingProxyType(_found())
"""By id, in alphabetical order: each has a cause of the same id in discovery's catalogue."""

KNOWN: Final[Mapping[str, EffectDefinition]] = MappingProxyType({**EFFECTS, **FORMS})
"""All that a model may have: effects with a cause, and forms without one."""


def extended(
    simulator: Simulator, effects: Iterable[tuple[str, Mapping[str, float]]]
) -> Simulator:
    """Return a simulator with effects in it, as a `model/1` lists them.

    Parameters
    ----------
    simulator : Simulator
        A rig and one finger.
    effects : iterable of (id, parameters)
        An effect of which the dose, its first parameter, is 0 changes nothing.

    Raises
    ------
    UnknownEffectError
        If no effect has that id.
    EffectParameterError
        If a parameter is missing, unknown, not finite or out of its range, or effects that add
        up leave what can be simulated.
    """
    for id_, parameters in effects:
        if id_ not in KNOWN:
            raise UnknownEffectError(
                f"no effect {id_!r} is known; known are: {', '.join(KNOWN)}"
            )
        effect = KNOWN[id_]
        values = _checked(effect, parameters)
        if values[effect.parameters[0].name] != 0.0:
            simulator = effect.apply(simulator, values)
    _check_orders(simulator)
    return simulator


def _check_orders(simulator: Simulator) -> None:
    """Refuse orders that no poles and zeros make: several effects add them up."""
    orders = {
        "the roll-off": simulator.excess_order,
        "the skin's damping": simulator.skin.damping_excess_order,
    }
    for name, order in orders.items():
        if not abs(order) < 1.0:
            raise EffectParameterError(
                f"the excess orders of {name} add up to {order:g}; "
                "accepted: above -1 and below 1"
            )


def _checked(effect: EffectDefinition, given: Mapping[str, float]) -> dict[str, float]:
    """Return the value of every parameter of an effect."""
    known = {parameter.name: parameter for parameter in effect.parameters}
    for name in given:
        if name not in known:
            raise EffectParameterError(
                f"{effect.id} has no parameter {name!r}; it has: {', '.join(known)}"
            )
    values = {}
    for name, parameter in known.items():
        value = given.get(name, parameter.default)
        if value is None:
            raise EffectParameterError(
                f"{effect.id} lacks its parameter {name} ({_accepted(parameter)})"
            )
        if not parameter.low <= value <= parameter.high:
            raise EffectParameterError(
                f"{effect.id}: {name} is {value:g}; {_accepted(parameter)}"
            )
        values[name] = float(value)
    return values


def _accepted(parameter: Parameter) -> str:
    return f"accepted: {parameter.low:g} to {parameter.high:g} {parameter.unit}"
