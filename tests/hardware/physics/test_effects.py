"""The catalogue of effects: what is found, what is accepted, what is refused."""

from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from frictus_hardware.errors import EffectParameterError, HardwareError, UnknownEffectError
from frictus_hardware.physics import effects
from frictus_hardware.physics.effects import EFFECTS, extended
from frictus_hardware.physics.simulator import Simulator


def test_the_catalogue_holds_every_effect_of_its_modules_once() -> None:
    folder = Path(effects.__file__).parent
    modules = [
        import_module(f"{effects.__name__}.{path.stem}")
        for path in folder.glob("*.py")
        if path.stem != "__init__"
    ]
    ids = sorted(effect.id for module in modules for effect in module.EFFECTS)
    assert ids == list(EFFECTS)
    assert all(effect.id == id_ for id_, effect in EFFECTS.items())


@pytest.mark.parametrize("id_", EFFECTS)
def test_parameters_have_a_dose_bounds_and_a_step_within_them(id_: str) -> None:
    dose, *others = EFFECTS[id_].parameters
    assert dose.default is None
    assert dose.low <= 0.0 < dose.high
    for parameter in EFFECTS[id_].parameters:
        assert 0.0 < parameter.step < parameter.high - parameter.low
        assert parameter.unit
    for other in others:
        assert other.default is not None
        assert other.low <= other.default <= other.high


@pytest.mark.parametrize("id_", EFFECTS)
def test_bounds_are_accepted_and_what_lies_beyond_is_refused_with_them(id_: str) -> None:
    dose = EFFECTS[id_].parameters[0]
    for value in (dose.low, dose.high):
        extended(Simulator(), [(id_, {dose.name: value})])
    beyond = 0.1 * (dose.high - dose.low)
    for value in (dose.low - beyond, dose.high + beyond, np.nan, np.inf):
        with pytest.raises(EffectParameterError) as refused:
            extended(Simulator(), [(id_, {dose.name: value})])
        for told in (id_, dose.name, f"{dose.low:g} to {dose.high:g}", dose.unit):
            assert told in str(refused.value)


@pytest.mark.parametrize("id_", ["fractional_rolloff", "fractional_damping"])
def test_orders_that_add_up_to_what_cannot_be_simulated_are_refused(id_: str) -> None:
    """No rational function was found for them, or one that is not stable."""
    for each, whole in ((0.5, "1"), (-0.5, "-1")):
        half = (id_, {"excess_order": each})
        extended(Simulator(), [half, (id_, {"excess_order": each / 2.0})])
        with pytest.raises(EffectParameterError, match=f"add up to {whole}; accepted: above"):
            extended(Simulator(), [half, half])


def test_an_unknown_effect_is_refused_with_the_known_ones() -> None:
    with pytest.raises(UnknownEffectError) as refused:
        extended(Simulator(), [("squeaking", {})])
    assert isinstance(refused.value, HardwareError)
    assert isinstance(refused.value, LookupError)
    assert "'squeaking'" in str(refused.value)
    assert all(id_ in str(refused.value) for id_ in EFFECTS)


def test_missing_and_unknown_parameters_are_refused() -> None:
    with pytest.raises(EffectParameterError, match="lacks its parameter delay_s"):
        extended(Simulator(), [("channel_delay", {})])
    with pytest.raises(EffectParameterError, match="no parameter 'delay_ms'; it has: delay_s"):
        extended(Simulator(), [("channel_delay", {"delay_ms": 1.0})])


def test_a_parameter_with_a_default_may_be_left_out() -> None:
    hum = extended(Simulator(), [("mains_interference", {"amplitude_n": 0.01})]).hum
    assert [line.frequency_hz for line in hum] == [50.0]
    both = {"amplitude_n": 0.01, "frequency_hz": 60.0}
    other = extended(Simulator(), [("mains_interference", both)]).hum
    assert [line.frequency_hz for line in other] == [60.0]
