"""Virtual fingers: continuous, on the screen, reproducible, and of the stated kind."""

import functools
import math
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from pydantic import TypeAdapter, ValidationError
from tests.plain import plain

from frictus_hardware.arrays import FloatArray
from frictus_hardware.errors import ConfigError
from frictus_hardware.simulated.config import FingerConfig
from frictus_hardware.simulated.guided import ClientFinger, PointerFinger
from frictus_hardware.simulated.human import (
    LOOP_S,
    MIDDLE_MM,
    PAUSE_PROBABILITY,
    PAUSE_S,
    SPEED_MM_S,
    SPEED_PER_LENGTH,
    STROKE_MM,
    HumanFinger,
    HumanStrokes,
    draw_strokes,
)
from frictus_hardware.simulated.kernels import LIFT_RAMP_S, add_sinusoids
from frictus_hardware.simulated.motion import Finger, Press, Wander
from frictus_hardware.simulated.strokes import (
    PLACES,
    Circles,
    SinusoidalStrokes,
    SteadyStrokes,
    Taps,
)

SCREEN_MM = (70.0, 35.0)
Start = Callable[[tuple[float, float], np.random.Generator], Finger]
ALONE = [
    SteadyStrokes(speed_mm_s=20.0),
    SteadyStrokes(speed_mm_s=100.0),
    SinusoidalStrokes(),
    HumanStrokes(),
    HumanStrokes(lift_probability=0.5, tremor_mm=0.2, drift_mm=20.0),
    Circles(),
    Circles(speed_mm_s=100.0, radius_mm=17.5, turns=1, ramp_s=0.1, rest_s=0.0),
    Taps(),
    Taps(contact_s=0.06, ramp_s=0.02, lift_s=0.1, reach_mm=31.0),
]


def ticks(begin: int, end: int, step_s: float = 1e-3) -> NDArray[np.float64]:
    return np.arange(begin, end, dtype=np.float64) * step_s


@pytest.fixture(params=ALONE, ids=lambda strokes: f"{strokes.kind}")
def start(request: pytest.FixtureRequest) -> Start:
    begin: Start = request.param.start
    return begin


def test_velocity_is_the_derivative_of_position(start: Start, rng: np.random.Generator) -> None:
    finger = start(SCREEN_MM, rng)
    step_s = 1e-5
    time_s = ticks(0, 200_000, step_s) + rng.uniform(0.0, 30.0)
    motion = finger.at(time_s)
    middle = 0.5 * (motion.velocity_mm_s[1:] + motion.velocity_mm_s[:-1])
    slope = np.diff(motion.position_mm, axis=0) / step_s
    np.testing.assert_allclose(slope, middle, atol=0.05)
    # No jumps: at most 0.15 mm/s in 10 us, which is 15 m/s².
    assert np.max(np.abs(np.diff(motion.velocity_mm_s, axis=0))) < 0.15


def test_always_on_the_screen_and_pressing(start: Start, rng: np.random.Generator) -> None:
    motion = start(SCREEN_MM, rng).at(np.arange(0.0, 2.2 * LOOP_S, 0.01))
    assert np.all((motion.position_mm >= 0.0) & (motion.position_mm <= SCREEN_MM))
    assert np.all((motion.normal_force_n > 0.0) == motion.in_contact)
    assert np.any(motion.in_contact)
    assert np.max(motion.normal_force_n) < 1.0


