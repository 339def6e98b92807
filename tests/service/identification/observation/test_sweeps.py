"""Sweeps come from the reported position alone, whatever the sensor leaves out."""

from itertools import pairwise

import numpy as np
import pytest

from frictus_hardware.arrays import FloatArray
from frictus_hardware.simulated.strokes import SteadyStrokes
from frictus_service.identification.observation.sweeps import (
    Sweep,
    SweepThird,
    TouchMotion,
    cut_thirds,
    find_sweeps,
    smooth,
)

SPAN_MM = 60.0


def scans(seconds: float) -> FloatArray:
    return np.arange(0.0, seconds, 1.0 / 60.0)


def reported(
    speed_mm_s: float, rng: np.random.Generator, seconds: float = 10.0
) -> tuple[FloatArray, FloatArray]:
    """Return what the position sensor says of even strokes, and when."""
    time_s = scans(seconds)
    finger = SteadyStrokes(speed_mm_s=speed_mm_s, span_mm=SPAN_MM).start((70.0, 35.0), rng)
    noisy = finger.at(time_s).position_mm + 0.03 * rng.standard_normal((time_s.size, 2))
    return np.round(noisy, 1), time_s


def found(
    position_mm: FloatArray, time_s: FloatArray
) -> tuple[TouchMotion, list[Sweep], list[SweepThird]]:
    motion = smooth(position_mm, time_s)
    sweeps = find_sweeps(motion, np.ones(motion.time_s.size, dtype=np.bool_))
    return motion, sweeps, cut_thirds(motion, sweeps)


def reversals(speed_mm_s: float) -> int:
    """Return how many sweeps ten seconds hold, the unfinished last one included."""
    reversal_s, overshoot = 0.06, speed_mm_s * 0.06 / np.pi
    half = (SPAN_MM - 2.0 * overshoot) / speed_mm_s + reversal_s
    return int(np.ceil(10.0 / half))


@pytest.mark.parametrize("speed", [20.0, 40.0, 60.0, 80.0, 100.0])
def test_every_sweep_in_both_directions(speed: float, rng: np.random.Generator) -> None:
    _, sweeps, segments = found(*reported(speed, rng))
    expected = reversals(speed)
    assert expected - 1 <= len(sweeps) <= expected
    directions = [sweep.direction for sweep in sweeps]
    assert directions == [(-1) ** n for n in range(len(sweeps))]
    assert {segment.third for segment in segments} == {0, 1, 2}
    for segment in segments:
        assert segment.speed_mm_s == pytest.approx(speed, rel=0.02)
        assert segment.along[0] == pytest.approx(segment.direction, abs=1e-3)


@pytest.mark.parametrize("speed", [60.0, 100.0])
def test_turns_take_nothing_of_the_speed_at_the_ends(
    speed: float, rng: np.random.Generator
) -> None:
    """Lines through the reports of a turn as well drew the ends of a sweep inward."""
    _, _, segments = found(*reported(speed, rng, seconds=120.0))
    middle = [s.speed_mm_s for s in segments if s.third == 1]
    outer = [s.speed_mm_s for s in segments if s.third != 1]
    assert np.mean(middle) == pytest.approx(speed, rel=0.001)
    assert np.mean(outer) == pytest.approx(speed, rel=0.002)


def test_a_rare_sensor_s_sweep_goes_on_to_its_ends() -> None:
    """Fewer than four reports stand about an end, which is no reason to stop there."""
    time_s = np.arange(0.0, 2.0, 1.0 / 35.0)
    place = np.column_stack([60.0 * time_s, np.full(time_s.size, 35.0)])
    _, (sweep,), segments = found(place, time_s)
    assert segments[0].begin_s == sweep.begin_s
    assert segments[-1].end_s == sweep.end_s
    for segment in segments:
        assert segment.speed_mm_s == pytest.approx(60.0, rel=1e-9)


def test_the_whole_sweep_is_used_in_thirds_of_equal_width(rng: np.random.Generator) -> None:
    motion, sweeps, segments = found(*reported(60.0, rng))
    for number, sweep in enumerate(sweeps[1:-1], 1):
        own = [segment for segment in segments if segment.sweep == number]
        assert [s.third for s in own] == ([0, 1, 2] if sweep.direction > 0 else [2, 1, 0])
        edges = motion.position_at(np.array([own[0].begin_s, *(s.end_s for s in own)]))[:, 0]
        widths = np.abs(np.diff(edges))
        assert widths.sum() > 0.8 * SPAN_MM
        np.testing.assert_allclose(widths, widths.mean(), rtol=0.12)
        for before, after in pairwise(own):
            assert before.end_s == after.begin_s


