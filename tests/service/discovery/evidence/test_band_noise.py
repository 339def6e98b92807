"""Bands that hold nothing but noise say nothing: those in which a texture's line is not."""

from dataclasses import replace

import numpy as np
from tests.service.discovery.made import found_in, made, suspected

from frictus_service.discovery.evidence.band_noise import resolved
from frictus_service.discovery.evidence.trial_evidence import TrialEvidence

FAINT = 1e-3
"""Amplitude of the drive where the texture has nothing, as a share of where it has."""


def textured(one: TrialEvidence, rng: np.random.Generator) -> TrialEvidence:
    """Return a trial as if a texture had played it: fine lines where the finger is fast."""
    rows = one.observed.rows
    silent = (rows.tone_hz > 500.0) & (rows.speed_mm_s < 40.0)
    noise_n = 0.01 * (rng.normal(size=silent.size) + 1j * rng.normal(size=silent.size))
    message = np.where(silent, FAINT, 1.0) * rows.message
    felt = rows.friction_response + np.where(silent, noise_n / message, 0.0)
    variance = np.where(silent, np.square(0.01 / np.abs(message)), rows.friction_variance)
    rows = replace(rows, message=message, friction_response=felt, friction_variance=variance)
    info = replace(one.observed.info, tones_hz=())
    return replace(one, observed=replace(one.observed, info=info, rows=rows))


def test_what_hardly_drives_is_left_out_of_bands(rng: np.random.Generator) -> None:
    trials = [textured(one, rng) for one in made(rng)]
    kept = resolved(trials, "friction")
    for before, after in zip(trials, kept, strict=True):
        loud = np.abs(before.observed.rows.message) > 0.1
        np.testing.assert_array_equal(
            after.observed.rows.tone_hz, before.observed.rows.tone_hz[loud]
        )
        assert after.harmonics.message_mean.size == after.observed.rows.tone_hz.size
    assert sum(one.observed.rows.tone_hz.size for one in kept) < sum(
        one.observed.rows.tone_hz.size for one in trials
    )
    silent = [one for one in kept if not one.observed.rows.tone_hz.size]
    assert all("no band is known" in one.observed.notes[-1] for one in silent)


def test_tones_are_kept_however_noisy(rng: np.random.Generator) -> None:
    trials = made(rng)
    heard = [textured(one, rng) for one in trials]
    noisy = [
        replace(one, observed=replace(one.observed, info=asked.observed.info))
        for one, asked in zip(heard, trials, strict=True)
    ]
    sizes = [one.observed.rows.tone_hz.size for one in resolved(noisy, "friction")]
    assert sizes == [one.observed.rows.tone_hz.size for one in trials]


def test_a_band_of_which_all_is_elsewhere_is_left_out(rng: np.random.Generator) -> None:
    one = textured(made(rng)[0], rng)
    tones = one.observed.rows.tone_hz
    far = replace(one, harmonics=replace(one.harmonics, centroid_hz=0.0 * tones))
    (kept,) = resolved([far], "friction")
    assert not kept.observed.rows.tone_hz.size


def test_where_nothing_drives_a_stretch_speaks_for_itself(rng: np.random.Generator) -> None:
    """A force that holds next to nothing in a band says nothing of the skin there."""
    trials = []
    for each in made(rng):
        one = textured(each, rng)
        rows = one.observed.rows
        share = np.where(np.abs(rows.message) > 0.1, 1e-4, 0.25)
        variance = share * np.square(np.abs(rows.mobility))
        rows = replace(rows, message=rows.message * np.nan, mobility_variance=variance)
        trials.append(replace(one, observed=replace(one.observed, rows=rows)))
    for before, after in zip(trials, resolved(trials, "mobility"), strict=True):
        rows = before.observed.rows
        well = rows.mobility_variance < 0.01 * np.square(np.abs(rows.mobility))
        np.testing.assert_array_equal(after.observed.rows.tone_hz, rows.tone_hz[well])


def test_of_another_response_nothing_is_left_out(rng: np.random.Generator) -> None:
    """A trial in which nothing drives says so, where friction is asked for."""
    one = textured(made(rng)[0], rng)
    rows = one.observed.rows
    nothing = np.full(rows.tone_hz.size, complex(np.nan, np.nan))
    rows = replace(
        rows, message=nothing, friction_response=nothing, friction_variance=nothing.real
    )
    (same,) = resolved([replace(one, observed=replace(one.observed, rows=rows))], "friction")
    assert same.observed.rows.tone_hz.size == rows.tone_hz.size
    assert same.observed.notes == one.observed.notes


def test_textures_on_fingers_as_the_model_are_clean(rng: np.random.Generator) -> None:
    """As rows, bands without a line were large and named what follows the speed."""
    found = found_in([textured(one, rng) for one in made(rng)])
    assert not suspected(found)
    assert not found.unexplained
