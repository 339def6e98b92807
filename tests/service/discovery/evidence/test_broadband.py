"""Without tones: noise or a texture as message, or no message, gives what tones would give."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import signal
from tests.service.identification.trials import (
    RATE_HZ,
    STUDY,
    Made,
    trial,
    true_friction,
    true_mobility,
)

from frictus_hardware.arrays import ComplexArray, FloatArray
from frictus_service.discovery.evidence.bands import WINDOW_S, Bands
from frictus_service.discovery.evidence.trial_evidence import TrialEvidence, evidence_of
from frictus_service.study.trial import Trial


def noise(_: tuple[float, ...], time_s: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return noise from 30 to 2500 Hz as drive."""
    sections = signal.butter(2, (30.0, 2500.0), "bandpass", fs=RATE_HZ, output="sos")
    drawn = signal.sosfilt(sections, rng.standard_normal(time_s.size))
    drive: FloatArray = np.clip(0.5 + 0.15 * drawn / drawn.std(), 0.0, 1.0)
    return drive


def untold(made: Made, rng: np.random.Generator) -> Trial:
    """Return a trial that is driven by noise and names no tones."""
    measured = trial(made, rng, noise)
    return replace(measured, info=replace(measured.info, tones_hz=()))


def pooled(
    found: TrialEvidence, measured: ComplexArray, variance: FloatArray, true: ComplexArray
) -> ComplexArray:
    """Return measured over true per band, weighted by variance."""
    tones = found.observed.rows.tone_hz
    weight = np.square(np.abs(true)) / variance
    return np.array(
        [
            np.average((measured / true)[tones == tone], weights=weight[tones == tone])
            for tone in np.unique(tones)
        ]
    )


def friction_ratio(found: TrialEvidence) -> ComplexArray:
    rows = found.observed.rows
    true = true_friction(rows.tone_hz, 60.0)
    return pooled(found, rows.friction_response, rows.friction_variance, true)


@pytest.mark.parametrize("edge_hz", [740.0, 1_060.0, 1_500.0])
def test_where_a_drive_ends_beside_a_resonance_of_the_mount_friction_is_right(
    edge_hz: float, rng: np.random.Generator
) -> None:
    """Divided out of short spectra, the mount left up to 5 % there, as if it had shifted."""

    def ended(_: tuple[float, ...], time_s: FloatArray, rng: np.random.Generator) -> FloatArray:
        spectrum = np.fft.rfft(rng.standard_normal(time_s.size))
        spectrum[np.fft.rfftfreq(time_s.size, 1.0 / RATE_HZ) > edge_hz] = 0.0
        drawn = np.fft.irfft(spectrum, time_s.size)
        drive: FloatArray = np.clip(0.5 + 0.12 * drawn / drawn.std(), 0.0, 1.0)
        return drive

    made = Made((100.0,), 60.0, seconds=8.0, noise_n=1e-4, noise_m_s2=0.05)
    driven = trial(made, rng, ended)
    found = evidence_of(replace(driven, info=replace(driven.info, tones_hz=())), STUDY)
    rows = found.observed.rows
    true = true_friction(found.harmonics.centroid_hz, 60.0)
    ratio = pooled(found, rows.friction_response, rows.friction_variance, true)
    played = np.unique(rows.tone_hz[rows.message > 3e-3])
    assert played[-1] > edge_hz - 20.0
    assert np.max(np.abs(ratio[: played.size] - 1.0)) < 0.012


def test_noise_says_what_tones_say(rng: np.random.Generator) -> None:
    made = Made((100.0,), 60.0, seconds=4.0, noise_n=0.002, noise_m_s2=0.05)
    found = evidence_of(untold(made, rng), STUDY)
    assert found.observed.valid, found.observed.reasons
    assert any("mean coherence of drive and friction" in n for n in found.observed.notes)
    rows = found.observed.rows
    tones = np.unique(rows.tone_hz)
    assert tones.size > 25
    np.testing.assert_allclose(friction_ratio(found), 1.0, atol=0.02)
    skin = pooled(found, rows.mobility, rows.mobility_variance, true_mobility(rows.tone_hz))
    np.testing.assert_allclose(skin[tones > 60.0], 1.0, atol=0.07)
    np.testing.assert_allclose(skin[(tones > 150.0) & (tones < 750.0)], 1.0, atol=0.03)
    np.testing.assert_allclose(found.harmonics.message_mean, 0.5, atol=0.03)
    assert np.all(np.abs(found.harmonics.message_power - 0.15**2) < 0.5 * 0.15**2)
    assert np.isnan(found.harmonics.second).all()


def test_variances_are_those_of_the_replicates(rng: np.random.Generator) -> None:
    """With a noisy sensor: coherence far below one."""
    made = Made((100.0,), 60.0, seconds=4.0, noise_n=0.3, wander_n=0.0)
    found = [evidence_of(untold(made, rng), STUDY).observed.rows for _ in range(3)]
    z = np.concatenate(
        [
            (rows.friction_response - true_friction(rows.tone_hz, 60.0))
            / np.sqrt(rows.friction_variance)
            for rows in found
        ]
    )
    z = z[np.isfinite(z)]
    both = np.concatenate([z.real, z.imag])
    assert both.size > 500
    assert abs(np.mean(both)) < 0.2
    # Tails are heavy where few averages estimate the noise.
    assert 0.45 < np.median(np.abs(both)) / 0.6745 < 1.5


