"""Textures as sums of sinusoids: the laws they follow, and what is said about them."""

import numpy as np
import pytest
from scipy import stats

from frictus.errors import TextureError
from frictus.textures import BAND_HZ, Beta, Component, Profile, Slope, Spectrum
from frictus_service.fidelity.path import exact_friction
from frictus_service.synthesis.components import Components, components_of


def rms(components: Components) -> float:
    return float(np.sqrt(np.sum(np.square(components.amplitude_n)) / 2.0))


def hz(
    components: Components, speed: float | None
) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    return components.frequency * (1.0 if speed is None else speed)


def test_a_spectrum_keeps_its_components_spatial_and_temporal() -> None:
    spatial, temporal = components_of(
        Spectrum(
            components=[
                Component(amplitude_n=0.1, cycles_per_mm=2.0, phase_rad=0.5),
                Component(amplitude_n=0.3, hz=80.0),
                Component(amplitude_n=0.2, cycles_per_mm=0.123456, phase_rad=-7.0),
            ],
            angle_deg=30.0,
        )
    )
    assert spatial.spatial
    assert not temporal.spatial
    assert spatial.frequency.tolist() == [2.0, 0.123456]
    assert spatial.amplitude_n.tolist() == [0.1, 0.2]
    assert spatial.phase_rad.tolist() == [0.5, -7.0]
    assert spatial.angle_deg == 30.0
    assert spatial.period is None
    assert temporal.frequency.tolist() == [80.0]
    assert temporal.period == 10.0


def test_rounded_temporal_frequencies_are_reported() -> None:
    def of(hz: float) -> Components:
        (part,) = components_of(Spectrum(components=[Component(amplitude_n=0.1, hz=hz)]))
        return part

    assert of(80.1).notes == ()
    assert of(80.03).frequency[0] == pytest.approx(80.0)
    assert of(80.03).notes == ("temporal frequencies moved by up to 0.03 Hz",)
    assert of(0.01).frequency[0] == pytest.approx(0.1)  # never to 0
    (noise,) = components_of(Beta(alpha=2.0, beta=3.0, rms_n=0.1))
    assert noise.notes[0].startswith("temporal frequencies moved by up to 0.04")


@pytest.mark.parametrize("n_samples", [7, 200, 401])
@pytest.mark.parametrize("spatial", [True, False])
def test_a_profile_passes_through_its_samples(
    rng: np.random.Generator, n_samples: int, spatial: bool
) -> None:
    friction = rng.uniform(-1.0, 1.0, n_samples)
    period = 3.7 if spatial else 0.04
    key = "period_mm" if spatial else "period_s"
    texture = Profile.model_validate({"friction_n": friction.tolist(), key: period})
    (part,) = components_of(texture)
    assert part.period == period
    u = np.arange(n_samples) * period / n_samples
    waves = part.amplitude_n[:, None] * np.cos(
        2.0 * np.pi * np.outer(part.frequency, u) + part.phase_rad[:, None]
    )
    np.testing.assert_allclose(waves.sum(axis=0), friction - friction.mean(), atol=1e-9)


@pytest.mark.parametrize("value", [0.0, 0.3, -10.0])
def test_a_constant_profile_is_refused(value: float) -> None:
    with pytest.raises(TextureError, match="constant: there is nothing to feel"):
        components_of(Profile(friction_n=[value] * 50, period_mm=2.0))


