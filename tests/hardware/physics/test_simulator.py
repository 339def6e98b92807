"""Every effect: what the twin does in time is what is predicted of it in frequency."""

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
from tests.hardware.physics.sliding import (
    NOMINAL,
    RATE_HZ,
    Slide,
    amplitudes,
    estimated,
    estimated_mobility,
    tones,
)

from frictus_hardware.errors import EffectParameterError
from frictus_hardware.physics.effects import EFFECTS, KNOWN, extended
from frictus_hardware.physics.screen import Screen
from frictus_hardware.physics.simulator import Simulator, predict
from frictus_hardware.physics.stages import Quantisation, SensorNoise, standard_twin
from frictus_hardware.physics.twin import simulate

TONES_HZ = np.array([61.0, 253.0, 601.0, 997.0, 1703.0])

REALISTIC = {
    "speed_dependent_cutoff": 6.0,
    "force_dependent_cutoff": 0.18,
    "cutoff_drift": 0.02,
    "speed_dependent_gain": 0.25,
    "force_dependent_gain": 0.18,
    "gain_drift": 0.02,
    "direction_asymmetry": 0.06,
    "position_dependent_gain": 0.005,
    "charge_leakage": 1.0,
    "channel_delay": 4e-6,
    "mount_resonance_shift": 0.0048,
    "fractional_rolloff": 0.12,
    "residual_quadratic": 0.0048,
    "amplitude_compression": 0.0048,
    "mains_interference": 0.004,
    "stick_slip": 0.06,
    "speed_dependent_stiffness": 0.25,
    "speed_dependent_mass": 0.25,
    "fractional_damping": 0.12,
    "second_mode": 0.3,
}
FRICTION = [id_ for id_, effect in EFFECTS.items() if effect.response != "mobility"]
MOBILITY = [id_ for id_, effect in EFFECTS.items() if effect.response != "friction"]


def negative(id_: str) -> bool:
    """Whether an effect can be played with a negative size."""
    return EFFECTS[id_].parameters[0].low < 0.0 and id_ != "channel_delay"


def dosed(id_: str, size: float) -> tuple[str, dict[str, float]]:
    """An effect as a model lists it."""
    return id_, {EFFECTS[id_].parameters[0].name: size}


def drawn(rng: np.random.Generator) -> Slide:
    """A steady slide anywhere in the range."""
    return Slide(
        speed_mm_s=rng.uniform(22.0, 70.0),
        force_n=rng.uniform(0.2, 0.6),
        direction=float(rng.choice([-1.0, 1.0])),
        position_mm=rng.uniform(15.0, 55.0),
        minutes=rng.uniform(0.0, 20.0),
        first_sample=int(rng.integers(-10_000, 10_000)),
        seed=int(rng.integers(2**31)),
    )


def assert_agree(found: np.ndarray, expected: np.ndarray) -> None:
    ratio = found / expected
    np.testing.assert_allclose(np.abs(ratio), 1.0, atol=3e-3)
    np.testing.assert_allclose(np.angle(ratio, deg=True), 0.0, atol=0.2)


def test_every_effect_has_its_size_here() -> None:
    assert set(REALISTIC) == set(EFFECTS)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("id_", [id_ for id_ in FRICTION if id_ != "stick_slip"])
def test_friction_is_as_predicted(id_: str, sign: float, rng: np.random.Generator) -> None:
    if sign < 0.0 and not negative(id_):
        sign = 2.0
    simulator = extended(Simulator(), [dosed(id_, sign * REALISTIC[id_])])
    slide = drawn(rng)
    found, probe = estimated(simulator, slide, TONES_HZ, tones(TONES_HZ, rng))
    expected = predict(simulator, probe, NOMINAL)
    assert_agree(found.friction, expected.friction)
    if simulator.hum:
        np.testing.assert_allclose(found.line_n, expected.line_n, rtol=3e-3)


