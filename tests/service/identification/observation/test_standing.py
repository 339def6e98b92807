"""A driven force that stands still tells no response, whatever its range looks like."""

from dataclasses import replace

import numpy as np
import pytest
from tests.service.identification.trials import STUDY, Made, trial

from frictus_hardware.physics.stages import Quantisation
from frictus_service.identification.observation.observe import course_of, observe
from frictus_service.identification.observation.standing import standing_samples
from frictus_service.study.trial import Trial

CLIPPED_N = 0.06


@pytest.fixture
def good(rng: np.random.Generator) -> Trial:
    return trial(Made((100.0,), 60.0, 0.4, 3.0, noise_n=0.002), rng)


def clipped(original: Trial, limit_n: float) -> Trial:
    force_n = original.force_n.copy()
    force_n[:, 0] = np.clip(force_n[:, 0], -limit_n, limit_n)
    return replace(original, force_n=force_n)


def test_a_force_clipped_at_both_ends_is_left_out(good: Trial) -> None:
    """As of a sensor whose range is too narrow: +-0.06 N where friction is 0.2 N."""
    seen = observe(clipped(good, CLIPPED_N), STUDY)
    assert not seen.valid
    assert any("force_n, column 0, stands still for " in reason for reason in seen.reasons)


def test_a_converter_that_hangs_is_told(good: Trial) -> None:
    force_n = good.force_n.copy()
    force_n[10_000:30_000, 0] = force_n[10_000, 0]
    (reason,) = observe(replace(good, force_n=force_n), STUDY).reasons
    assert "stands still" in reason


def with_a_third_that_stands(original: Trial, name: str, rng: np.random.Generator) -> Trial:
    segments = course_of(original).segments
    hung = segments[int(rng.integers(1, len(segments) - 1))]
    first, last = (
        round(at * original.info.sample_rate_hz) for at in (hung.begin_s, hung.end_s)
    )
    samples = getattr(original, name).copy()
    samples[first:last, 0] = samples[first, 0]
    return replace(original, **{name: samples})


def test_a_third_in_which_it_stands_has_no_response(rng: np.random.Generator) -> None:
    """Its response is 0, as certain as rounding is: one of them outweighs all others."""
    made = trial(Made((100.0,), 60.0, 0.4, 12.0, noise_n=0.002), rng)
    before = observe(made, STUDY)
    after = observe(with_a_third_that_stands(made, "force_n", rng), STUDY)
    assert after.valid
    assert after.rows.tone_hz.size == before.rows.tone_hz.size - 1
    assert any("a force that stands still" in note for note in after.notes)


def test_a_third_in_which_the_skins_sensor_stands_has_no_mobility(
    rng: np.random.Generator,
) -> None:
    made = trial(Made((100.0,), 60.0, 0.4, 12.0, noise_n=0.002), rng)
    before = observe(made, STUDY).rows
    after = observe(with_a_third_that_stands(made, "accel_m_s2", rng), STUDY)
    assert after.valid
    assert np.isnan(after.rows.mobility).sum() == 1
    assert np.isnan(after.rows.mobility_variance).sum() == 1
    np.testing.assert_array_equal(after.rows.friction_response, before.friction_response)
    assert any("say nothing of mobility" in note for note in after.notes)


@pytest.mark.parametrize("tones_hz", [(30.0,), (100.0, 750.0)])
@pytest.mark.parametrize("noise_n", [0.0, 0.002])
def test_a_quantised_force_does_not_stand(
    tones_hz: tuple[float, ...], noise_n: float, rng: np.random.Generator
) -> None:
    made = trial(Made(tones_hz, 60.0, 0.4, 2.0, noise_n=noise_n), rng)
    step_n = Quantisation().force_step_n
    stepped = replace(made, force_n=np.rint(made.force_n / step_n) * step_n)
    assert observe(stepped, STUDY).valid


def test_a_blank_force_may_stand(rng: np.random.Generator) -> None:
    blank = trial(Made((), 60.0, 0.4, 2.0), rng)
    still = blank.force_n.copy()
    still[:, 0] = 0.2 * np.sign(still[:, 0])
    assert not any(
        "stands" in each for each in observe(replace(blank, force_n=still), STUDY).reasons
    )


@pytest.mark.parametrize(("least", "standing"), [(1, 10), (2, 7), (3, 5), (5, 5), (6, 0)])
def test_samples_of_runs(least: int, standing: int) -> None:
    samples = np.array([1.0, 2.0, 2.0, 3.0, 3.0, 3.0, 3.0, 3.0, 4.0, 5.0])
    assert standing_samples(samples, least) == standing


def test_missing_samples_do_not_stand() -> None:
    assert standing_samples(np.full(9, np.nan), 2) == 0
    assert standing_samples(np.empty(0), 2) == 0
