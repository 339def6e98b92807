"""Scenes: one gain and bias that fit wherever the finger is and however fast it moves."""

import base64
import io
from itertools import pairwise

import numpy as np
import pytest
from PIL import Image

from frictus.errors import TextureError
from frictus.recordings import texture_of
from frictus.textures import (
    Beta,
    Component,
    Map,
    Profile,
    Region,
    Scene,
    Slope,
    Spectrum,
    Texture,
)
from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.friction import FrictionLaw, cutoff_hz
from frictus_hardware.physics.screen import Screen
from frictus_service.fidelity.measure import full_gain, largest_gain
from frictus_service.library import SHIPPED
from frictus_service.synthesis import kernel
from frictus_service.synthesis.drive_range import SPEEDS_MM_S
from frictus_service.synthesis.estimator import PredictedMotion
from frictus_service.synthesis.kernel import BlockMotion
from frictus_service.synthesis.renderer import Renderer
from frictus_service.synthesis.scene import CompiledScene, compile_scene
from frictus_service.synthesis.tables import BAND_EDGE_HZ

RATE = 20_000.0
LAW = FrictionLaw()
SCREEN = Screen()
FASTEST = 300.0


def compiled(*regions: Region, law: FrictionLaw = LAW) -> CompiledScene:
    return compile_scene(Scene(regions=list(regions)), law, SCREEN, RATE)


def friction_along(
    scene: CompiledScene, motion: BlockMotion, n_samples: int, first: int = 0
) -> FloatArray:
    out = np.empty(n_samples)
    kernel.target_friction(scene.arrays, motion, first, RATE, out)
    return out


def straight(x: float, y: float, speed: float, angle_rad: float = 0.0) -> BlockMotion:
    vx, vy = speed * np.cos(angle_rad), speed * np.sin(angle_rad)
    return BlockMotion(x, y, vx, vy, vx, vy, speed, speed)


def drives(
    scene: CompiledScene, law: FrictionLaw, rng: np.random.Generator, n_ways: int
) -> FloatArray:
    """Drive fraction asked for along random straight ways over the screen, not clipped."""
    asked = []
    for way in range(n_ways):
        speed = rng.uniform(0.0, (FASTEST, 20.0)[way % 2])
        angle = float(rng.choice([0.0, np.pi, rng.uniform(0.0, 2.0 * np.pi)]))
        x, y = rng.uniform(-1.0, 71.0), rng.uniform(-1.0, 36.0)
        first = int(rng.integers(0, 10**7))
        friction = friction_along(scene, straight(x, y, speed, angle), 301, first)
        decay = np.exp(-2.0 * np.pi * cutoff_hz(law, speed) / RATE)
        asked.append((friction[1:] - decay * friction[:-1]) / ((1.0 - decay) * law.gain_n))
    return np.concatenate(asked)


def random_map(rng: np.random.Generator) -> Map:
    rows, columns = rng.integers(8, 160, 2)
    grey = rng.integers(0, 256, (rows, columns)).astype(np.uint8)
    file = io.BytesIO()
    Image.fromarray(grey).save(file, "PNG")
    return Map(image_png=base64.b64encode(file.getvalue()).decode(), white_n=1.0)


def random_texture(rng: np.random.Generator) -> Texture:
    angle = float(rng.uniform(-180.0, 180.0))
    seed = int(rng.integers(0, 2**31))
    speed = None if rng.random() < 0.3 else float(rng.uniform(25.0, 100.0))
    match int(rng.integers(0, 5)):
        case 0:
            components = [
                Component(
                    amplitude_n=float(rng.uniform(0.0, 1.0)),
                    phase_rad=float(rng.uniform(0.0, 6.3)),
                    cycles_per_mm=None if speed is None else float(rng.uniform(0.05, 30.0)),
                    hz=float(rng.uniform(5.0, 1_100.0)) if speed is None else None,
                )
                for _ in range(int(rng.integers(1, 12)))
            ]
            return Spectrum(components=components, angle_deg=angle)
        case 1:
            friction = rng.standard_normal(int(rng.integers(2, 200))).clip(-10.0, 10.0)
            return Profile(
                friction_n=friction.tolist(),
                period_mm=None if speed is None else float(rng.uniform(3.0, 50.0)),
                period_s=float(rng.uniform(0.05, 1.0)) if speed is None else None,
                angle_deg=angle,
            )
        case 2:
            alpha, beta = rng.uniform(1.0, 6.0, 2)
            return Beta(
                alpha=float(alpha),
                beta=float(beta),
                rms_n=0.1,
                seed=seed,
                speed_mm_s=speed,
                angle_deg=angle,
            )
        case 3:
            return Slope(
                peak_hz=float(rng.uniform(20.0, 1_000.0)),
                low_order=2,
                high_order=1,
                rms_n=0.1,
                seed=seed,
                speed_mm_s=speed,
                angle_deg=angle,
            )
        case _:
            return random_map(rng)