@pytest.mark.parametrize("id_", ["residual_quadratic", "amplitude_compression"])
@pytest.mark.parametrize("tone_hz", [83.0, 251.0, 607.0])
def test_harmonics_are_as_predicted(id_: str, tone_hz: float, rng: np.random.Generator) -> None:
    # A delay and a shifted mount move them too.
    effects = [dosed(id_, REALISTIC[id_]), ("channel_delay", {"delay_s": 70e-6})]
    simulator = extended(Simulator(), [*effects, ("mount_resonance_shift", {"share": 0.05})])
    tone = np.array([tone_hz])
    found, probe = estimated(
        simulator, drawn(rng), tone, tones(tone, rng, rng.uniform(0.2, 0.49))
    )
    expected = predict(simulator, probe, NOMINAL)
    for name in ("second", "third"):
        got, wanted = getattr(found, name), getattr(expected, name)
        np.testing.assert_allclose(got, wanted, rtol=5e-3, atol=2e-5)
    assert max(abs(found.second[0]), abs(found.third[0])) > 1e-4


def test_static_map_acts_on_the_sum_of_all_tones(rng: np.random.Generator) -> None:
    # No tone is a sum or difference of others.
    several = np.array([97.0, 311.0, 743.0])
    strong = [dosed("residual_quadratic", 0.1), dosed("amplitude_compression", 0.08)]
    simulator = extended(Simulator(), strong)
    found, probe = estimated(simulator, drawn(rng), several, tones(several, rng))
    assert_agree(found.friction, predict(simulator, probe, NOMINAL).friction)


def test_at_full_modulation_harmonics_are_the_shares_they_are_named_after() -> None:
    half, eighth = np.full(1, 0.5), np.full(1, 0.125)
    square = extended(Simulator(), [dosed("residual_quadratic", 0.02)]).drive_map
    made = square.harmonics(half, half, eighth)
    assert made.second[0] / (made.gain[0] * 0.5) == pytest.approx(0.02)
    assert made.gain[0] == pytest.approx(1.0)
    cubic = extended(Simulator(), [dosed("amplitude_compression", 0.02)]).drive_map
    made = cubic.harmonics(half, half, eighth)
    assert made.third[0] / (made.gain[0] * 0.5) == pytest.approx(-0.02 / 1.02)
    assert made.second[0] == pytest.approx(0.0, abs=1e-15)
    for drive_map in (square, cubic):
        ends = np.array([0.0, 1.0])
        np.testing.assert_allclose(ends * drive_map.factor(ends), ends)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("id_", MOBILITY)
def test_mobility_is_as_predicted(id_: str, sign: float, rng: np.random.Generator) -> None:
    sign = sign if negative(id_) else abs(sign)
    base = Simulator(response="mobility")
    simulator = extended(base, [dosed(id_, sign * REALISTIC[id_])])
    slide = drawn(rng)
    found, probe = estimated_mobility(simulator, slide, TONES_HZ, tones(TONES_HZ, rng))
    expected = predict(simulator, probe, NOMINAL).mobility
    assert_agree(found, expected)
    assert not np.allclose(expected, predict(base, probe, NOMINAL).mobility, rtol=1e-4)


def test_mobility_of_all_at_once_is_as_predicted(rng: np.random.Generator) -> None:
    simulator = extended(
        Simulator(response="mobility"), [dosed(id_, REALISTIC[id_]) for id_ in MOBILITY]
    )
    found, probe = estimated_mobility(simulator, drawn(rng), TONES_HZ, tones(TONES_HZ, rng))
    assert_agree(found, predict(simulator, probe, NOMINAL).mobility)


def test_a_delay_is_the_drives_for_friction_and_the_skins_for_mobility() -> None:
    late = dosed("channel_delay", 1e-4)
    driven = extended(Simulator(), [late])
    felt = extended(Simulator(response="mobility"), [late])
    assert (driven.delay_s, driven.skin_delay_s) == (1e-4, 0.0)
    assert (felt.delay_s, felt.skin_delay_s) == (0.0, 1e-4)