def test_force_and_skin_alone(rng: np.random.Generator) -> None:
    made = Made((100.0,), 60.0, seconds=4.0, noise_n=0.002, noise_m_s2=0.05)
    measured = replace(untold(made, rng), voltage_v=None)
    found = evidence_of(measured, STUDY)
    rows = found.observed.rows
    assert np.isnan(rows.friction_response).all()
    assert np.isnan(rows.message).all()
    assert np.isnan(found.harmonics.message_mean).all()
    assert any("coherence of force and skin" in note for note in found.observed.notes)
    skin = pooled(found, rows.mobility, rows.mobility_variance, true_mobility(rows.tone_hz))
    tones = np.unique(rows.tone_hz)
    assert np.count_nonzero(tones > 150.0) > 10
    np.testing.assert_allclose(skin[(tones > 150.0) & (tones < 750.0)], 1.0, atol=0.05)


def test_a_stretch_whose_force_has_nothing_in_a_band_says_nothing_of_it(
    rng: np.random.Generator,
) -> None:
    """Beside stretches that have: the noise of the force made the mobility too small there."""
    half_s, edge_hz = 4.0, 250.0

    def rougher(
        _: tuple[float, ...], time_s: FloatArray, rng: np.random.Generator
    ) -> FloatArray:
        drawn = rng.standard_normal(time_s.size)
        sections = signal.butter(8, edge_hz, fs=RATE_HZ, output="sos")
        dull = signal.sosfilt(sections, drawn)
        drive = np.where(time_s < half_s, 0.1 * dull / dull.std(), 0.15 * drawn)
        return np.clip(0.5 + drive, 0.0, 1.0)

    made = Made((100.0,), 60.0, seconds=2.0 * half_s, noise_n=0.01, noise_m_s2=0.05)
    measured = replace(trial(made, rng, rougher), voltage_v=None)
    found = evidence_of(replace(measured, info=replace(measured.info, tones_hz=())), STUDY)
    rows = found.observed.rows
    ratio = rows.mobility / true_mobility(found.harmonics.mobility_centroid_hz)
    fine = (rows.tone_hz > 1.5 * edge_hz) & (rows.tone_hz < 750.0)
    assert np.count_nonzero(fine) > 30
    assert np.abs(np.median(ratio[fine]) - 1.0) < 0.05
    assert np.quantile(np.abs(ratio[fine]), 0.02) > 0.75


@pytest.mark.parametrize("with_skin", [True, False])
def test_nothing_coherent_gives_nothing(with_skin: bool, rng: np.random.Generator) -> None:
    measured = trial(Made((), 60.0, noise_n=0.01, noise_m_s2=0.5), rng)
    if not with_skin:
        measured = replace(measured, accel_m_s2=None)
    found = evidence_of(measured, STUDY)
    assert found.observed.rows.tone_hz.size == 0
    assert found.stretches.sweep.size > 0
    said = any("not coherent" in note for note in found.observed.notes)
    assert said == with_skin


def test_windows_with_gaps_are_left_out(rng: np.random.Generator) -> None:
    measured = untold(Made((100.0,), 40.0, seconds=4.0), rng)
    force = measured.force_n.copy()
    force[30_000:31_000] = np.nan
    found = evidence_of(replace(measured, force_n=force), STUDY)
    true = true_friction(found.observed.rows.tone_hz, 40.0)
    rows = found.observed.rows
    ratio = pooled(found, rows.friction_response, rows.friction_variance, true)
    np.testing.assert_allclose(ratio, 1.0, atol=0.02)


def test_a_dead_accelerometer_leaves_friction(rng: np.random.Generator) -> None:
    measured = untold(Made((100.0,), 60.0), rng)
    dead = replace(measured, accel_m_s2=np.full_like(measured.force_n, np.nan))
    found = evidence_of(dead, STUDY)
    np.testing.assert_allclose(friction_ratio(found), 1.0, atol=0.02)
    assert np.isnan(found.observed.rows.mobility).all()


@pytest.mark.parametrize("tone_hz", [93.0, 105.0, 238.0])
def test_a_tone_between_the_frequencies_of_the_windows_is_at_its_own(
    tone_hz: float, rng: np.random.Generator
) -> None:
    """By the windows' frequencies, the friction of its strongest bands is off by 0.7 %."""
    made = Made((tone_hz,), 60.0, seconds=8.0, noise_n=1e-4, noise_m_s2=1e-3)
    one = trial(made, rng)
    found = evidence_of(replace(one, info=replace(one.info, tones_hz=())), STUDY)
    rows, said = found.observed.rows, found.harmonics
    strong = rows.message > 1e-2
    assert np.unique(rows.tone_hz[strong]).size >= 2
    for centroid_hz in (said.centroid_hz, said.mobility_centroid_hz):
        np.testing.assert_allclose(centroid_hz[strong], tone_hz, atol=0.5)
    own = np.array([tone_hz])
    friction = pooled(
        found, rows.friction_response, rows.friction_variance, true_friction(own, 60.0)
    )
    mobility = pooled(found, rows.mobility, rows.mobility_variance, true_mobility(own))
    among = np.isin(np.unique(rows.tone_hz), rows.tone_hz[strong])
    np.testing.assert_allclose(friction[among], 1.0, rtol=1e-3)
    np.testing.assert_allclose(mobility[among], 1.0, rtol=5e-3)


