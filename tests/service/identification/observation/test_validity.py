"""Trials that may not be used are said to be so, with figures; the others are left in peace."""

import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from tests.service.identification.trials import RATE_HZ, STUDY, Made, message, trial, volts

from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.stages import Quantisation
from frictus_service.identification.observation.observe import observe
from frictus_service.identification.observation.response import TrialObservations
from frictus_service.identification.observation.validity import inspect
from frictus_service.study.trial import Trial

pytestmark = pytest.mark.compiled

SECONDS = 4.0


@pytest.fixture
def good(rng: np.random.Generator) -> Trial:
    made = Made((100.0,), 40.0, seconds=SECONDS, noise_n=0.002, noise_m_s2=0.05)
    return trial(made, rng)


def asked(original: Trial, **changed: Any) -> Trial:
    return replace(original, info=replace(original.info, **changed))


def reasons(measured: Trial) -> str:
    seen = observe(measured, STUDY)
    assert seen.valid is not bool(seen.reasons)
    assert all(reason and "\n" not in reason for reason in seen.reasons)
    return "; ".join(seen.reasons)


@pytest.mark.parametrize("speed", [20.0, 40.0, 60.0, 80.0, 100.0])
@pytest.mark.parametrize("force", [0.2, 0.6])
def test_a_good_trial_is_valid(speed: float, force: float, rng: np.random.Generator) -> None:
    made = Made((181.5,), speed, force, SECONDS, wander_n=0.03 * force, noise_n=0.002)
    seen = observe(trial(made, rng), STUDY)
    assert seen.valid, seen.reasons
    assert seen.mean_speed_mm_s == pytest.approx(speed, rel=0.01)
    assert seen.mean_force_n == pytest.approx(force, rel=0.08)


@pytest.mark.parametrize(
    ("off", "valid"), [(0.87, True), (1.13, True), (0.72, False), (1.28, False)]
)
def test_mean_speed(off: float, valid: bool, good: Trial) -> None:
    """Rows hold the speed that was measured: a tenth off its target it is used."""
    said = reasons(asked(good, speed_mm_s=40.0 / off))
    assert ("mean speed over the sweeps is 4" in said or "is 39" in said) is not valid


def test_without_a_target_the_speed_is_to_be_steady(good: Trial) -> None:
    assert reasons(asked(good, speed_mm_s=0.0)) == ""


@pytest.mark.parametrize(
    ("off", "valid"), [(0.93, True), (1.07, True), (0.85, False), (1.17, False)]
)
def test_mean_force(off: float, valid: bool, good: Trial) -> None:
    mean = observe(good, STUDY).mean_force_n
    assert ("mean normal force" in reasons(asked(good, force_n=mean / off))) is not valid


@pytest.mark.parametrize(("share", "valid"), [(0.08, True), (0.12, False)])
def test_force_off_target_for_a_tenth_of_the_trial(
    share: float, valid: bool, good: Trial
) -> None:
    """The paper's one second of ten. A push and a release keep the mean."""
    force = good.force_n.copy()
    half = round(share / 2.0 * force.shape[0])
    force[20_000 : 20_000 + half, 2] += 0.2
    force[40_000 : 40_000 + half, 2] -= 0.2
    said = reasons(replace(good, force_n=force))
    assert ("normal force is more than 25% from its target" in said) is not valid
    if not valid:
        assert "of 4 s; accepted: 0.4 s" in said


@pytest.mark.parametrize(("pause_s", "valid"), [(0.2, True), (1.0, False)])
def test_a_finger_that_stops(pause_s: float, valid: bool, good: Trial) -> None:
    stopped = np.clip(good.position_t_s - 0.6, 0.0, pause_s)
    moving_t_s = good.position_t_s - stopped
    position = np.column_stack(
        [np.interp(moving_t_s, good.position_t_s, axis) for axis in good.position_mm.T]
    )
    said = reasons(replace(good, position_mm=position))
    assert ("speed is more than 25% from its mean" in said) is not valid
    assert "cut off" not in said  # it stops amid the strokes


@pytest.mark.parametrize("lifts", [True, False])
def test_rest_after_the_strokes_is_to_be_cut_off(lifts: bool, good: Trial) -> None:
    moving_t_s = np.minimum(good.position_t_s, 2.5)
    position = np.column_stack(
        [np.interp(moving_t_s, good.position_t_s, axis) for axis in good.position_mm.T]
    )
    force = good.force_n.copy()
    if lifts:
        force[round(2.5 * RATE_HZ) :] *= 0.01
    seen = observe(replace(good, position_mm=position, force_n=force), STUDY)
    asked_for = [reason for reason in seen.reasons if "cut off what is before" in reason]
    assert len(asked_for) == len(seen.reasons) == 1 + lifts, seen.reasons
    assert all(re.search(r"after 2\.[345]\d s$", reason) for reason in asked_for), asked_for


def test_reversals_are_not_held_against_the_speed(rng: np.random.Generator) -> None:
    """At 100 mm/s over 30 mm a quarter of all reports lie near a reversal."""
    made = Made((100.0,), 100.0, seconds=3.0, span_mm=30.0)
    assert reasons(trial(made, rng)) == ""


def test_a_finger_at_rest(good: Trial) -> None:
    said = reasons(replace(good, position_mm=np.full_like(good.position_mm, 30.0)))
    assert "no steady sweep" in said
    assert (
        observe(
            replace(good, position_mm=np.full_like(good.position_mm, np.nan)), STUDY
        ).rows.tone_hz.size
        == 0
    )


