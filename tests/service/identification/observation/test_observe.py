"""Responses of the twin come out as they went in: the traps of measuring, one by one."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.service.identification.trials import (
    PAPER_TONES_HZ,
    RATE_HZ,
    STUDY,
    Made,
    trial,
    true_friction,
    true_mobility,
)

from frictus_hardware.arrays import ComplexArray, FloatArray
from frictus_service.identification.observation.images import folded
from frictus_service.identification.observation.observe import observe
from frictus_service.identification.observation.response import (
    ResponseRows,
    TrialObservations,
)
from frictus_service.study.reader import StudyReader
from frictus_service.study.trial import StudyInfo, Trial

EXAMPLE = Path(__file__).parents[5] / "shared" / "data" / "study_example" / "study.h5"


def mean_ratio(rows: ResponseRows, measured: ComplexArray, true: ComplexArray) -> ComplexArray:
    """Return measured over true per tone, the mean over all segments."""
    ratio = measured / true
    return np.array([ratio[rows.tone_hz == tone].mean() for tone in np.unique(rows.tone_hz)])


def friction_ratio(seen: TrialObservations, speed_mm_s: float) -> ComplexArray:
    rows = seen.rows
    return mean_ratio(rows, rows.friction_response, true_friction(rows.tone_hz, speed_mm_s))


def relative_error(rows: ResponseRows, true: ComplexArray) -> FloatArray:
    """Return the standard deviation that is declared for the mean over segments, per tone."""
    relative = rows.friction_variance / np.square(np.abs(true))
    own = [relative[rows.tone_hz == tone] for tone in np.unique(rows.tone_hz)]
    return np.array([np.sqrt(each.sum()) / each.size for each in own])


def mobility_ratio(rows: ResponseRows) -> ComplexArray:
    return mean_ratio(rows, rows.mobility, true_mobility(rows.tone_hz))


def sampled(rows: ResponseRows, measured: Trial, study: StudyInfo = STUDY) -> ResponseRows:
    """Return rows with the images that samples take for the tone."""
    force, skin = folded(rows, measured, study)
    return replace(
        rows,
        friction_response=rows.friction_response * force,
        mobility=rows.mobility * skin / force,
    )


@pytest.mark.parametrize("speed", [20.0, 40.0, 60.0, 80.0, 100.0])
def test_friction_response_at_all_tones_of_the_paper(
    speed: float, rng: np.random.Generator
) -> None:
    made = Made(PAPER_TONES_HZ, speed, seconds=3.0, noise_n=0.002, noise_m_s2=0.05)
    seen = observe(trial(made, rng), STUDY)
    assert seen.valid, seen.reasons
    assert set(seen.rows.direction) == ({-1, 1} if speed > 20.0 else {1})
    ratio = friction_ratio(seen, speed)
    assert ratio.size == 15
    margin = 5.0 * relative_error(seen.rows, true_friction(seen.rows.tone_hz, speed))
    assert np.all(np.abs(np.abs(ratio) - 1.0) < 0.003 + margin)
    assert np.all(np.abs(np.angle(ratio)) < 0.003 + margin)


@pytest.mark.parametrize("tone", [30.0, 446.3, 2000.0])
def test_each_segment_of_a_single_tone(tone: float, rng: np.random.Generator) -> None:
    seen = observe(trial(Made((tone,), 80.0), rng), STUDY)
    rows = seen.rows
    ratio = rows.friction_response / true_friction(rows.tone_hz, 80.0)
    assert ratio.size >= 6
    np.testing.assert_allclose(ratio, 1.0, atol=0.006)
    np.testing.assert_allclose(rows.message / rows.message[0], 1.0, atol=3e-3)


def test_mobility(rng: np.random.Generator) -> None:
    """Images of friction reach the acceleration: 0.3 % and 9 mrad at 600 Hz, like 1.6 us."""
    tones = tuple(tone for tone in PAPER_TONES_HZ if tone < 750.0)
    ratio = mobility_ratio(observe(trial(Made(tones), rng), STUDY).rows)
    np.testing.assert_allclose(np.abs(ratio), 1.0, atol=0.003)
    np.testing.assert_allclose(np.angle(ratio), 0.0, atol=0.002)


def test_skin_velocity_says_what_acceleration_says(rng: np.random.Generator) -> None:
    """Velocity at the tone is acceleration over j 2 pi f."""
    measured = trial(Made((200.0,)), rng)
    assert measured.accel_m_s2 is not None
    spectrum = np.fft.rfft(measured.accel_m_s2[:, 0])
    frequency = np.fft.rfftfreq(measured.accel_m_s2.shape[0], 1.0 / RATE_HZ)
    spectrum[1:] /= 2j * np.pi * frequency[1:]
    velocity = np.fft.irfft(spectrum, measured.force_n.shape[0])
    by_velocity = replace(measured, accel_m_s2=None, skin_velocity_m_s=velocity)
    one, other = (sampled(observe(each, STUDY).rows, each) for each in (measured, by_velocity))
    np.testing.assert_allclose(other.mobility, one.mobility, rtol=2e-3)


def test_bias_of_the_accelerometer_is_no_vibration(rng: np.random.Generator) -> None:
    """0.01 g of bias, integrated, would be 1 mm/s at 30 Hz."""
    plain = trial(Made((30.0,)), rng)
    assert plain.accel_m_s2 is not None
    biased = replace(plain, accel_m_s2=plain.accel_m_s2 + np.array([0.0981, 0.0981, 9.81]))
    one, other = (observe(each, STUDY).rows for each in (plain, biased))
    np.testing.assert_allclose(other.mobility, one.mobility, rtol=1e-9)


def test_a_strong_tone_adds_no_sweeps(rng: np.random.Generator) -> None:
    """Friction above its mean, as the paper finds sweeps, flickers with a strong tone."""
    measured = trial(Made((30.0,), speed_mm_s=60.0, force_n=0.2, seconds=1.4), rng)
    seen = observe(measured, STUDY)
    above = measured.force_n[:, 0] > measured.force_n[:, 0].mean()
    literal = np.count_nonzero(np.diff(above.astype(int)) == 1)
    assert np.unique(seen.rows.sweep).size == 2
    assert literal > 10


def test_oblique_motion_keeps_size_and_phase(rng: np.random.Generator) -> None:
    """Projected on the motion, not reduced to a magnitude, which has lost the phase."""
    made = Made((150.0,), 60.0, turned_deg=20.0)
    seen = observe(trial(made, rng), STUDY)
    np.testing.assert_allclose(friction_ratio(seen, 60.0), 1.0, atol=0.004)
    np.testing.assert_allclose(mobility_ratio(seen.rows), 1.0, atol=0.006)


def test_the_mount_is_removed(rng: np.random.Generator) -> None:
    """Left in, it makes the gain 16 % too large, and the mobility as much too small."""
    measured = trial(Made((30.0,)), rng)
    removed, left = (
        observe(measured, each).rows for each in (STUDY, replace(STUDY, mount=None))
    )
    assert STUDY.mount is not None
    response = STUDY.mount.frequency_response(np.array([30.0]))
    assert abs(response[0]) == pytest.approx(1.16, abs=0.003)
    left, removed = (
        sampled(left, measured, replace(STUDY, mount=None)),
        sampled(removed, measured),
    )
    friction = left.friction_response / removed.friction_response
    np.testing.assert_allclose(friction, response[0])
    np.testing.assert_allclose(left.mobility / removed.mobility, 1.0 / response[0])


@pytest.mark.parametrize("samples", [1, 3])
def test_declared_skew_is_removed(samples: int, rng: np.random.Generator) -> None:
    measured = trial(Made((813.0,)), rng)
    assert measured.accel_m_s2 is not None
    late = replace(
        measured,
        force_n=np.roll(measured.force_n, -samples, axis=0),
        accel_m_s2=np.roll(measured.accel_m_s2, -2 * samples, axis=0),
        force_skew_s=samples / RATE_HZ,
        skin_skew_s=2 * samples / RATE_HZ,
    )
    one, other = (observe(each, STUDY).rows for each in (measured, late))
    np.testing.assert_allclose(other.friction_response, one.friction_response, rtol=2e-3)
    np.testing.assert_allclose(other.mobility, one.mobility, rtol=4e-3)


def test_variances_are_those_of_the_replicates(rng: np.random.Generator) -> None:
    made = Made((120.0,), 100.0, seconds=6.0, noise_n=0.05, noise_m_s2=2.0)
    runs = [observe(trial(made, rng), STUDY).rows for _ in range(4)]
    for name, true in (
        ("friction_response", true_friction(np.array([120.0]), 100.0)),
        ("mobility", true_mobility(np.array([120.0]))),
    ):
        error = np.concatenate([getattr(rows, name) for rows in runs]) - true
        kind = name.removesuffix("_response") + "_variance"
        declared = np.concatenate([getattr(rows, kind) for rows in runs])
        assert 0.6 < np.mean(np.square(np.abs(error))) / 2.0 / np.mean(declared) < 1.6


def test_missing_samples_do_not_bias(rng: np.random.Generator) -> None:
    whole = trial(Made((99.6,), 40.0), rng)
    force = whole.force_n.copy()
    gone = rng.choice(whole.force_n.shape[0], 1500, replace=False)
    force[gone] = np.nan
    force[21_000:21_600] = np.nan
    seen = observe(replace(whole, force_n=force), STUDY)
    assert seen.valid, seen.reasons
    assert any("samples of force_n are missing" in note for note in seen.notes)
    np.testing.assert_allclose(friction_ratio(seen, 40.0), 1.0, atol=0.004)


def test_a_dead_accelerometer_leaves_friction(rng: np.random.Generator) -> None:
    whole = trial(Made(), rng)
    seen = observe(replace(whole, accel_m_s2=np.full_like(whole.force_n, np.nan)), STUDY)
    assert seen.valid
    assert np.isfinite(seen.rows.friction_response).all()
    assert np.isnan(seen.rows.mobility).all()
    without = observe(replace(whole, accel_m_s2=None), STUDY)
    assert np.isnan(without.rows.mobility_variance).all()
    assert any("no mobility" in note for note in without.notes)


def test_a_blank_trial_has_no_rows(rng: np.random.Generator) -> None:
    seen = observe(trial(Made(()), rng), STUDY)
    assert seen.valid
    assert seen.rows.tone_hz.size == 0
    assert seen.mean_speed_mm_s == pytest.approx(60.0, rel=0.01)
    assert seen.mean_force_n == pytest.approx(0.4, rel=0.1)


def test_rows_say_what_they_are(rng: np.random.Generator) -> None:
    tones = (75.0, 175.0, 525.0)
    seen = observe(trial(Made(tones), rng), STUDY)
    rows = seen.rows
    count = rows.tone_hz.size
    assert all(getattr(rows, name).shape == (count,) for name in ResponseRows.__slots__)
    np.testing.assert_array_equal(rows.tone_hz, np.tile(tones, count // 3))
    keys = list(zip(rows.sweep, rows.third, rows.tone_hz, strict=True))
    assert len(set(keys)) == count
    np.testing.assert_allclose(rows.speed_mm_s, 60.0, rtol=0.02)


@pytest.mark.skipif(not EXAMPLE.exists(), reason="the example is not at ../shared/data")
def test_a_study_that_another_program_simulated() -> None:
    """Trials of one second: few sweeps, yet every driven one says something."""
    with StudyReader(EXAMPLE) as study:
        seen = [observe(study.read(each.id), study.info) for each in study.trials]
    driven = [each for each in seen if each.info.tones_hz]
    assert len(driven) > 20
    for each in driven:
        response = each.rows.friction_response
        assert response.size >= 3
        assert np.ptp(np.abs(response)) < 0.25 * np.abs(response).mean()
        assert np.all(np.angle(response) < 0.0)
    valid = [each for each in seen if each.valid]
    assert len(valid) > len(seen) / 2
    assert all(bool(each.reasons) != each.valid for each in seen)


def test_observing_is_pure(rng: np.random.Generator) -> None:
    measured = trial(Made(), rng)
    before = measured.force_n.copy()
    one, other = (observe(measured, STUDY) for _ in range(2))
    np.testing.assert_array_equal(one.rows.friction_response, other.rows.friction_response)
    np.testing.assert_array_equal(measured.force_n, before)