def test_a_tone_that_nobody_declared_is_still_told(rng: np.random.Generator) -> None:
    measured = trial(Made((100.0,), 60.0), rng)
    found = evidence_of(replace(measured, info=replace(measured.info, tones_hz=())), STUDY)
    assert not found.observed.valid
    assert "no tone is declared" in found.observed.reasons[0]


@pytest.mark.parametrize(
    ("silent", "said"), [("drive", "the drive is off"), ("skin", "are not coherent")]
)
def test_a_channel_of_zeros_says_nothing(
    silent: str, said: str, rng: np.random.Generator
) -> None:
    measured = trial(Made((), seconds=1.0), rng)
    nothing = np.zeros_like(measured.force_n)
    if silent == "drive":
        measured = replace(measured, voltage_v=nothing[:, 0])
    else:
        measured = replace(measured, accel_m_s2=nothing)
    found = evidence_of(measured, STUDY).observed
    assert found.rows.tone_hz.size == 0
    assert [said in note for note in found.notes if note.startswith("broadband")] == [True]


def test_sweeps_shorter_than_a_window_are_said(rng: np.random.Generator) -> None:
    found = evidence_of(trial(Made((), 100.0, seconds=1.0, span_mm=25.0), rng), STUDY).observed
    assert found.rows.tone_hz.size == 0
    assert any("holds 0.1 s without gaps, the longest lasts" in note for note in found.notes)


def test_a_band_lies_where_its_power_is(rng: np.random.Generator) -> None:
    """Noise that falls with the frequency has its centroid below the middle of a band."""
    made = Made((100.0,), 60.0, seconds=30.0, noise_n=0.002, noise_m_s2=0.05)
    bands = Bands.of(2000, RATE_HZ, None)
    weight = np.square(1.0 / bands.frequency_hz)
    centroid = bands.mean(weight, bands.frequency_hz)
    spread2 = bands.mean(weight, np.square(bands.frequency_hz - centroid[bands.band]))
    wide = bands.lines > 20
    lines = bands.lines[wide] / WINDOW_S
    expected = bands.centre_hz - np.divide(2.0 * spread2, bands.centre_hz)
    np.testing.assert_allclose(centroid[wide], expected[wide], rtol=1e-3)
    np.testing.assert_allclose(spread2[wide], lines**2 / 12.0, rtol=0.1)
    # What is played is noise of all frequencies, of which Hann's window mixes those around.
    said = evidence_of(untold(made, rng), STUDY)
    bands = Bands.of(2000, RATE_HZ, STUDY.mount)
    of_lines = bands.lines[np.searchsorted(bands.centre_hz, said.observed.rows.tone_hz)]
    for lines_of in (1.0, *np.unique(of_lines[of_lines > 20])):
        found = np.mean(np.square(said.harmonics.spread_hz[of_lines == lines_of]))
        mixed = ((lines_of**2 - 1.0) / 12.0 + 1.0 / 3.0) / WINDOW_S**2
        assert found == pytest.approx(mixed, rel=0.15)
    # Beside the mount's second mode, at 1.71 kHz, power is at that side of its band.
    for near_hz, skewness in ((1590.0, -0.57), (1785.0, 0.52)):
        there = np.abs(said.observed.rows.tone_hz - near_hz) < 1.0
        assert said.harmonics.skewness[there].mean() == pytest.approx(skewness, abs=0.15)


def test_driven_mobility_is_weighed_by_what_the_force_has_of_the_drive(
    rng: np.random.Generator,
) -> None:
    """Above the cutoff friction falls, and mobility is seen lower in a band than the drive."""
    made = Made((100.0,), 60.0, seconds=4.0, noise_n=0.002, noise_m_s2=0.05)
    said = evidence_of(untold(made, rng), STUDY).harmonics
    of_drive, of_force = said.centroid_hz, said.mobility_centroid_hz
    step = 1e-3
    ends = (np.abs(true_friction(of_drive * (1.0 + s), 60.0)) for s in (-step, step))
    low, high = map(np.log, ends)
    slope = (high - low) / (2.0 * step)
    within = np.square(said.spread_hz) - 1.0 / (3.0 * WINDOW_S**2)
    expected = slope * within / of_drive
    high_up = of_drive > 1200.0
    shift = (of_force - of_drive)[high_up]
    assert np.mean(expected[high_up]) < -0.5
    np.testing.assert_allclose(shift.mean(), expected[high_up].mean(), rtol=0.2)
    assert np.all(said.mobility_spread_hz[high_up] > 0.0)