@pytest.mark.parametrize("response", ["friction", "mobility"])
def test_an_early_channel_cannot_be_played(
    response: Literal["friction", "mobility"], rng: np.random.Generator
) -> None:
    early = extended(Simulator(response=response), [dosed("channel_delay", -1e-4)])
    with pytest.raises(EffectParameterError, match=r"early by 0.0001 s cannot be played"):
        drawn(rng).twin(early)


@pytest.mark.parametrize("samples", [1, 7])
def test_a_delay_of_whole_samples_shifts_friction_by_them(
    samples: int, rng: np.random.Generator
) -> None:
    slide, drive = drawn(rng), rng.random(600)
    late = extended(Simulator(), [dosed("channel_delay", samples / RATE_HZ)])
    base, delayed = (
        simulate(slide.twin(each), slide.signals(drive)) for each in (Simulator(), late)
    )
    np.testing.assert_allclose(
        delayed.friction_n[samples:], base.friction_n[:-samples], atol=1e-12
    )


def test_stick_slip_has_the_power_that_is_predicted(rng: np.random.Generator) -> None:
    simulator = extended(Simulator(), [dosed("stick_slip", REALISTIC["stick_slip"])])
    slide = replace(drawn(rng), speed_mm_s=24.0)  # 12, 24, 36 Hz: two of them in the band
    drive = tones(TONES_HZ, rng)
    driven = simulate(slide.twin(simulator), slide.signals(drive))
    alone = simulate(slide.twin(Simulator()), slide.signals(0.0 * drive))
    still = simulate(slide.twin(simulator), slide.signals(0.0 * drive))
    lines = amplitudes(
        slide.direction * (still.force_n - alone.force_n)[:, 0],
        12.0 * np.arange(1.0, 7.0),
        RATE_HZ,
    )
    peak_n = REALISTIC["stick_slip"] * np.exp(-24.0 / 20.0) * 1.160
    np.testing.assert_allclose(np.abs(lines), 2.0 / np.pi * peak_n / np.arange(1, 7), rtol=0.02)
    probe = slide.probe(TONES_HZ, np.full(TONES_HZ.size, 0.1 + 0.0j))
    predicted = predict(simulator, probe, NOMINAL)
    power = np.sum(np.square(np.abs(lines[:2]))) / 2.0
    np.testing.assert_allclose(predicted.low_n2, power, rtol=0.03)
    base = predict(Simulator(), probe, NOMINAL)
    np.testing.assert_array_equal(predicted.friction, base.friction)
    assert not np.any(base.low_n2)
    # With a drive it is the same: nothing of it goes through the electrostatics.
    undisturbed = simulate(slide.twin(Simulator()), slide.signals(drive))
    np.testing.assert_allclose(
        driven.friction_n - undisturbed.friction_n,
        still.friction_n - alone.friction_n,
        atol=1e-12,
    )


def test_nothing_declared_is_the_standard_twin() -> None:
    sensors = (SensorNoise(0.002, 0.05, 7), Quantisation())
    twin = Simulator().twin(Screen(), 0.5, sensors)
    assert twin == standard_twin(friction_coefficient=0.5, sensors=sensors)


@pytest.mark.parametrize("id_", EFFECTS)
def test_none_of_an_effect_changes_nothing(id_: str, rng: np.random.Generator) -> None:
    base = Simulator(response="mobility" if id_ in MOBILITY else "friction")
    assert extended(base, [dosed(id_, 0.0)]) == base
    probe = drawn(rng).probe(TONES_HZ, np.full(TONES_HZ.size, 0.1 + 0.2j))
    nothing = {p.name: p.default or 0.0 for p in EFFECTS[id_].parameters}
    as_is, expected = (
        predict(simulator, probe, NOMINAL)
        for simulator in (EFFECTS[id_].extend(base, nothing), base)
    )
    for name in ("friction", "second", "third", "mobility", "line_n", "low_n2"):
        np.testing.assert_allclose(getattr(as_is, name), getattr(expected, name), rtol=1e-12)


