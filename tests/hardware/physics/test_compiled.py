"""The standard stages in one pass, against the stages one after the other."""

from dataclasses import replace

import numpy as np
import pytest

from frictus_hardware.physics.compiled import Converter, OnePass, compiled
from frictus_hardware.physics.effects import EFFECTS, extended
from frictus_hardware.physics.friction import FrictionLaw
from frictus_hardware.physics.linear import Mobility, Mount
from frictus_hardware.physics.screen import Screen
from frictus_hardware.physics.simulator import Simulator
from frictus_hardware.physics.stages import FrictionResponse, Quantisation, SensorNoise
from frictus_hardware.physics.twin import Signals, Twin, simulate

RATE_HZ = 20_000.0
N_SAMPLES = 3_000
BLOCK = 100


def exploring(rng: np.random.Generator) -> Signals:
    """Return a finger that turns, rests and lifts off, under volts that come and go."""
    time_s = np.arange(N_SAMPLES) / RATE_HZ
    velocity = np.column_stack(
        [
            rng.uniform(20.0, 150.0) * np.cos(rng.uniform(5.0, 60.0) * time_s),
            rng.uniform(0.0, 20.0) * np.sin(rng.uniform(5.0, 60.0) * time_s),
        ]
    )
    velocity[1_000:1_300] = 0.0
    touching = np.ones(N_SAMPLES, dtype=np.bool_)
    touching[1_700:1_900] = False
    volts = rng.uniform(-75.0, 75.0, N_SAMPLES)
    volts[:400] = 0.0
    volts[2_200:] = 0.0
    return Signals.driven(
        RATE_HZ,
        volts,
        np.cumsum(velocity, axis=0) / RATE_HZ,
        velocity,
        rng.uniform(0.05, 2.0) * (1.0 + 0.1 * np.sin(11.0 * time_s)),
        touching,
    )


def some_finger(rng: np.random.Generator) -> Simulator:
    mount = Mount(
        sensor_hz=rng.uniform(500.0, 3_000.0), sensor_damping_ratio=rng.uniform(0.01, 0.5)
    )
    return Simulator(
        law=FrictionLaw(
            gain_n=rng.uniform(0.05, 1.5),
            cutoff_0_hz=rng.uniform(1.0, 1_000.0),
            slope_hz_per_mm_s=rng.uniform(0.0, 30.0),
            speed_range_mm_s=(rng.uniform(0.0, 30.0), rng.uniform(50.0, 200.0)),
        ),
        mobility=Mobility(
            rng.uniform(5e-4, 5e-3), rng.uniform(0.1, 5.0), rng.uniform(50.0, 2_000.0)
        ),
        mount=mount.lateral if rng.random() < 0.7 else None,
        normal_mount=mount.normal if rng.random() < 0.7 else None,
    )


def assert_same(found: Signals, plain: Signals) -> None:
    assert found.sample_rate_hz == plain.sample_rate_hz
    # The mount's filter, of fourth order, amplifies rounding, by (20 kHz / 2 pi 500 Hz)^4 /
    # 0.02, some 1e5, at 500 Hz and a damping of 0.01; how a sum is rounded, compilers decide.
    for name, expected in plain.arrays().items():
        largest = float(np.max(np.abs(expected), initial=0.0))
        np.testing.assert_allclose(
            found.arrays()[name], expected, rtol=1e-9, atol=1e-9 * largest, err_msg=name
        )


@pytest.mark.parametrize("seed", range(20))
def test_one_pass_does_what_the_stages_do_whatever_the_blocks(seed: int) -> None:
    rng = np.random.default_rng(seed)
    signals = exploring(rng)
    sensors = (SensorNoise(0.002, 0.05, seed), Quantisation())
    twin = some_finger(rng).twin(
        Screen(peak_v=75.0), rng.uniform(0.1, 1.0), sensors if seed % 2 else ()
    )
    fused = compiled(twin)
    assert [type(stage) for stage in fused.stages] == [OnePass, *[Converter] * (seed % 2)]
    assert_same(simulate(fused, signals, BLOCK), simulate(twin, signals))
    assert_same(simulate(fused, signals, 7), simulate(twin, signals, 7))


def test_a_run_does_not_change_the_state_it_was_given() -> None:
    rng = np.random.default_rng(3)
    signals = exploring(rng)
    fused = compiled(some_finger(rng).twin(Screen(), 0.5))
    _, states = fused.run(signals.rows(slice(0, 500)), fused.initial())
    again = signals.rows(slice(500, 900))
    first, _ = fused.run(again, states)
    second, _ = fused.run(again, states)
    assert_same(second, first)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", sorted(EFFECTS))
def test_every_effect_acts_as_in_the_stages(name: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    signals = exploring(rng)
    values = {each.name: rng.uniform(each.low, each.high) for each in EFFECTS[name].parameters}
    if name == "channel_delay":
        values["delay_s"] = abs(values["delay_s"])  # what is early cannot be played
    simulator = extended(some_finger(rng), [(name, values)])
    twin = simulator.twin(Screen(), 0.5, minutes=7.0, seed=seed)
    assert_same(simulate(compiled(twin), signals, BLOCK), simulate(twin, signals, BLOCK))


def test_a_response_that_does_more_stays_in_stages() -> None:
    twin = Simulator().twin(Screen(), 0.5)
    stages = tuple(
        replace(stage, delay_s=1e-3) if isinstance(stage, FrictionResponse) else stage
        for stage in twin.stages
    )
    assert compiled(Twin(stages)).stages == stages