def random_region(rng: np.random.Generator, texture: Texture) -> Region:
    x, y = rng.uniform(-5.0, 50.0), rng.uniform(-5.0, 25.0)
    return Region(
        texture=texture,
        x_mm=(x, x + rng.uniform(6.0, 60.0)),
        y_mm=(y, y + rng.uniform(6.0, 30.0)),
        gain=float(rng.uniform(1.0, 100.0)),
        edge_fade_mm=float(rng.choice([0.0, 0.3, 1.0, 5.0])),
    )


@pytest.mark.parametrize("factor", [0.5, 1.0, 2.0])
def test_the_drive_fits_at_every_place_and_speed(
    rng: np.random.Generator, factor: float
) -> None:
    law = FrictionLaw(0.39, factor * LAW.cutoff_0_hz, factor * LAW.slope_hz_per_mm_s)
    for _ in range(6):
        n_regions = int(rng.integers(1, 5))
        regions = [random_region(rng, random_texture(rng)) for _ in range(n_regions)]
        scene = compiled(*regions, law=law)
        asked = drives(scene, law, rng, 300)
        assert asked.min() >= 0.0, regions
        assert asked.max() <= 1.0, regions
        assert scene.applied.gain <= scene.applied.feasible_gain


@pytest.mark.parametrize("pixels", [2, 3, 4, 8])
@pytest.mark.parametrize("slanted", [False, True])
def test_maps_of_the_finest_detail_fit_too(
    rng: np.random.Generator, pixels: int, slanted: bool
) -> None:
    row, column = np.indices((96, 192))
    grey = ((column + row * slanted) % pixels < pixels / 2.0).astype(np.uint8) * 255
    file = io.BytesIO()
    Image.fromarray(grey).save(file, "PNG")
    texture = Map(image_png=base64.b64encode(file.getvalue()).decode(), white_n=1.0)
    scene = compiled(Region(texture=texture, gain=100.0))
    asked = drives(scene, LAW, rng, 500)
    assert asked.min() >= 0.0
    assert asked.max() <= 1.0


def test_narrow_edges_fit_at_every_speed(rng: np.random.Generator) -> None:
    slow = Spectrum(components=[Component(amplitude_n=1.0, cycles_per_mm=0.2)])
    for texture in (slow, Spectrum(components=[Component(amplitude_n=1.0, hz=30.0)])):
        scene = compiled(
            Region(texture=texture, x_mm=(20.0, 40.0), gain=100.0, edge_fade_mm=0.0)
        )
        for x in (20.0, 40.0):
            for speed in rng.uniform(0.0, FASTEST, 100):
                for angle in (0.0, np.pi):
                    motion = straight(
                        x - np.cos(angle) * speed * 150 / RATE, 17.0, speed, angle
                    )
                    y = friction_along(scene, motion, 301, int(rng.integers(0, 10**6)))
                    a = np.exp(-2.0 * np.pi * cutoff_hz(LAW, speed) / RATE)
                    asked = (y[1:] - a * y[:-1]) / ((1.0 - a) * LAW.gain_n)
                    assert asked.min() >= 0.0
                    assert asked.max() <= 1.0


