"""Sensors are aligned by strokes: from made signals with known answers, and by the twin."""

import numpy as np
import pytest

from frictus_hardware import SimulatedConfig
from frictus_hardware.arrays import FloatArray
from frictus_hardware.sensors.rotation import AXES, angle_deg, in_turn
from frictus_hardware.simulated.config import draw_participant
from frictus_hardware.simulated.human import HumanStrokes
from frictus_hardware.simulated.rig import SimulatedRig
from frictus_hardware.simulated.sensors import NailConfig, TouchConfig
from frictus_hardware.simulated.strokes import SteadyStrokes
from frictus_service.errors import AlignmentError
from frictus_service.identification.observation.sensor_alignment import (
    SensorAlignment,
    align_sensors,
)
from frictus_service.identification.observation.stroke_pieces import SensedStrokes

RATE_HZ = 10_000.0
REPORT_HZ = 60.0


def moved(
    seconds: float,
    axes: FloatArray,
    late_s: float,
    rng: np.random.Generator,
    rate_hz: float = RATE_HZ,
) -> SensedStrokes:
    """A point on sums of sinusoids, on a level screen, with rigid skin and exact sensors."""
    tones_hz = np.array([0.6, 1.1, 1.7, 2.6, 3.9])
    size_mm = 20.0 / tones_hz[:, np.newaxis] * axes
    phase = rng.uniform(0.0, 2.0 * np.pi, (tones_hz.size, 2))
    angular = 2.0 * np.pi * tones_hz[:, np.newaxis]

    def at(time_s: FloatArray, order: int) -> FloatArray:
        turned = angular * time_s[:, np.newaxis, np.newaxis] + phase + 0.5 * np.pi * order
        summed: FloatArray = np.sum(size_mm * angular**order * np.sin(turned), axis=1)
        return summed

    time_s = np.arange(round(seconds * rate_hz)) / rate_hz
    accel = np.column_stack([1e-3 * at(time_s, 2), np.full(time_s.size, -9.80665)])
    force = np.column_stack([np.zeros((time_s.size, 2)), np.full(time_s.size, 0.4)])
    stamped_s = np.arange(0.0, seconds, 1.0 / REPORT_HZ)
    return SensedStrokes(rate_hz, force, accel, stamped_s, at(stamped_s - late_s, 0))


def turned(strokes: SensedStrokes, matrix: FloatArray) -> SensedStrokes:
    return strokes._replace(accel_m_s2=strokes.accel_m_s2 @ matrix.T)


BOTH = np.array([1.0, 0.7])
ALONG_X = np.array([1.0, 0.0])


@pytest.mark.parametrize("late_s", [-0.02, 0.0, 0.012, 0.05])
@pytest.mark.parametrize(
    "mounted_deg", [(0.0, 0.0, 0.0), (10.0, -20.0, 155.0), (90.0, 0.0, 180.0)]
)
def test_rotation_and_delay_of_a_moved_point_are_found(
    late_s: float, mounted_deg: tuple[float, float, float], rng: np.random.Generator
) -> None:
    mounted = in_turn(tuple(zip(AXES, mounted_deg, strict=True)))
    found = align_sensors([turned(moved(12.0, BOTH, late_s, rng), mounted)])
    assert angle_deg(found.rotation @ mounted) < 0.5
    assert found.touch_late_s == pytest.approx(late_s, abs=2e-4)
    assert found.scale == pytest.approx(1.0, abs=0.01)
    assert found.along == (True, True)
    assert not found.mirrored
    assert found.off_level_deg is not None
    assert found.off_level_deg < 1.0
    assert found.friction_off_deg is None  # no lateral force


def test_the_angle_about_the_stroke_is_known_by_gravity_alone(rng: np.random.Generator) -> None:
    strokes = moved(12.0, ALONG_X, 0.0, rng)
    found = align_sensors([strokes])
    assert found.along == (True, False)
    assert found.rotation_sd_deg[0] > 5.0 > 1.0 > max(found.rotation_sd_deg[1:])
    # Coupled through a capacitor: nothing tells the angle.
    coupled = strokes._replace(accel_m_s2=strokes.accel_m_s2 - [0.0, 0.0, -9.80665])
    unknown = align_sensors([coupled])
    assert unknown.rotation_sd_deg[0] > 90.0
    assert unknown.off_level_deg is None
    assert max(unknown.rotation_sd_deg[1:]) < 1.0


@pytest.mark.parametrize("rate_hz", [1_000.0, 1_700.0, 44_100.0])
def test_any_rate_will_do(rate_hz: float, rng: np.random.Generator) -> None:
    found = align_sensors([moved(12.0, BOTH, 0.01, rng, rate_hz)])
    assert found.touch_late_s == pytest.approx(0.01, abs=3e-4)
    assert found.scale == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize("axis", [0, 1])
def test_a_channel_with_the_wrong_sign_is_no_rotation(
    axis: int, rng: np.random.Generator
) -> None:
    mirror = np.eye(3)
    mirror[axis, axis] = -1.0
    assert align_sensors([turned(moved(12.0, BOTH, 0.0, rng), mirror)]).mirrored