@pytest.mark.parametrize("id_", sorted(KNOWN))
def test_what_is_not_given_is_at_its_default(id_: str) -> None:
    effect = KNOWN[id_]
    given = {each.name: each.low for each in effect.parameters if each.default is None}
    usual = {each.name: each.default for each in effect.parameters if each.default is not None}
    whole = effect.apply(Simulator(), {**given, **usual})
    assert repr(effect.extend(Simulator(), given)) == repr(whole)


def test_order_of_effects_does_not_matter(rng: np.random.Generator) -> None:
    everything = [dosed(id_, REALISTIC[id_]) for id_ in EFFECTS]
    shuffled = [everything[k] for k in rng.permutation(len(everything))]
    slide = drawn(rng)
    probe = slide.probe(TONES_HZ, np.full(TONES_HZ.size, 0.1 + 0.2j))
    one, other = (extended(Simulator(), order) for order in (everything, shuffled))
    for name in ("friction", "second", "third", "mobility", "line_n", "low_n2"):
        np.testing.assert_allclose(
            getattr(predict(one, probe, NOMINAL), name),
            getattr(predict(other, probe, NOMINAL), name),
            rtol=1e-9,
        )
    signals = slide.signals(tones(TONES_HZ, rng)[:400])
    first, second = (simulate(slide.twin(each), signals) for each in (one, other))
    np.testing.assert_allclose(first.force_n, second.force_n, atol=1e-9)
    np.testing.assert_allclose(first.accel_m_s2, second.accel_m_s2, atol=1e-6)


def test_any_split_gives_the_same_output(rng: np.random.Generator) -> None:
    simulator = extended(
        Simulator(), [dosed(id_, REALISTIC[id_]) for id_ in EFFECTS if id_ != "channel_delay"]
    )
    simulator = replace(simulator, delay_s=1.3e-4, skin_delay_s=1.1e-4)
    slide = drawn(rng)
    signals = slide.signals(rng.random(1_500))
    signals.velocity_mm_s[:, 0] = 80.0 * np.sin(np.arange(1_500) / 300.0)
    signals.normal_force_n[700:800] = 0.0
    signals.in_contact[700:800] = False
    twin = slide.twin(simulator)
    whole = simulate(twin, signals, 1_500)
    assert all(np.all(np.isfinite(array)) for array in whole.arrays().values())
    cuts = np.unique(rng.integers(1, 1_500, 12)).tolist()
    states, first = twin.initial(), 0
    for end in [*cuts, 1_500]:
        block, states = twin.run(signals.rows(slice(first, end)), states)
        for name, array in block.arrays().items():
            np.testing.assert_array_equal(array, whole.arrays()[name][first:end], err_msg=name)
        first = end


def test_effects_follow_the_speed_no_further_than_the_law(rng: np.random.Generator) -> None:
    simulator = extended(
        Simulator(),
        [dosed("speed_dependent_gain", 1.0), dosed("speed_dependent_cutoff", 6.0)],
    )
    message = np.full(TONES_HZ.size, 0.1 + 0.0j)
    at_5, at_20, at_30 = (
        predict(simulator, Slide(speed_mm_s=v).probe(TONES_HZ, message), NOMINAL).friction
        for v in (5.0, 20.0, 30.0)
    )
    np.testing.assert_array_equal(at_5, at_20)
    assert not np.any(at_20 == at_30)


def test_where_there_is_no_mount_nothing_resonates(rng: np.random.Generator) -> None:
    bare = Simulator(mount=None, normal_mount=None)
    assert extended(bare, [dosed("mount_resonance_shift", 0.01)]) == bare
    slide, drive = Slide(), tones(TONES_HZ, rng)
    out = simulate(slide.twin(bare), slide.signals(drive))
    np.testing.assert_array_equal(out.force_n, -out.finger_force_n)
    probe = slide.probe(TONES_HZ, np.ones(5, np.complex128))
    np.testing.assert_array_equal(
        predict(bare, probe, None).friction, predict(Simulator(), probe, NOMINAL).friction
    )