@pytest.mark.parametrize("name", ["force_n", "accel_m_s2"])
@pytest.mark.parametrize("stepped", [True, False])
def test_a_clipped_sensor(name: str, stepped: bool, good: Trial) -> None:
    samples = getattr(good, name)
    top = np.quantile(samples[:, 0], 0.97)
    if stepped:
        step = Quantisation().force_step_n if name == "force_n" else 0.04
        samples, top = np.rint(samples / step) * step, np.rint(top / step) * step
    said = reasons(replace(good, **{name: np.minimum(samples, top)}))
    assert f"{name}, column 0, is clipped at {top:.4g}" in said


@pytest.mark.parametrize("name", ["force_n", "accel_m_s2"])
@pytest.mark.parametrize("value", [0.0, 0.3, np.nan])
def test_a_dead_sensor(name: str, value: float, good: Trial) -> None:
    samples = getattr(good, name).copy()
    samples[:, 0] = value
    said = reasons(replace(good, **{name: samples}))
    assert (f"{name}, column 0, holds one and the same value" in said) is not np.isnan(value)


@pytest.mark.parametrize(
    "crest",
    [
        lambda t, rng: np.cos(60.0 * t),
        lambda t, rng: rng.standard_normal(t.size),
        lambda t, rng: np.zeros(t.size),
        lambda t, rng: 0.3 + 0.2 * rng.standard_normal(t.size) / 60.0,
        lambda t, rng: np.cos(60.0 * t) + 0.001 * rng.standard_normal(t.size),
    ],
    ids=["sine", "noise", "nothing", "rest", "noisy sine"],
)
@pytest.mark.parametrize("step", [0.05, 0.01, 0.001])
def test_a_crest_is_not_clipped(
    crest: Callable[..., FloatArray], step: float, rng: np.random.Generator
) -> None:
    samples = crest(np.arange(40_000) / RATE_HZ, rng)
    assert inspect((np.rint(samples / step) * step)[:, np.newaxis]).clipped == ()


def test_the_drive_is_absent(good: Trial) -> None:
    assert good.voltage_v is not None
    silent = replace(good, voltage_v=np.zeros_like(good.voltage_v))
    assert "a tone of 100 Hz is declared, but the voltage drives with" in reasons(silent)


def test_the_drive_is_another_tone(good: Trial, rng: np.random.Generator) -> None:
    assert "declared, but the voltage drives at 100.1 Hz" in reasons(
        asked(good, tones_hz=(250.0,))
    )
    time = np.arange(good.force_n.shape[0]) / RATE_HZ
    blank = asked(good, tones_hz=())
    assert "no tone is declared" in reasons(blank)
    quiet = replace(blank, voltage_v=np.zeros(time.size))
    assert reasons(quiet) == ""
    assert reasons(replace(good, voltage_v=volts(message((100.0,), time, rng)))) == ""


def test_the_line_of_a_texture_is_no_tone_that_nobody_declared(good: Trial) -> None:
    """It is where the finger's speed puts it, and the drive follows the strokes."""
    time = np.arange(good.force_n.shape[0]) / RATE_HZ
    undeclared = asked(good, tones_hz=())
    in_each_stroke = 0.5 + 0.4 * np.cos(2.0 * np.pi * 111.0 * time) * (np.sin(4.0 * time) > 0.8)
    begins_steadily = 0.5 + 0.4 * np.cos(2.0 * np.pi * 111.0 * time) * (time < 0.6 * time[-1])
    follows_strokes = 0.5 + 0.3 * np.sin(2.0 * np.pi * 1.2 * time)
    for drive in (in_each_stroke, begins_steadily, follows_strokes):
        assert reasons(replace(undeclared, voltage_v=volts(drive))) == ""


@pytest.mark.parametrize(("share", "valid"), [(0.05, True), (0.15, False)])
@pytest.mark.parametrize("name", ["force_n", "voltage_v"])
def test_a_stretch_of_missing_samples(
    name: str, share: float, valid: bool, good: Trial
) -> None:
    samples = getattr(good, name).copy()
    samples[30_000 : 30_000 + round(share * samples.shape[0])] = np.nan
    seen = observe(replace(good, **{name: samples}), STUDY)
    assert seen.valid is valid, seen.reasons
    assert any(f"samples of {name} are missing" in note for note in seen.notes)
    if not valid:
        assert f"15% of the samples of {name} are missing" in seen.reasons[0]


def test_what_is_not_valid_is_measured_all_the_same(good: Trial) -> None:
    seen: TrialObservations = observe(asked(good, speed_mm_s=80.0), STUDY)
    assert not seen.valid
    np.testing.assert_array_equal(
        seen.rows.friction_response, observe(good, STUDY).rows.friction_response
    )


def test_positions_around_the_samples_are_not_judged(good: Trial) -> None:
    """A finger that stopped before the first sample was steady all the same."""
    around_s = np.arange(-0.6, 0.0, 0.01)
    rest = np.broadcast_to(good.position_mm[0], (around_s.size, 2))
    preceded = replace(
        good,
        position_mm=np.concatenate([rest, good.position_mm]),
        position_t_s=np.concatenate([around_s, good.position_t_s]),
    )
    assert reasons(preceded) == ""