def test_a_wrong_unit_shows(rng: np.random.Generator) -> None:
    strokes = moved(12.0, BOTH, 0.0, rng)
    in_g = align_sensors([strokes._replace(accel_m_s2=strokes.accel_m_s2 / 9.80665)])
    assert in_g.scale == pytest.approx(1.0 / 9.80665, rel=0.02)


@pytest.mark.parametrize(("sign", "off_deg"), [(1.0, 0.0), (-1.0, 180.0)])
def test_friction_goes_with_the_motion(
    sign: float, off_deg: float, rng: np.random.Generator
) -> None:
    strokes = moved(12.0, BOTH, 0.0, rng)
    velocity = np.gradient(strokes.touch_mm, strokes.touch_s, axis=0)
    time_s = np.arange(strokes.force_n.shape[0]) / RATE_HZ
    force = strokes.force_n.copy()
    for axis in range(2):
        force[:, axis] = sign * 1e-5 * np.interp(time_s, strokes.touch_s, velocity[:, axis])
    found = align_sensors([strokes._replace(force_n=force)])
    assert found.friction_off_deg is not None
    assert abs(found.friction_off_deg) == pytest.approx(off_deg, abs=5.0)


def test_what_is_missing_is_left_out(rng: np.random.Generator) -> None:
    strokes = moved(20.0, BOTH, 0.01, rng)
    accel, force = strokes.accel_m_s2.copy(), strokes.force_n.copy()
    accel[70_000:70_500] = force[70_000:70_500] = np.nan
    kept = np.abs(strokes.touch_s - 13.0) > 0.2
    with_gaps = SensedStrokes(
        RATE_HZ, force, accel, strokes.touch_s[kept], strokes.touch_mm[kept]
    )
    found = align_sensors([with_gaps])
    whole = align_sensors([strokes])
    assert found.touch_late_s == pytest.approx(0.01, abs=3e-4)
    assert 2.0 < whole.seconds - found.seconds < 5.0
    # Pieces of several recordings count together.
    assert align_sensors([with_gaps, strokes]).seconds == pytest.approx(
        whole.seconds + found.seconds
    )


def test_what_cannot_be_told_is_said(rng: np.random.Generator) -> None:
    strokes = moved(12.0, BOTH, 0.0, rng)
    few = strokes.touch_s < 3.0
    short = strokes._replace(touch_s=strokes.touch_s[few], touch_mm=strokes.touch_mm[few])
    with pytest.raises(AlignmentError, match=r"followed for .* s .* at least 4 s"):
        align_sensors([short])
    with pytest.raises(AlignmentError, match=r"followed for 0\.0 s"):
        align_sensors([])
    still = strokes._replace(touch_mm=np.zeros_like(strokes.touch_mm))
    with pytest.raises(AlignmentError, match="hardly accelerated"):
        align_sensors([still])
    dead = strokes._replace(accel_m_s2=rng.standard_normal(strokes.accel_m_s2.shape))
    with pytest.raises(AlignmentError, match=r"does not move|nowhere within"):
        align_sensors([dead])


def stroked(seed: int, finger: HumanStrokes | SteadyStrokes, late_s: float) -> SensorAlignment:
    """By the twin: somebody's skin, gravity that leaks, noise, coarse touch."""
    config = SimulatedConfig(
        clock="virtual",
        finger=finger,
        participant=draw_participant(np.random.default_rng(seed)),
        nail=NailConfig(mounted_deg=(10.0, 20.0, 155.0)),
        touch=TouchConfig(latency_s=0.03 + late_s, declared_latency_s=0.03),
        seed=seed,
    )
    force, accel, reports = [], [], []
    with SimulatedRig(config) as rig:
        for _ in range(1000):
            exchange = rig.exchange(np.zeros(400))
            force.append(exchange.force_n)
            accel.append(exchange.accel_m_s2)
            reports += [
                (touch.measured_sample / config.sample_rate_hz, touch.x_mm, touch.y_mm)
                for touch in exchange.touches
                if touch.in_contact
            ]
    touched = np.array(reports)
    return align_sensors(
        [
            SensedStrokes(
                config.sample_rate_hz,
                np.concatenate(force),
                np.concatenate(accel),
                touched[:, 0],
                touched[:, 1:],
            )
        ]
    )


@pytest.mark.long
@pytest.mark.parametrize("person", range(4))
@pytest.mark.parametrize("finger", [HumanStrokes(), SteadyStrokes(speed_mm_s=80.0)])
def test_intervals_hold_for_people(
    person: int, finger: HumanStrokes | SteadyStrokes, seed: int
) -> None:
    late_s = 0.008 - 0.004 * person
    found = stroked(seed, finger, late_s)
    mounted = in_turn((("x", 10.0), ("y", 20.0), ("z", 155.0)))
    assert angle_deg(found.rotation @ mounted) < 2.0
    # Three standard deviations, and what the touch sensor's steps leave of a made delay.
    assert abs(found.touch_late_s - late_s) < 3.0 * found.touch_late_sd_s + 5e-4
    assert found.touch_late_sd_s < 0.003
    assert found.explained > 0.9
    assert found.friction_off_deg == pytest.approx(0.0, abs=5.0)