def test_textures_finer_than_slow_fingers_can_feel_fit_at_every_speed(
    rng: np.random.Generator,
) -> None:
    fine = Spectrum(components=[Component(amplitude_n=1.0, cycles_per_mm=240.0)])
    scene = compiled(
        Region(texture=fine, x_mm=(30.0, 31.0), y_mm=(0.0, 35.0), gain=100.0, edge_fade_mm=0.1)
    )
    asked = []
    for speed in np.concatenate([np.linspace(0.5, 10.0, 39), rng.uniform(0.0, 300.0, 30)]):
        y = friction_along(scene, straight(30.5, 17.0, float(speed)), 801)
        a = np.exp(-2.0 * np.pi * cutoff_hz(LAW, speed) / RATE)
        asked.append((y[1:] - a * y[:-1]) / ((1.0 - a) * LAW.gain_n))
    assert np.min(asked) >= 0.0
    assert np.max(asked) <= 1.0
    assert np.ptp(asked) > 0.8  # near 5 mm/s it takes nearly all there is


@pytest.mark.parametrize("name", ["fabric1", "fabric2", "paper", "sandpaper", "vinyl"])
def test_the_gain_is_nearly_the_largest_for_shipped_textures(name: str) -> None:
    texture = texture_of((SHIPPED / f"{name}.json").read_text())
    applied = full_gain(texture, LAW, SCREEN, RATE).applied
    assert applied.scaled
    largest = largest_gain(texture, LAW, SPEEDS_MM_S[1::6], RATE)
    assert 0.9 * largest <= 100.0 * applied.gain <= largest


def test_the_gain_is_nearly_the_largest_for_single_textures(rng: np.random.Generator) -> None:
    amplitude = float(rng.uniform(0.1, 1.0))
    for frequency in (0.3, 2.0, 9.0):
        grating = Spectrum(
            components=[Component(amplitude_n=amplitude, cycles_per_mm=frequency)]
        )
        got = 100.0 * full_gain(grating, LAW, SCREEN, RATE).applied.gain
        felt = SPEEDS_MM_S[frequency * SPEEDS_MM_S <= BAND_EDGE_HZ]
        largest = largest_gain(grating, LAW, felt[1:], RATE)
        assert 0.9 * largest <= got <= largest
    # One temporal sinusoid, by hand: |e^jw - a| / (1 - a) of drive, at the lowest cutoff.
    buzz = Spectrum(components=[Component(amplitude_n=amplitude, hz=250.0)])
    a = np.exp(-2.0 * np.pi * float(cutoff_hz(LAW, 20.0)) / RATE)
    swing = 2.0 * amplitude / LAW.gain_n * abs(np.exp(2j * np.pi * 250.0 / RATE) - a) / (1 - a)
    applied = full_gain(buzz, LAW, SCREEN, RATE).applied
    assert 100.0 * applied.gain == pytest.approx(0.97 / swing, rel=0.01)
    assert applied.bias == pytest.approx(0.5, abs=0.01)


def test_what_fits_is_not_scaled() -> None:
    weak = Spectrum(components=[Component(amplitude_n=0.01, cycles_per_mm=2.0)])
    applied = compiled(Region(texture=weak)).applied
    assert applied.gain == 1.0
    assert not applied.scaled
    assert applied.feasible_gain > 1.0
    assert applied.bias_n == pytest.approx(applied.bias * LAW.gain_n)
    np.testing.assert_allclose(applied.speed_range_mm_s, (0.0, FASTEST), rtol=0.02)
    strong = compiled(Region(texture=weak, gain=100.0)).applied
    assert strong.scaled
    assert strong.gain < 1.0
    assert 100.0 * strong.feasible_gain == pytest.approx(applied.feasible_gain, rel=1e-6)


def test_the_gain_of_a_region_scales_what_is_felt() -> None:
    texture = Spectrum(components=[Component(amplitude_n=0.02, cycles_per_mm=2.0)])
    motion = straight(20.0, 17.0, 60.0)
    felt = []
    for gain in (0.5, 1.0, 2.0):
        scene = compiled(Region(texture=texture, gain=gain))
        felt.append(friction_along(scene, motion, 2_000) - scene.arrays.bias_n)
    np.testing.assert_allclose(felt[1], 2.0 * felt[0], atol=1e-12)
    np.testing.assert_allclose(felt[2], 4.0 * felt[0], atol=1e-12)
    assert np.ptp(felt[1]) == pytest.approx(0.04, rel=0.001)


