"""What a texture would be: its course, its third octaves, and what a rig could give of it."""

import numpy as np
import pytest

from frictus.textures import Beta, Component, Map, Profile, Region, Scene, Slope, Spectrum
from frictus_hardware.physics.screen import Screen
from frictus_service.fidelity.path import exact_friction
from frictus_service.fidelity.preview import (
    CENTRES_HZ,
    EDGES_HZ,
    LENGTH,
    POINTS,
    band_power,
    feasible,
    stretch_of,
    sums_of,
    third_octaves_n,
)
from frictus_service.synthesis.compensability import inverse_of_model, placeholder_model
from frictus_service.synthesis.components import components_of
from frictus_service.synthesis.scene import compile_scene

RATE_HZ = 20_000.0
TEXTURES: dict[str, Spectrum | Beta | Slope] = {
    "spectrum": Spectrum(
        components=[
            Component(amplitude_n=0.1, cycles_per_mm=2.0, phase_rad=0.5),
            Component(amplitude_n=0.05, cycles_per_mm=7.3),
            Component(amplitude_n=0.2, hz=80.0, phase_rad=1.0),
        ]
    ),
    "beta": Beta(alpha=3.0, beta=2.0, rms_n=0.2, speed_mm_s=50.0, seed=3),
    "slope": Slope(peak_hz=200.0, low_order=2, high_order=3, rms_n=0.3, seed=4),
}


@pytest.mark.parametrize("kind", TEXTURES)
def test_course_is_the_friction_asked_for(kind: str) -> None:
    for part in components_of(TEXTURES[kind]):
        drawn = stretch_of(part)
        assert drawn.per == ("mm" if part.spatial else "s")
        assert drawn.step * POINTS == pytest.approx(LENGTH[drawn.per])
        along = drawn.step * np.arange(POINTS)
        way = np.column_stack([along, np.zeros(POINTS)])
        rate_hz = 1.0 / drawn.step  # of no matter to a spatial part
        asked = exact_friction([part], way, 0, rate_hz)
        np.testing.assert_allclose(drawn.friction_n, asked, atol=1e-9)


def test_lines_that_the_course_cannot_show_are_left_out() -> None:
    fine = Spectrum(
        components=[
            Component(amplitude_n=1.0, cycles_per_mm=99.9),
            Component(amplitude_n=0.1, cycles_per_mm=0.2),
        ]
    )
    drawn = stretch_of(sums_of(fine)[0])
    assert np.abs(drawn.friction_n).max() == pytest.approx(0.1)


@pytest.mark.parametrize("speed_mm_s", [20.0, 50.0, 137.0])
def test_third_octaves_hold_all_power_between_their_ends(
    rng: np.random.Generator, speed_mm_s: float
) -> None:
    felt_hz = 10.0 ** rng.uniform(1.2, 3.2, size=400)
    amplitude_n = rng.uniform(0.0, 0.01, size=400)
    lines = [
        Component(amplitude_n=size, cycles_per_mm=hz / speed_mm_s, phase_rad=phase)
        for size, hz, phase in zip(
            amplitude_n, felt_hz, rng.uniform(0.0, 6.0, size=400), strict=True
        )
    ]
    found = third_octaves_n(sums_of(Spectrum(components=lines)), speed_mm_s)
    inside = (felt_hz > EDGES_HZ[0]) & (felt_hz < EDGES_HZ[-1])
    # Parseval: the powers of the bands add up to that of the lines.
    total = np.sum(np.square(amplitude_n[inside])) / 2.0
    assert np.sum(np.square(found)) == pytest.approx(total)


@pytest.mark.long
@pytest.mark.parametrize("kind", TEXTURES)
def test_third_octaves_are_what_is_met_along_a_way(kind: str) -> None:
    """A stroke of 5 s, measured as felt friction is, has them."""
    speed_mm_s, count = 50.0, 100_000
    sums = sums_of(TEXTURES[kind])
    x_mm = speed_mm_s * np.arange(count) / RATE_HZ
    met = exact_friction(sums, np.column_stack([x_mm, np.zeros(count)]), 0, RATE_HZ)
    measured = np.sqrt(band_power(met, RATE_HZ, [slice(0, count)]))
    found = third_octaves_n(sums, speed_mm_s)
    # A line at the edge of two bands leaks into both: the neighbours share its power.
    np.testing.assert_allclose(measured, found, rtol=0.01, atol=2e-3 * found.max())


def test_lines_of_one_frequency_interfere() -> None:
    lines = [
        Component(amplitude_n=0.3, hz=100.0),
        Component(amplitude_n=0.1, hz=100.0, phase_rad=np.pi),
        Component(amplitude_n=0.1, cycles_per_mm=2.0),
    ]
    found = third_octaves_n(sums_of(Spectrum(components=lines)), 50.0)
    band = int(np.argmin(np.abs(CENTRES_HZ - 100.0)))
    # Over way and over time: no phase between the two lasts.
    assert found[band] == pytest.approx(np.sqrt((0.2**2 + 0.1**2) / 2.0))
    assert np.count_nonzero(found) == 1


def test_profile_has_the_power_of_its_samples(rng: np.random.Generator) -> None:
    # Periods of 40 mm at 40 mm/s: lines at every hertz, of which 32 to 1000 Hz are kept.
    spectrum = np.zeros(2_501, dtype=complex)
    spectrum[32:1_001] = rng.normal(size=969) + 1j * rng.normal(size=969)
    samples = np.fft.irfft(spectrum)
    samples *= 0.2 / np.sqrt(np.mean(np.square(samples)))
    texture = Profile(friction_n=samples.tolist(), period_mm=40.0)
    found = third_octaves_n(sums_of(texture), 40.0)
    assert np.sqrt(np.sum(np.square(found))) == pytest.approx(0.2)


def test_feasible_is_what_the_scene_is_scaled_to() -> None:
    screen, model = Screen(), placeholder_model()
    for texture in TEXTURES.values():
        applied = feasible(texture, model, screen, RATE_HZ)
        scene = Scene(regions=[Region(texture=texture)])
        inverse = inverse_of_model(model, screen)
        assert applied == compile_scene(scene, inverse, screen, RATE_HZ).applied
        assert applied.gain == pytest.approx(min(1.0, 0.97 * applied.feasible_gain))


def test_map_is_no_sum() -> None:
    assert sums_of(Map(image_png="AAAA", white_n=0.1)) == []
