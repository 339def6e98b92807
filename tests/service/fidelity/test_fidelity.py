"""The promise: what is felt is what was asked for. Small; `bench/fidelity.py` is the whole.

Everything is felt by the twin, through the rig's lead and, where it is said, its touch sensor.
"""

from dataclasses import replace
from functools import cache
from pathlib import Path as File

import numpy as np
import pytest

from frictus.recordings import load_texture, texture_of
from frictus.textures import Texture
from frictus_hardware.physics.friction import FrictionLaw
from frictus_hardware.physics.linear import Mount
from frictus_hardware.physics.screen import Screen
from frictus_hardware.physics.stages import Quantisation, SensorNoise, standard_twin
from frictus_hardware.simulated.config import SimulatedConfig
from frictus_hardware.simulated.human import HumanStrokes
from frictus_hardware.simulated.motion import Press
from frictus_hardware.simulated.strokes import SteadyStrokes
from frictus_service.fidelity.measure import (
    Error,
    compare,
    feel,
    full_gain,
    steady_segments,
    target_along,
)
from frictus_service.fidelity.path import Path, walk
from frictus_service.fidelity.preview import JND_DB, windows
from frictus_service.library import SHIPPED
from frictus_service.synthesis.compensation import fixed_at, uncompensated
from frictus_service.synthesis.scene import CompiledScene

pytestmark = pytest.mark.long

RATE = 20_000.0
LAW = FrictionLaw()
SCREEN = Screen()
RECORDINGS = File(__file__).parents[4] / "shared" / "data" / "makesense_textures"


@cache
def shipped(name: str) -> Texture:
    return texture_of((SHIPPED / f"{name}.json").read_text(encoding="utf-8"))


@cache
def scene_of(name: str, law: FrictionLaw) -> CompiledScene:
    return full_gain(shipped(name), law, SCREEN, RATE)


def judge(
    path: Path,
    texture: Texture,
    scene: CompiledScene,
    segments: list[slice],
    played: FrictionLaw = LAW,
    law: FrictionLaw = LAW,
    noise: bool = True,
) -> Error:
    """Feel a scene along a path with a finger of a given `law`; `played` is inverted."""
    sensors = (SensorNoise(0.002, 0.05, 1), Quantisation()) if noise else ()
    twin = standard_twin(screen=SCREEN, law=law, sensors=sensors)
    signals, clipped = feel(path, scene, played, SCREEN, twin)
    target = target_along(texture, scene, path)
    return compare(signals, clipped, target, Mount().lateral, segments)


def steady(
    rng: np.random.Generator, speed: float, known: bool, duration_s: float = 4.0
) -> Path:
    press = Press(wander_n=0.0) if known else Press()
    finger = SteadyStrokes(speed_mm_s=speed, press=press)
    config = SimulatedConfig(finger=finger, seed=int(rng.integers(2**31)))
    return walk(config, duration_s, known)


@pytest.mark.parametrize("speed", [20.0, 60.0, 100.0])
def test_with_a_known_finger_textures_are_exact(rng: np.random.Generator, speed: float) -> None:
    path = steady(rng, speed, known=True)
    segments = steady_segments(path, speed)
    for name in ("flat", "vinyl", "sandpaper"):
        scene = scene_of(name, LAW)
        error = judge(path, shipped(name), scene, segments, noise=False)
        assert error.clipped_samples == 0, name
        assert error.waveform <= 0.02, name
        assert error.rms_db <= 0.1, name
        assert error.sensor_rms_db <= 0.2, name


@pytest.mark.parametrize("speed", [40.0, 60.0])
def test_steady_strokes_through_the_touch_sensor(
    rng: np.random.Generator, speed: float
) -> None:
    path = steady(rng, speed, known=False, duration_s=10.0 if speed < 50.0 else 6.0)
    segments = steady_segments(path, speed)
    for name in ("flat", "vinyl"):
        error = judge(path, shipped(name), scene_of(name, LAW), segments)
        assert error.rms_db <= 0.5, name
        assert error.worst_db <= 1.5, name


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_a_participant_with_a_model_of_their_own(
    rng: np.random.Generator, factor: float
) -> None:
    law = replace(
        LAW,
        cutoff_0_hz=factor * LAW.cutoff_0_hz,
        slope_hz_per_mm_s=factor * LAW.slope_hz_per_mm_s,
    )
    scene = scene_of("flat", law)
    ways = {"own": law, "fixed": fixed_at(law, 60.0), "none": uncompensated(law)}
    squares: dict[str, list[float]] = {name: [] for name in ways}
    for speed in (20.0, 40.0, 100.0):
        path = steady(rng, speed, known=True)
        segments = steady_segments(path, speed)
        for name, played in ways.items():
            error = judge(path, shipped("flat"), scene, segments, played, law)
            squares[name].append(error.rms_db**2)
    own, fixed, none = (float(np.sqrt(np.mean(squares[name]))) for name in ways)
    assert own <= fixed / 3.0
    assert own <= none / 3.0


def test_free_strokes_stay_below_the_difference_threshold(rng: np.random.Generator) -> None:
    seeds = rng.integers(2**31, size=2).tolist()
    errors: dict[str, list[float]] = {"flat": [], "vinyl": []}
    for seed in seeds:
        path = walk(SimulatedConfig(finger=HumanStrokes(), seed=seed), 8.0)
        segments = [
            slice(part.start + 6_000, part.stop + 6_000)
            for part in windows(path.position_mm.shape[0] - 6_000, 8_192)
        ]
        for name, found in errors.items():
            found.append(judge(path, shipped(name), scene_of(name, LAW), segments).rms_db)
    for name, found in errors.items():
        assert max(found) <= JND_DB, (name, found)


@pytest.mark.skipif(not RECORDINGS.is_dir(), reason="the recordings are not beside the project")
def test_a_recording_is_rendered_as_it_was_made(rng: np.random.Generator) -> None:
    texture = load_texture(RECORDINGS / "Vinyl_filt.csv", speed_mm_s=40.0, sample_rate_hz=RATE)
    scene = full_gain(texture, LAW, SCREEN, RATE)
    path = steady(rng, 40.0, known=True)
    error = judge(path, texture, scene, steady_segments(path, 40.0), noise=False)
    assert error.clipped_samples == 0
    assert error.waveform <= 0.02
    assert error.rms_db <= 0.1