def test_overlapping_regions_add_and_still_fit(rng: np.random.Generator) -> None:
    texture = Spectrum(components=[Component(amplitude_n=0.05, cycles_per_mm=1.0)])
    left = Region(texture=texture, x_mm=(0.0, 40.0))
    right = Region(texture=texture, x_mm=(30.0, 70.0))
    apart = compiled(left, left.model_copy(update={"x_mm": (41.0, 70.0)})).applied
    scene = compiled(left, right)
    assert scene.applied.feasible_gain == pytest.approx(apart.feasible_gain / 2.0, rel=1e-3)
    assert scene.applied.gain == 1.0
    both = friction_along(scene, straight(32.0, 17.0, 60.0), 2_000) - scene.arrays.bias_n
    one = friction_along(scene, straight(10.0, 17.0, 60.0), 2_000) - scene.arrays.bias_n
    np.testing.assert_allclose(both, 2.0 * one, atol=1e-9)
    asked = drives(scene, LAW, rng, 200)
    assert asked.min() >= 0.0
    assert asked.max() <= 1.0


@pytest.mark.parametrize("angle", [0.0, 90.0, 37.0, -150.0])
def test_across_its_direction_a_texture_does_not_change(angle: float) -> None:
    texture = Spectrum(
        components=[Component(amplitude_n=0.05, cycles_per_mm=3.0)], angle_deg=angle
    )
    scene = compiled(Region(texture=texture))
    across = np.deg2rad(angle + 90.0)
    still = friction_along(scene, straight(35.0, 17.0, 60.0, across), 4_000)
    assert np.ptp(still) < 1e-6
    along = friction_along(scene, straight(35.0, 17.0, 60.0, np.deg2rad(angle)), 4_000)
    phase = (
        2.0
        * np.pi
        * 3.0
        * (
            35.0 * np.cos(np.deg2rad(angle))
            + 17.0 * np.sin(np.deg2rad(angle))
            + 60.0 * np.arange(4_000) / RATE
        )
    )
    np.testing.assert_allclose(along - scene.arrays.bias_n, 0.05 * np.cos(phase), atol=1e-4)


def test_an_empty_scene_is_smooth() -> None:
    scene = compiled()
    assert scene.applied.bias == 0.0
    assert scene.applied.gain == 1.0
    assert not scene.applied.scaled
    renderer = Renderer(LAW, SCREEN, RATE, 100, scene)
    for block in range(10):
        rendered = renderer.render(
            100 * block, PredictedMotion(straight(10.0, 10.0, 60.0)), True
        )
        assert not np.any(rendered.voltage_v)
        assert rendered.clipped_samples == 0


def test_a_region_of_gain_zero_is_smooth() -> None:
    texture = Spectrum(components=[Component(amplitude_n=0.05, cycles_per_mm=3.0)])
    scene = compiled(Region(texture=texture, gain=0.0))
    assert not np.any(friction_along(scene, straight(10.0, 10.0, 60.0), 500))


def test_as_many_regions_as_a_scene_may_have(rng: np.random.Generator) -> None:
    edges = np.linspace(0.0, 70.0, 33)
    regions = [
        Region(
            texture=Spectrum(
                components=[Component(amplitude_n=0.02, cycles_per_mm=1.0 + number)]
            ),
            x_mm=(float(low), float(high)),
            edge_fade_mm=0.2,
        )
        for number, (low, high) in enumerate(pairwise(edges))
    ]
    scene = compiled(*regions)
    assert scene.applied.gain == 1.0
    for number in (0, 13, 31):
        middle = float(edges[number] + edges[number + 1]) / 2.0
        y = friction_along(scene, straight(middle, 10.0, 10.0), 200) - scene.arrays.bias_n
        x = middle + 10.0 * np.arange(200) / RATE
        np.testing.assert_allclose(
            y, 0.02 * np.cos(2.0 * np.pi * (1.0 + number) * x), atol=1e-4
        )
    asked = drives(scene, LAW, rng, 100)
    assert asked.min() >= 0.0
    assert asked.max() <= 1.0


