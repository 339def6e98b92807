"""The inner loop: whatever comes in, what goes out is finite, bounded and continuous."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from frictus.textures import Component, Region, Scene, Spectrum
from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.friction import FrictionLaw, cutoff_hz, respond
from frictus_hardware.physics.screen import Screen, drive_fraction_of
from frictus_service.synthesis import kernel
from frictus_service.synthesis.compensator import law_tuple
from frictus_service.synthesis.estimator import PredictedMotion
from frictus_service.synthesis.kernel import BlockMotion
from frictus_service.synthesis.renderer import RAMP_S, Renderer
from frictus_service.synthesis.scene import CompiledScene, compile_scene

pytestmark = pytest.mark.compiled


RATE = 20_000.0
BLOCK = 100
LAW = FrictionLaw()
SCREEN = Screen()
LAW_TUPLE = law_tuple(LAW)
STEEPEST = float(np.sqrt(3.0))  # of sqrt(3 d^2 - 2 d^3), at d = 0

anything = st.floats(allow_nan=True, allow_infinity=True, width=64)
sensible = st.floats(-400.0, 400.0)
number = sensible | anything
motions = st.builds(BlockMotion, number, number, number, number, number, number, number, number)


def scene_of(*regions: Region) -> CompiledScene:
    return compile_scene(Scene(regions=list(regions)), LAW, SCREEN, RATE)


SPATIAL = Spectrum(
    components=[Component(amplitude_n=0.1, cycles_per_mm=k) for k in (0.7, 3.1, 11.0)],
    angle_deg=20.0,
)
TEMPORAL = Spectrum(components=[Component(amplitude_n=0.05, hz=f) for f in (40.0, 310.0)])
FAR = Region(texture=SPATIAL, x_mm=(-1e4, 1e4), y_mm=(-1e4, 1e4), gain=0.3)
EVERYTHING = scene_of(
    Region(texture=SPATIAL), Region(texture=TEMPORAL, x_mm=(10.0, 40.0), edge_fade_mm=0.0), FAR
)


def steady(x_mm: float, speed: float) -> PredictedMotion:
    return PredictedMotion(BlockMotion(x_mm, 17.0, speed, 0.0, speed, 0.0, speed, speed))


@settings(max_examples=300, deadline=None)
@given(
    st.lists(st.tuples(motions, st.none() | motions, st.booleans()), min_size=1, max_size=4),
    st.integers(0, 2**45),
)
@example([(BlockMotion(1e17, 1e17, 60.0, 0.0, 60.0, 0.0, 60.0, 60.0), None, True)], 0)
@example([(BlockMotion(1e299, -1e299, 1e305, 0.0, 0.0, 0.0, 60.0, 60.0), None, True)], 0)
def test_the_output_is_finite_and_bounded_whatever_the_motion(
    blocks: list[tuple[BlockMotion, BlockMotion | None, bool]], first: int
) -> None:
    renderer = Renderer(LAW, SCREEN, RATE, BLOCK, EVERYTHING)
    for number, (motion, left, allow) in enumerate(blocks):
        rendered = renderer.render(first + number * BLOCK, PredictedMotion(motion, left), allow)
        assert np.all((rendered.drive >= 0.0) & (rendered.drive <= 1.0))
        assert np.all(np.abs(rendered.voltage_v) <= SCREEN.peak_v)  # False for NaN
        assert 0.0 <= rendered.level <= 1.0
        assert 0 <= rendered.clipped_samples <= BLOCK
        assert 0 <= rendered.extrapolated_samples <= BLOCK


@settings(max_examples=100, deadline=None)
@given(
    st.lists(anything, min_size=1, max_size=64),
    motions,
    anything,
)
def test_the_drive_is_bounded_and_clipping_is_counted_whatever_the_target(
    target: list[float], motion: BlockMotion, following: float
) -> None:
    drive = np.full(len(target), np.nan)
    clipped, extrapolated = kernel.invert(
        LAW_TUPLE, motion, RATE, np.array(target), following, drive
    )
    assert np.all((drive >= 0.0) & (drive <= 1.0))
    wrong = ~np.isfinite(np.append(target, following))
    assert clipped >= np.count_nonzero(wrong[:-1] & wrong[1:])
    assert 0 <= extrapolated <= len(target)


def fitting(
    rng: np.random.Generator, n_samples: int
) -> tuple[BlockMotion, FloatArray, FloatArray]:
    """A motion, its speed, and a random target that a drive within range produces."""
    begin, end = rng.uniform(*LAW.speed_range_mm_s, 2)
    motion = BlockMotion(0.0, 0.0, begin, 0.0, end, 0.0, begin, end)
    speed = begin + np.arange(n_samples) / n_samples * (end - begin)
    drive = rng.uniform(0.0, 1.0, n_samples)
    return motion, speed, drive


def test_the_inverse_undoes_the_response_at_varying_speed(rng: np.random.Generator) -> None:
    for _ in range(50):
        n_samples = int(rng.integers(1, 300))
        motion, speed, drive = fitting(rng, n_samples)
        friction, after = respond(LAW, drive, speed, RATE, rng.uniform(0.0, LAW.gain_n))
        found = np.empty(n_samples)
        clipped, extrapolated = kernel.invert(LAW_TUPLE, motion, RATE, friction, after, found)
        np.testing.assert_allclose(found, drive, rtol=0.0, atol=1e-9)
        assert clipped == np.count_nonzero((found == 0.0) | (found == 1.0))
        assert extrapolated == 0
        again, last = respond(LAW, found, speed, RATE, float(friction[0]))
        np.testing.assert_allclose(
            np.append(again, last), np.append(friction, after), atol=1e-9
        )


def test_clipping_is_counted_exactly_where_the_drive_does_not_fit(
    rng: np.random.Generator,
) -> None:
    speed = 60.0
    motion = BlockMotion(0.0, 0.0, speed, 0.0, speed, 0.0, speed, speed)
    wanted = rng.uniform(-0.5, 1.5, 400)
    friction, after = respond(LAW, wanted, np.full(400, speed), RATE, 0.1)
    drive = np.empty(400)
    clipped, _ = kernel.invert(LAW_TUPLE, motion, RATE, friction, after, drive)
    assert clipped == np.count_nonzero((wanted < 0.0) | (wanted > 1.0))
    np.testing.assert_allclose(drive, np.clip(wanted, 0.0, 1.0), atol=1e-9)


@pytest.mark.parametrize(
    ("begin", "end"), [(0.0, 40.0), (60.0, 140.0), (5.0, 5.0), (60.0, 60.0)]
)
def test_extrapolation_is_counted_and_follows_the_clamped_speed(
    begin: float, end: float
) -> None:
    motion = BlockMotion(0.0, 0.0, begin, 0.0, end, 0.0, begin, end)
    speed = begin + np.arange(400) / 400 * (end - begin)
    low, high = LAW.speed_range_mm_s
    target = 0.1 + 0.02 * np.sin(np.arange(401) / 7.0)
    drive = np.empty(400)
    _, extrapolated = kernel.invert(LAW_TUPLE, motion, RATE, target[:-1], target[-1], drive)
    assert extrapolated == np.count_nonzero((speed < low) | (speed > high))
    decay = np.exp(-2.0 * np.pi * cutoff_hz(LAW, speed) / RATE)
    np.testing.assert_allclose(
        drive, (target[1:] - decay * target[:-1]) / ((1.0 - decay) * LAW.gain_n), atol=1e-12
    )


def test_the_envelope_makes_arming_and_stopping_continuous(rng: np.random.Generator) -> None:
    renderer = Renderer(LAW, SCREEN, RATE, BLOCK, scene_of())
    step = 1.0 / (RAMP_S * RATE)
    level = 0.0
    ramp = []
    for _ in range(60):
        drive = np.ones(BLOCK)
        level = kernel.envelope(level, float(rng.random() < 0.5), step, drive)
        ramp.append(drive)
    jumps = np.abs(np.diff(np.sqrt(np.concatenate([[0.0], *ramp]))))
    assert jumps.max() <= STEEPEST * step * (1.0 + 1e-9)
    assert renderer.render(0, steady(10.0, 60.0), allow=True).level == pytest.approx(
        BLOCK * step
    )


def test_the_root_of_the_drive_never_jumps_when_output_comes_and_goes(
    rng: np.random.Generator,
) -> None:
    scene = scene_of(
        Region(texture=Spectrum(components=[Component(amplitude_n=0.05, cycles_per_mm=0.5)]))
    )
    renderer = Renderer(LAW, SCREEN, RATE, BLOCK, scene)
    x = 5.0
    roots = [np.zeros(1)]
    for block in range(60):
        rendered = renderer.render(block * BLOCK, steady(x, 60.0), bool(rng.random() < 0.5))
        x += 60.0 * BLOCK / RATE
        roots.append(np.sqrt(rendered.drive))
    step = 1.0 / (RAMP_S * RATE)
    # The grating itself turns at 30 Hz and moves the root by less than this per sample.
    own = 2.0 * np.pi * 30.0 / RATE
    assert np.abs(np.diff(np.concatenate(roots))).max() <= STEEPEST * step + own


@pytest.mark.parametrize("first", [0, 123_457, 20_000 * 86_400 * 30])
def test_volts_do_not_depend_on_how_time_is_split(rng: np.random.Generator, first: int) -> None:
    scene = scene_of(Region(texture=SPATIAL), Region(texture=TEMPORAL))
    n_samples = 12_000
    played = {}
    for size in (1, 25, 100, 400, n_samples):
        renderer = Renderer(LAW, SCREEN, RATE, size, scene)
        volts = np.empty(n_samples)
        for at in range(0, n_samples, size):
            rendered = renderer.render(
                first + at, steady(3.0 + 60.0 * at / RATE, 60.0), allow=at < 9_000
            )
            volts[at : at + size] = rendered.voltage_v
        played[size] = volts[:9_000]  # the largest block stops later
    for size in (1, 25, 400, n_samples):
        np.testing.assert_allclose(played[size], played[100], atol=2e-5 * SCREEN.peak_v)


def test_the_carrier_goes_on_across_blocks_and_days(rng: np.random.Generator) -> None:
    drive = rng.uniform(0.1, 1.0, 1_000)
    first = int(rng.integers(0, 2**42))
    whole = np.empty(1_000)
    kernel.modulate(drive, first, 75.0, 7_000.0, RATE, whole)
    cuts = [0, *sorted(rng.integers(1, 1_000, 7).tolist()), 1_000]
    parts = np.empty(1_000)
    for begin, end in pairwise(cuts):
        kernel.modulate(drive[begin:end], first + begin, 75.0, 7_000.0, RATE, parts[begin:end])
    np.testing.assert_array_equal(parts, whole)
    # Integer arithmetic knows the phase exactly.
    turn = np.array([(first + n) * 7_000 % 20_000 / 20_000 for n in range(1_000)])
    np.testing.assert_allclose(
        whole, 75.0 * np.sqrt(drive) * np.cos(2.0 * np.pi * turn), atol=1e-9
    )
    # Two samples later the carrier's square has turned by 1.4 cycles; over ten it is whole.
    fraction = drive_fraction_of(SCREEN, whole / np.sqrt(drive))
    np.testing.assert_allclose(
        [fraction[at : at + 10].mean() for at in range(0, 1_000, 10)], 1.0, atol=1e-9
    )


def test_overlapping_layers_add(rng: np.random.Generator) -> None:
    motion = BlockMotion(20.0, 15.0, 50.0, 5.0, 60.0, -5.0, 50.2, 60.2)
    parts = [Region(texture=SPATIAL, gain=0.1), Region(texture=TEMPORAL, gain=0.3)]
    together, *alone = (np.empty(200) for _ in range(3))
    scenes = [scene_of(*parts), *(scene_of(part) for part in parts)]
    for scene, out in zip(scenes, (together, *alone), strict=True):
        kernel.target_friction(scene.arrays, motion, 77, RATE, out)
        assert scene.applied.gain == 1.0
        out -= scene.arrays.bias_n
    np.testing.assert_allclose(together, sum(alone), atol=1e-12)


def test_beside_its_region_a_texture_is_not_felt_and_its_edge_is_smooth() -> None:
    region = Region(texture=TEMPORAL, x_mm=(20.0, 40.0), edge_fade_mm=2.0)
    scene = scene_of(region)
    motion = BlockMotion(10.0, 17.0, 100.0, 0.0, 100.0, 0.0, 100.0, 100.0)
    felt = np.empty(8_001)
    kernel.target_friction(scene.arrays, motion, 0, RATE, felt)
    felt -= scene.arrays.bias_n
    everywhere = np.empty(8_001)
    kernel.target_friction(
        scene_of(Region(texture=TEMPORAL)).arrays, motion, 0, RATE, everywhere
    )
    everywhere -= scene_of(Region(texture=TEMPORAL)).arrays.bias_n
    x = 10.0 + 100.0 * np.arange(8_001) / RATE
    inside = np.clip(np.minimum(x - 20.0, 40.0 - x) / 2.0, 0.0, 1.0)
    np.testing.assert_allclose(felt, inside**2 * (3.0 - 2.0 * inside) * everywhere, atol=1e-9)