def test_seed_decides(start: Start) -> None:
    time_s = np.arange(0.0, 5.0, 0.01)
    one, same, other = (
        start(SCREEN_MM, np.random.default_rng(seed)).at(time_s) for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(one.position_mm, same.position_mm)
    np.testing.assert_array_equal(one.normal_force_n, same.normal_force_n)
    assert not np.array_equal(one.normal_force_n, other.normal_force_n)


def test_a_pure_function_of_time(start: Start, rng: np.random.Generator) -> None:
    finger = start(SCREEN_MM, rng)
    time_s = np.arange(0.0, 3.0, 0.01)
    whole = finger.at(time_s)
    finger.at(time_s + 100.0)
    np.testing.assert_allclose(finger.at(time_s[100:]).position_mm, whole.position_mm[100:])


def test_wander_can_be_off() -> None:
    still = SteadyStrokes(press=Press(target_n=0.3, wander_n=0.0))
    motion = still.start(SCREEN_MM, np.random.default_rng(0)).at(np.arange(0.0, 5.0, 0.01))
    assert np.all(motion.normal_force_n == 0.3)


def test_wander_has_its_size(rng: np.random.Generator) -> None:
    wandering = SteadyStrokes(press=Press(target_n=0.5, wander_n=0.05))
    time_s = np.arange(0.0, 200.0, 0.05)
    # Of ten fingers: two of one finger's six waves may beat for minutes.
    force_n = np.concatenate(
        [wandering.start(SCREEN_MM, rng).at(time_s).normal_force_n for _ in range(10)]
    )
    assert np.mean(force_n) == pytest.approx(0.5, abs=0.01)
    assert np.std(force_n) == pytest.approx(0.05, rel=0.1)


def test_steady_strokes_are_steady() -> None:
    finger = SteadyStrokes(speed_mm_s=40.0, span_mm=50.0).start(
        SCREEN_MM, np.random.default_rng(0)
    )
    motion = finger.at(np.arange(0.0, 60.0, 0.001))
    speed = np.abs(motion.velocity_mm_s[:, 0])
    assert np.mean(np.isclose(speed, 40.0)) > 0.9
    assert np.ptp(motion.position_mm[:, 0]) == pytest.approx(50.0, abs=1e-3)
    assert np.mean(motion.velocity_mm_s[:, 0] > 0.0) == pytest.approx(0.5, abs=0.02)


def test_sinusoidal_strokes_have_their_peak_speed_and_span() -> None:
    finger = SinusoidalStrokes(peak_speed_mm_s=80.0, span_mm=40.0).start(
        SCREEN_MM, np.random.default_rng(0)
    )
    motion = finger.at(np.arange(0.0, 20.0, 0.001))
    assert np.max(motion.velocity_mm_s[:, 0]) == pytest.approx(80.0, rel=1e-4)
    assert np.ptp(motion.position_mm[:, 0]) == pytest.approx(40.0, rel=1e-4)


def test_a_circle_has_its_radius_and_speed_between_ramps_from_rest_to_rest() -> None:
    circles = Circles(speed_mm_s=60.0, radius_mm=10.0, turns=3, ramp_s=0.2, rest_s=0.5)
    finger = circles.start(SCREEN_MM, np.random.default_rng(0))
    way_mm = 3 * 2.0 * np.pi * 10.0
    run_s = way_mm / 60.0 + 0.2
    step_s = 1e-4
    time_s = np.arange(0.0, 2.0 * (run_s + 0.5), step_s)
    motion = finger.at(time_s)
    offset = motion.position_mm - [35.0, 17.5]
    np.testing.assert_allclose(np.hypot(*offset.T), 10.0, rtol=1e-12)
    speed = np.hypot(*motion.velocity_mm_s.T)
    there = time_s % (run_s + 0.5)
    cruise = (there > 0.2) & (there < run_s - 0.2)
    np.testing.assert_allclose(speed[cruise], 60.0, rtol=1e-12)
    assert np.all(speed[there > run_s] == 0.0), "it rests"
    assert speed[0] == 0.0
    assert np.all(speed <= 60.0 + 1e-9)
    # As far as it was meant to, and back the other way round.
    first = there == time_s
    assert np.sum(speed[first]) * step_s == pytest.approx(way_mm, rel=1e-4)
    turned = (
        offset[:, 0] * motion.velocity_mm_s[:, 1] - offset[:, 1] * motion.velocity_mm_s[:, 0]
    )
    assert np.all(turned[first] >= 0.0)
    assert np.all(turned[~first] <= 0.0)
    np.testing.assert_allclose(finger.at(np.array([run_s])).position_mm, [[45.0, 17.5]])
    # Of v = V (10 u³ - 15 u⁴ + 6 u⁵): at most 1.875 V / T along the circle, beside V² / R.
    gained = np.abs(np.diff(speed)) / step_s
    assert np.max(gained) == pytest.approx(1.875 * 60.0 / 0.2, rel=1e-3)
    turn = np.hypot(*np.diff(motion.velocity_mm_s, axis=0).T) / step_s
    assert np.median(turn[cruise[1:]]) == pytest.approx(60.0**2 / 10.0, rel=1e-3)


def test_a_circle_of_ramps_alone_reaches_its_speed_once() -> None:
    circles = Circles(speed_mm_s=20.0 * np.pi, radius_mm=10.0, turns=1, ramp_s=1.0, rest_s=0.0)
    finger = circles.start(SCREEN_MM, np.random.default_rng(0))
    motion = finger.at(np.array([0.0, 0.5, 1.0, 1.5, 2.0]))
    speed = np.hypot(*motion.velocity_mm_s.T)
    np.testing.assert_allclose(
        speed, 20.0 * np.pi * np.array([0.0, 0.5, 1.0, 0.5, 0.0]), atol=1e-9
    )
    np.testing.assert_allclose(motion.position_mm[2], [25.0, 17.5], atol=1e-9)


def test_a_tap_has_its_force_and_least_jerk() -> None:
    press = Press(target_n=0.8, wander_n=0.0)
    taps = Taps(contact_s=0.2, ramp_s=0.05, lift_s=0.3, press=press)
    finger = taps.start(SCREEN_MM, np.random.default_rng(3))
    step_s = 1e-5
    time_s = np.arange(0.0, 1.0, step_s)
    motion = finger.at(time_s)
    there = time_s % 0.5
    force = motion.normal_force_n
    held = (there > 0.05) & (there < 0.15)
    np.testing.assert_allclose(force[held], 0.8, rtol=1e-12)
    assert np.all(force[there > 0.2 + step_s] == 0.0)
    assert np.max(force) <= 0.8
    assert finger.at(np.array([0.025])).normal_force_n[0] == pytest.approx(0.4)
    # Of s = 10 u³ - 15 u⁴ + 6 u⁵: at most 1.875 F / T and 60 F / T³ (which holds at the ends).
    assert np.max(np.abs(np.diff(force))) / step_s == pytest.approx(
        1.875 * 0.8 / 0.05, rel=1e-3
    )
    ramp = finger.at(np.arange(0.0, 0.05, 1e-4)).normal_force_n
    jerk = np.abs(np.diff(ramp, 3)) / 1e-4**3
    assert np.max(jerk) <= 60.0 * 0.8 / 0.05**3
    assert np.max(jerk) == pytest.approx(60.0 * 0.8 / 0.05**3, rel=0.03)


def test_a_tap_rests_where_it_lands_and_moves_above_the_screen() -> None:
    taps = Taps(contact_s=0.2, lift_s=0.3, reach_mm=20.0)
    finger = taps.start(SCREEN_MM, np.random.default_rng(4))
    motion = finger.at(np.arange(0.0, 0.5 * PLACES, 1e-3))
    speed = np.hypot(*motion.velocity_mm_s.T)
    assert np.all(speed[motion.in_contact] < 1e-9)
    assert speed[0] == 0.0
    assert np.mean(motion.in_contact) == pytest.approx(0.4, abs=0.01)
    assert np.all(np.abs(motion.position_mm - [35.0, 17.5]) <= 10.0)
    landed = motion.position_mm[100::500]
    np.testing.assert_allclose(landed, finger.places_mm, atol=1e-12)
    assert np.std(landed) > 2.0
    middle = motion.velocity_mm_s[350::500]  # of least jerk: 1.875 of the mean speed
    way = np.roll(finger.places_mm, -1, axis=0) - finger.places_mm
    np.testing.assert_allclose(middle, 1.875 * way / 0.3, rtol=1e-9, atol=1e-9)


def test_taps_may_all_be_at_one_place() -> None:
    finger = Taps(reach_mm=0.0).start(SCREEN_MM, np.random.default_rng(0))
    motion = finger.at(np.arange(0.0, 3.0, 0.01))
    np.testing.assert_allclose(motion.position_mm, [[35.0, 17.5]] * 300)
    assert not motion.velocity_mm_s.any()


def test_ramps_that_do_not_fit_a_tap_are_refused() -> None:
    with pytest.raises(ConfigError, match=r"lower ramp_s to 0\.05 or raise contact_s"):
        Taps(contact_s=0.1, ramp_s=0.06).start(SCREEN_MM, np.random.default_rng(0))


@pytest.mark.parametrize(
    "wrong",
    [
        {"kind": "circle", "speed_mm_s": 0.0},
        {"kind": "circle", "radius_mm": float("nan")},
        {"kind": "circle", "turns": 0},
        {"kind": "circle", "turns": 1.5},
        {"kind": "circle", "rest_s": -0.1},
        {"kind": "circle", "span_mm": 10.0},
        {"kind": "tap", "contact_s": 0.0},
        {"kind": "tap", "ramp_s": 0.001},
        {"kind": "tap", "lift_s": float("inf")},
        {"kind": "tap", "reach_mm": -1.0},
        {"kind": "tap", "press": {"target_n": 6.0}},
    ],
)
def test_circles_and_taps_that_cannot_be_are_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(ValidationError):
        TypeAdapter(FingerConfig).validate_python(wrong)


@pytest.mark.parametrize(
    "strokes",
    [
        SteadyStrokes(span_mm=80.0),
        SteadyStrokes(span_mm=10.0, speed_mm_s=100.0, reversal_s=0.5),
        SinusoidalStrokes(span_mm=71.0),
        Circles(radius_mm=17.6),
        Circles(turns=1, radius_mm=1.0, ramp_s=0.2),
        Taps(reach_mm=31.1),
    ],
)
def test_strokes_that_do_not_fit_are_refused(
    strokes: SteadyStrokes | SinusoidalStrokes | Circles | Taps,
) -> None:
    with pytest.raises(ConfigError, match="mm"):
        strokes.start(SCREEN_MM, np.random.default_rng(0))


def test_human_strokes_on_a_small_screen_are_refused() -> None:
    with pytest.raises(ConfigError, match="at least"):
        HumanStrokes().start((30.0, 30.0), np.random.default_rng(0))


def test_human_strokes_are_drawn_as_stated(rng: np.random.Generator) -> None:
    strokes = draw_strokes(HumanStrokes(), 66.0, rng)
    length = np.abs(strokes.to_mm - strokes.from_mm)
    assert np.all((length >= STROKE_MM[0] - 1e-9) & (length <= STROKE_MM[1] + 1e-9))
    assert np.all(np.sign(strokes.to_mm - strokes.from_mm)[::2] == 1.0)
    assert np.all(np.sign(strokes.to_mm - strokes.from_mm)[1::2] == -1.0)
    speed = length / strokes.move_s
    assert np.all((speed >= SPEED_MM_S[0] - 1e-9) & (speed <= SPEED_MM_S[1] + 1e-9))
    at_middle = speed / (length / MIDDLE_MM) ** SPEED_PER_LENGTH
    assert np.median(at_middle) == pytest.approx(60.0, rel=0.06)
    rest = np.diff(np.append(strokes.begin_s, strokes.loop_s)) - strokes.move_s
    pauses = rest[rest > 1e-6]
    assert np.all((pauses >= PAUSE_S[0] - 1e-6) & (pauses <= PAUSE_S[1] + 1e-6))
    assert pauses.size / rest.size == pytest.approx(PAUSE_PROBABILITY, abs=0.08)
    assert strokes.to_mm[-1] == pytest.approx(strokes.from_mm[0])  # the loop closes
    assert strokes.loop_s > LOOP_S


def test_human_lifts_between_strokes(rng: np.random.Generator) -> None:
    finger = HumanStrokes(lift_probability=1.0).start(SCREEN_MM, rng)
    motion = finger.at(np.arange(0.0, 60.0, 0.001))
    lifted = ~motion.in_contact
    assert 0.05 < np.mean(lifted) < 0.4
    assert np.max(np.abs(motion.velocity_mm_s[lifted, 0])) < 10.0  # only the tremor
    assert np.max(np.abs(np.diff(motion.normal_force_n))) < 0.05


def pointer() -> PointerFinger:
    return ClientFinger(smoothing_hz=8.0).start(SCREEN_MM, np.random.default_rng(0))


def test_pointer_is_off_the_screen_until_a_point_comes() -> None:
    motion = pointer().at(ticks(0, 10))
    assert not np.any(motion.in_contact)
    assert not np.any(motion.normal_force_n)


def test_pointer_glides_to_the_newest_point() -> None:
    finger = pointer()
    finger.push(10.0, 10.0, True, 0.4)
    landed = finger.at(ticks(0, 100))
    np.testing.assert_allclose(landed.position_mm, 10.0)
    finger.push(30.0, 20.0, True, 0.4)
    finger.push(20.0, 20.0, True, 0.4)
    glide = finger.at(ticks(100, 1_100))
    np.testing.assert_allclose(glide.position_mm[-1], [20.0, 20.0], atol=1e-6)
    assert np.max(glide.position_mm[:, 0]) <= 20.0  # no overshoot
    slope = np.diff(glide.position_mm[:, 0]) / 1e-3
    middle = 0.5 * (glide.velocity_mm_s[1:, 0] + glide.velocity_mm_s[:-1, 0])
    np.testing.assert_allclose(slope, middle, atol=2.0)


def test_pointer_points_at_60_hz_become_a_steady_slide() -> None:
    finger = pointer()
    finger.push(5.0, 17.0, True, 0.4)
    speed = []
    for block in range(200):  # 5 ms each; a point every 15 ms at 60 mm/s
        if block % 3 == 0:
            finger.push(5.0 + 0.3 * block, 17.0, True, 0.4)
        speed.append(finger.at(ticks(100 * block, 100 * block + 100, 5e-5)).velocity_mm_s[:, 0])
    late = np.concatenate(speed[100:])
    assert np.mean(late) == pytest.approx(60.0, rel=0.02)
    assert np.ptp(late) < 15.0


def test_pointer_does_not_depend_on_how_time_is_split(rng: np.random.Generator) -> None:
    time_s = ticks(1, 500, 5e-5)
    whole, split = pointer(), pointer()
    for finger in (whole, split):
        finger.push(10.0, 10.0, True, 0.4)
        finger.at(np.zeros(1))
        finger.push(40.0, 10.0, True, 0.4)
    cuts = np.unique(rng.integers(1, 490, 5))
    parts = [split.at(part).position_mm for part in np.split(time_s, cuts)]
    np.testing.assert_allclose(np.concatenate(parts), whole.at(time_s).position_mm, rtol=1e-12)


def test_pointer_stays_on_the_screen_and_lands_where_it_is_put() -> None:
    finger = pointer()
    finger.push(-5.0, 1e6, True, 0.4)
    motion = finger.at(ticks(0, 100))
    np.testing.assert_allclose(motion.position_mm, [[0.0, 35.0]] * 100)
    finger.push(50.0, 5.0, False, 0.4)
    assert not np.any(finger.at(np.array([0.2])).in_contact)
    finger.push(60.0, 6.0, True, 0.4)
    np.testing.assert_allclose(finger.at(np.array([0.21])).position_mm, [[60.0, 6.0]])


@pytest.mark.parametrize(
    "point", [(np.nan, 1.0, 0.4), (1.0, np.inf, 0.4), (1.0, 1.0, np.nan), (1.0, 1.0, -0.1)]
)
def test_pointer_refuses_what_is_no_point(point: tuple[float, float, float]) -> None:
    x, y, force = point
    with pytest.raises(ConfigError, match="finite"):
        pointer().push(x, y, True, force)


@pytest.mark.parametrize(
    "kind", ["steady", "sinusoidal", "human", "circle", "tap", "client", "takeover"]
)
def test_a_configuration_names_the_kind(kind: str) -> None:
    read: FingerConfig = TypeAdapter(FingerConfig).validate_python({"kind": kind})
    assert read.kind == kind


def plain_wander(wander: Wander, time_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the sum of sinusoids and its derivative, by whole arrays."""
    turn = 2.0 * np.pi * wander.frequency_hz
    phase = 2.0 * np.pi * np.multiply.outer(time_s, wander.frequency_hz) + wander.phase_rad
    return np.sin(phase) @ wander.amplitude, np.cos(phase) @ (turn * wander.amplitude)


@pytest.mark.parametrize("begin_s", [0.0, 0.3, 1e5])
@pytest.mark.parametrize("n_samples", [0, 1, 2, 100, 1_000])
def test_a_wander_is_the_same_however_its_times_are_spaced(
    begin_s: float, n_samples: int, rng: np.random.Generator
) -> None:
    wander = Wander.draw(rng, (0.1, 12.0), 0.3)
    rounding = 1e-8 * max(1.0, begin_s / 1e4)  # of the times themselves
    even = begin_s + np.arange(n_samples) / 20_000.0
    with_a_gap = np.where(np.arange(n_samples) < 70, even, even + 0.4)
    for time_s in (even, with_a_gap, np.sort(rng.permutation(even) + rng.uniform(0.0, 1e-4))):
        for found, expected in zip(
            wander.sums(time_s), plain_wander(wander, time_s), strict=True
        ):
            np.testing.assert_allclose(found, expected, rtol=0.0, atol=rounding)


def test_the_times_of_a_block_cost_few_sines(
    monkeypatch: pytest.MonkeyPatch, rng: np.random.Generator
) -> None:
    wander = Wander.draw(rng, (8.0, 12.0), 0.02)
    time_s = 3.0 + np.arange(100) / 20_000.0
    sines = 0

    def counted(phase: float) -> float:
        nonlocal sines
        sines += 1
        return math.sin(phase)

    monkeypatch.setattr(np, "sin", counted)
    plain(add_sinusoids)(time_s, wander.table, np.empty(100), np.empty(100))
    assert sines <= 5 * wander.frequency_hz.size


def plain_stroke(finger: HumanFinger, time_s: FloatArray) -> tuple[FloatArray, ...]:
    """Return x, its rate and the share of the force that is applied, by whole arrays."""
    strokes = finger.strokes
    looped = np.mod(time_s, strokes.loop_s)
    index = np.searchsorted(strokes.begin_s, looped, side="right") - 1
    since = looped - strokes.begin_s[index]
    move = strokes.move_s[index]
    share = np.minimum(since / move, 1.0)
    length = strokes.to_mm[index] - strokes.from_mm[index]
    begin, end = strokes.turn_mm_s2[index].T * np.square(move) / 2.0
    quintic = np.stack(
        [
            0.0 * begin,
            0.0 * begin,
            begin,
            10.0 * length - 3.0 * begin + end,
            -15.0 * length + 3.0 * begin - 2.0 * end,
            6.0 * length - begin + end,
        ]
    )
    power = np.arange(6)[:, np.newaxis]
    along = np.sum(quintic * share**power, axis=0)
    rate = np.sum(power[1:] * quintic[1:] * share ** (power[1:] - 1), axis=0)
    left = np.append(strokes.begin_s[1:], strokes.loop_s)[index] - looped
    off = np.clip(np.minimum(since - move, left) / LIFT_RAMP_S, 0.0, 1.0)
    held = np.where(strokes.lift[index], 1.0 - off, 1.0)
    return strokes.from_mm[index] + along, rate / move, held


@pytest.mark.parametrize("lift_probability", [0.0, 0.7])
def test_a_human_finger_moves_as_whole_arrays_say(
    lift_probability: float, rng: np.random.Generator
) -> None:
    strokes = HumanStrokes(lift_probability=lift_probability, tremor_mm=0.2)
    finger = strokes.start(SCREEN_MM, rng)
    time_s = np.sort(rng.uniform(0.0, 3.0 * LOOP_S, 50_000))
    motion = finger.at(time_s)
    x, vx, held = plain_stroke(finger, time_s)
    tremor_x, tremor_vx = plain_wander(finger.tremor_x, time_s)
    tremor_y, tremor_vy = plain_wander(finger.tremor_y, time_s)
    drift, drift_vy = plain_wander(finger.drift, time_s)
    y = finger.middle_mm + drift + tremor_y
    same = functools.partial(np.testing.assert_allclose, rtol=1e-9, atol=1e-8)
    same(motion.position_mm, np.column_stack([x + tremor_x, y]))
    same(motion.velocity_mm_s, np.column_stack([vx + tremor_vx, drift_vy + tremor_vy]))
    same(motion.normal_force_n, held * finger.force.at(time_s))
    assert np.array_equal(motion.in_contact, held > 0.0)