@pytest.mark.parametrize(
    "rectangle",
    [
        {"x_mm": (70.0, 90.0)},
        {"x_mm": (-20.0, 0.0)},
        {"y_mm": (35.0, 36.0)},
        {"y_mm": (-3.0, -1.0)},
    ],
)
def test_a_region_beside_the_screen_is_refused_by_its_number(
    rectangle: dict[str, tuple[float, float]],
) -> None:
    texture = Spectrum(components=[Component(amplitude_n=0.05, cycles_per_mm=3.0)])
    good = Region(texture=texture)
    bad = good.model_copy(update=rectangle)
    with pytest.raises(TextureError, match=r"regions\.1: lies beside the screen of 70 x 35 mm"):
        compiled(good, bad)
    named = bad.model_copy(update={"name": "button"})
    with pytest.raises(TextureError, match=r"regions\.1 button: lies beside"):
        compiled(good, named)


def test_a_texture_that_cannot_be_represented_is_refused_by_its_number() -> None:
    good = Region(texture=Spectrum(components=[Component(amplitude_n=0.1, hz=50.0)]))
    bad = Region(texture=Profile(friction_n=[0.2, 0.2, 0.2], period_mm=1.0))
    with pytest.raises(TextureError, match=r"regions\.2: the texture is constant"):
        compiled(good, good, bad)


def test_tables_that_would_fill_the_memory_are_refused() -> None:
    finest = [Component(amplitude_n=0.01, cycles_per_mm=each) for each in (140.0, 90.0)]
    regions = [Region(texture=Spectrum(components=finest))] * 8
    with pytest.raises(TextureError, match=r"regions\.\d: with those before it, .* 200 MB"):
        compiled(*regions)


def test_what_was_rounded_is_noted() -> None:
    texture = Spectrum(components=[Component(amplitude_n=0.01, hz=50.04)])
    assert compiled(Region(texture=texture)).applied.notes == [
        "temporal frequencies moved by up to 0.04 Hz"
    ]


def test_what_was_left_out_is_noted() -> None:
    texture = Spectrum(
        components=[Component(amplitude_n=0.01, hz=hz) for hz in (50.0, 1_200.0, 3_000.0)]
    )
    assert compiled(Region(texture=texture)).applied.notes == [
        "2 temporal components above 1122 Hz left out: they are not felt"
    ]


@pytest.mark.parametrize("angle_deg", [0.0, 150.0])
@pytest.mark.parametrize("gain", [0.0, 3.0])
def test_of_a_long_recording_the_part_on_the_screen_is_rendered(
    angle_deg: float, gain: float, rng: np.random.Generator
) -> None:
    """Against its sines, up to a constant, which is the bias's."""
    period_mm, count = 900.0, 65_536
    harmonic = np.array([11, 700, 1_500])  # 0.012 to 1.7 cycles/mm
    phase = rng.uniform(0.0, 6.3, harmonic.size)

    def friction(u: FloatArray) -> FloatArray:
        total: FloatArray = np.sum(
            0.01 * np.cos(2.0 * np.pi * np.multiply.outer(u, harmonic) / period_mm + phase),
            axis=-1,
        )
        return total

    beyond = gain * np.arange(count) / count  # what no finger reaches differs much
    samples = friction(period_mm * np.arange(count) / count)
    texture = Profile(
        friction_n=(
            samples + np.where(np.abs(np.arange(count) - 20_000) < 9_000, beyond, 0.0)
        ).tolist(),
        period_mm=period_mm,
        angle_deg=angle_deg,
    )
    scene = compiled(Region(texture=texture))
    speed, angle = 80.0, np.deg2rad(angle_deg)
    x, y = 64.0, 2.0
    if angle_deg == 0.0:
        x, y = 3.0, 20.0
    n = np.arange(8_000)
    got = friction_along(scene, straight(x, y, speed, angle), n.size)
    want = friction(x * np.cos(angle) + y * np.sin(angle) + speed * n / RATE)
    apart = got / scene.applied.gain - want
    assert np.ptp(apart) < 0.01 * np.ptp(want)
    assert scene.arrays.points.size < 2_500_000