def test_lost_reports_lose_no_sweep(rng: np.random.Generator) -> None:
    position, time_s = reported(60.0, rng)
    _, all_sweeps, _ = found(position, time_s)
    # Never two after each other: a longer silence ends a sweep, and should.
    lost = (rng.uniform(size=time_s.size) < 0.3) & (np.arange(time_s.size) % 2 == 1)
    position[lost] = np.nan
    _, sweeps, segments = found(position, time_s)
    assert [s.direction for s in sweeps] == [s.direction for s in all_sweeps]
    assert all(s.speed_mm_s == pytest.approx(60.0, rel=0.03) for s in segments)


def test_stray_reports_are_left_out(rng: np.random.Generator) -> None:
    position, time_s = reported(60.0, rng)
    _, clean, _ = found(position, time_s)
    # One in five: the median of five tells no more.
    stray = 6 * rng.choice(time_s.size // 6 - 1, 12, replace=False) + rng.integers(2, 4)
    position[stray] = 0.0
    _, sweeps, segments = found(position, time_s)
    assert len(sweeps) == len(clean)
    assert all(s.speed_mm_s == pytest.approx(60.0, rel=0.03) for s in segments)


def test_a_silent_sensor_ends_a_sweep(rng: np.random.Generator) -> None:
    position, time_s = reported(20.0, rng, 3.0)
    gone = (time_s > 1.0) & (time_s < 1.5)
    _, sweeps, _ = found(position[~gone], time_s[~gone])
    assert len(sweeps) == 2
    assert sweeps[0].end_s < 1.0
    assert sweeps[1].begin_s > 1.5


def test_a_pause_is_no_part_of_a_sweep(rng: np.random.Generator) -> None:
    time_s = scans(4.0)
    moving = np.clip(time_s, 0.0, 1.5) + np.clip(time_s - 2.5, 0.0, None)
    position = np.column_stack([5.0 + 20.0 * moving, np.full(time_s.size, 17.0)])
    _, sweeps, _ = found(np.round(position, 1), time_s)
    assert [s.direction for s in sweeps] == [1, 1]
    assert sweeps[0].end_s < 1.55
    assert sweeps[1].begin_s > 2.45


def test_a_lift_is_no_part_of_a_sweep(rng: np.random.Generator) -> None:
    motion = smooth(*reported(20.0, rng, 3.0))
    pressed = (motion.time_s < 1.0) | (motion.time_s > 1.4)
    sweeps = find_sweeps(motion, pressed)
    assert len(sweeps) == 2
    assert sweeps[0].end_s <= 1.0
    assert sweeps[1].begin_s >= 1.4


def test_resting_or_moving_along_y_is_no_sweep(rng: np.random.Generator) -> None:
    time_s = scans(5.0)
    still = np.round(30.0 + 0.1 * rng.standard_normal((time_s.size, 2)), 1)
    assert found(still, time_s)[1:] == ([], [])
    upward = np.column_stack([still[:, 0], 40.0 * np.mod(time_s, 1.0)])
    assert found(upward, time_s)[1:] == ([], [])


@pytest.mark.parametrize("reports", [0, 1, 3, 5])
def test_few_reports_are_no_sweep(reports: int) -> None:
    time_s = scans(1.0)[:reports]
    position = np.column_stack([60.0 * time_s, 0.0 * time_s])
    assert found(position, time_s)[1:] == ([], [])


def test_direction_of_motion_of_an_oblique_path() -> None:
    time_s = scans(1.5)
    position = np.column_stack([40.0 * time_s, 5.0 + 10.0 * time_s])
    _, _, segments = found(np.round(position, 1), time_s)
    for segment in segments:
        assert np.hypot(*segment.along) == pytest.approx(1.0)
        assert segment.along[1] / segment.along[0] == pytest.approx(0.25, abs=0.02)
        assert segment.speed_mm_s == pytest.approx(np.hypot(40.0, 10.0), rel=0.01)
