"""The population: medians of the paper, lognormal spread."""

import numpy as np
import pytest

from frictus_hardware.errors import ConfigError
from frictus_hardware.physics.screen import Screen, screen_voltage
from frictus_hardware.simulated.config import (
    SPREAD,
    SimulatedConfig,
    SimulatedParticipant,
    draw_participant,
)
from frictus_hardware.simulated.rig import SimulatedRig
from frictus_hardware.simulated.strokes import SteadyStrokes


def test_medians_and_spread(rng: np.random.Generator) -> None:
    drawn = [draw_participant(rng).model_dump() for _ in range(4_000)]
    for name, spread in SPREAD.items():
        logs = np.log([one[name] for one in drawn])
        error = spread / np.sqrt(len(drawn))
        middle = np.log(SimulatedParticipant().model_dump()[name])
        assert np.mean(logs) == pytest.approx(middle, abs=5.0 * error), name
        assert np.std(logs) == pytest.approx(spread, rel=0.07), name


def test_the_same_seed_draws_the_same_person() -> None:
    one, same, other = (draw_participant(np.random.default_rng(seed)) for seed in (3, 3, 4))
    assert one == same
    assert one != other


def test_a_participant_is_a_law_and_a_skin() -> None:
    person = SimulatedParticipant(gain_n=0.5, mass_kg=0.002)
    assert person.law.gain_n == 0.5
    assert person.mobility.mass_kg == 0.002
    with pytest.raises(ValueError, match="greater than 0"):
        SimulatedParticipant(gain_n=-1.0)


def friction_n(*effects: dict[str, object], seconds: float = 1.0) -> np.ndarray:
    """What a finger with effects feels of a constant half drive, stroking evenly."""
    config = SimulatedConfig.model_validate(
        {
            "clock": "virtual",
            "finger": SteadyStrokes(),
            "participant": {"effects": effects},
        }
    )
    felt = []
    with SimulatedRig(config) as rig:
        rig.arm()
        for _ in range(round(seconds / 0.05)):
            drive = np.full(1_000, 0.5)
            got = rig.exchange(screen_voltage(Screen(), drive, rig.next_play_sample, 20_000.0))
            assert got.truth is not None
            felt.append(got.truth.friction_n)
    return np.concatenate(felt)


def test_a_participant_may_have_effects() -> None:
    bare = friction_n()
    faster = friction_n({"id": "speed_dependent_gain", "parameters": {"exponent": 1.0}})
    uneven = friction_n({"id": "direction_asymmetry", "parameters": {"share": 0.2}})
    steady = slice(2_000, 15_000)  # at 60 mm/s, left to right
    np.testing.assert_allclose(faster[steady], bare[steady], rtol=1e-6)
    np.testing.assert_allclose(uneven[steady], 1.2 * bare[steady], rtol=1e-6)


def test_a_drift_goes_on_while_the_rig_is_open() -> None:
    drifting = friction_n({"id": "gain_drift", "parameters": {"per_minute": 1.0}}, seconds=4.0)
    ratio = drifting[65_000:70_000].mean() / friction_n(seconds=4.0)[65_000:70_000].mean()
    assert ratio == pytest.approx(np.exp(3.0 / 60.0), rel=1e-3)


def test_an_effect_that_is_unknown_or_out_of_range_is_refused() -> None:
    refused: list[dict[str, object]] = [
        {"id": "of_tomorrow"},
        {"id": "direction_asymmetry", "parameters": {"share": 2.0}},
    ]
    for effect in refused:
        with pytest.raises(ConfigError, match=r"of_tomorrow|share"):
            friction_n(effect)