@pytest.mark.parametrize("speed", [None, 40.0])
@pytest.mark.parametrize(("alpha", "beta"), [(2.0, 3.5), (1.0, 1.0), (0.5, 0.7), (6.0, 1.2)])
def test_a_beta_texture_follows_its_law(alpha: float, beta: float, speed: float | None) -> None:
    texture = Beta(alpha=alpha, beta=beta, rms_n=0.2, scale=7.0, seed=3, speed_mm_s=speed)
    (part,) = components_of(texture)
    assert part.spatial == (speed is not None)
    assert rms(part) == pytest.approx(0.2)
    found = hz(part, speed)
    want = 20.0 * 2.0 ** (np.arange(found.size) / 24.0)
    np.testing.assert_allclose(found, want, atol=0.0 if speed else 0.05, rtol=1e-9)
    assert want[-1] <= BAND_HZ[1] < want[-1] * 2.0 ** (1.0 / 24.0)
    inner = slice(1, -1)  # the ends are taken half a step inside, where the density is finite
    law = stats.beta.pdf(np.log10(want / 20.0) / np.log10(50.0), alpha, beta)
    share = part.amplitude_n[inner] / law[inner]
    np.testing.assert_allclose(share, share[0], rtol=1e-9)


@pytest.mark.parametrize("scale", [1e-9, 0.3, 1e9])
def test_the_scale_of_a_beta_law_gives_way_to_the_rms(scale: float) -> None:
    (plain,) = components_of(Beta(alpha=2.0, beta=3.0, rms_n=0.1))
    (scaled,) = components_of(Beta(alpha=2.0, beta=3.0, rms_n=0.1, scale=scale))
    np.testing.assert_allclose(scaled.amplitude_n, plain.amplitude_n, rtol=1e-12)


@pytest.mark.parametrize("speed", [None, 40.0])
@pytest.mark.parametrize(("low", "high"), [(1, 1), (2, 3), (4, 2)])
def test_a_slope_texture_has_its_slopes(low: int, high: int, speed: float | None) -> None:
    texture = Slope(
        peak_hz=150.0, low_order=low, high_order=high, rms_n=0.1, seed=5, speed_mm_s=speed
    )
    (part,) = components_of(texture)
    assert rms(part) == pytest.approx(0.1)
    found, level_db = hz(part, speed), 20.0 * np.log10(part.amplitude_n)
    np.testing.assert_allclose(found, np.arange(20.0, 1_000.5), rtol=1e-9)

    def octave(begin: float) -> float:
        rise = np.interp([begin, 2.0 * begin], found, level_db)
        return float(rise[1] - rise[0])

    # Far from the peak a Butterworth filter falls by 6.02 dB per octave and order.
    assert octave(20.0) == pytest.approx(6.02 * low, abs=0.6 + 0.6 * (low == 1))
    assert octave(500.0) == pytest.approx(-6.02 * high, abs=0.6 + 0.6 * (high == 1))
    peak = found[np.argmax(part.amplitude_n)]
    assert 150.0 / 1.5 < peak < 150.0 * 1.5


@pytest.mark.parametrize(
    "texture",
    [
        Beta(alpha=2.0, beta=3.0, rms_n=0.1, speed_mm_s=40.0),
        Beta(alpha=2.0, beta=3.0, rms_n=0.1),
        Slope(peak_hz=150.0, low_order=1, high_order=2, rms_n=0.1, speed_mm_s=40.0),
        Slope(peak_hz=150.0, low_order=1, high_order=2, rms_n=0.1),
    ],
    ids=["beta mm", "beta s", "slope mm", "slope s"],
)
def test_noise_is_reproducible_and_has_the_rms_asked_for(texture: Beta | Slope) -> None:
    (once,), (again,) = components_of(texture), components_of(texture)
    np.testing.assert_array_equal(once.phase_rad, again.phase_rad)
    (other,) = components_of(texture.model_copy(update={"seed": 1}))
    assert not np.any(other.phase_rad == once.phase_rad)
    np.testing.assert_array_equal(other.amplitude_n, once.amplitude_n)
    # Felt for ten seconds at the speed that it was made for.
    path = np.column_stack([40.0 * np.arange(200_000) / 20_000.0, np.zeros(200_000)])
    friction = exact_friction([once], path, 0, 20_000.0)
    assert float(np.std(friction)) == pytest.approx(0.1, rel=0.02)
