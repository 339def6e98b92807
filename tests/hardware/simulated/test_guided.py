"""The virtual participant: does what it is asked to, with errors, and stays on the screen."""

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import TypeAdapter

from frictus_hardware import SimulatedConfig
from frictus_hardware.errors import ConfigError
from frictus_hardware.simulated.config import FingerConfig
from frictus_hardware.simulated.guided import FASTEST_MM_S, GuidedFinger, GuidedStrokes
from frictus_hardware.simulated.motion import FingerMotion
from frictus_hardware.simulated.rig import SimulatedRig
from frictus_hardware.simulated.strokes import SteadyStrokes

SCREEN_MM = (70.0, 35.0)
SPAN_MM = (5.0, 65.0)
RATE_HZ = 1_000.0
EXACT = GuidedStrokes(speed_error=0.0, force_error=0.0)


def start(settings: GuidedStrokes = EXACT, seed: int = 0) -> GuidedFinger:
    return settings.start(SCREEN_MM, np.random.default_rng(seed))


def move(finger: GuidedFinger, begin_s: float, seconds: float) -> FingerMotion:
    n = round(seconds * RATE_HZ)
    return finger.at(begin_s + np.arange(n) / RATE_HZ)


def test_it_rests_on_the_screen_until_guidance_comes() -> None:
    motion = move(start(), 0.0, 2.0)
    assert np.all(motion.in_contact)
    assert not motion.velocity_mm_s.any()
    np.testing.assert_allclose(motion.normal_force_n, 0.4)
    np.testing.assert_allclose(motion.position_mm, [[35.0, 17.5]] * 2_000)


@pytest.mark.parametrize("speed", [20.0, 60.0, 100.0])
@pytest.mark.parametrize("force", [0.2, 0.6])
def test_it_strokes_as_asked(speed: float, force: float) -> None:
    finger = start()
    move(finger, 0.0, 1.0)
    finger.push(speed, force, SPAN_MM)
    before = move(finger, 1.0, 0.24)
    assert not before.velocity_mm_s.any(), "it takes a quarter of a second to react"
    move(finger, 1.24, 3.0)
    motion = move(finger, 4.24, 20.0)
    vx = motion.velocity_mm_s[:, 0]
    assert np.mean(np.isclose(np.abs(vx), speed)) > 0.8
    assert np.mean(vx > 0.0) == pytest.approx(0.5, abs=0.15)
    x = motion.position_mm[:, 0]
    assert x.min() == pytest.approx(SPAN_MM[0], abs=speed * EXACT.turn_s)
    assert x.max() == pytest.approx(SPAN_MM[1], abs=speed * EXACT.turn_s)
    np.testing.assert_allclose(motion.normal_force_n, force)


def test_it_rests_again_when_it_is_told_to() -> None:
    finger = start()
    finger.push(80.0, 0.4, SPAN_MM)
    move(finger, 0.0, 3.0)
    finger.push(0.0, 0.4, SPAN_MM)
    move(finger, 3.0, 1.0)
    assert not move(finger, 4.0, 1.0).velocity_mm_s.any()


@pytest.mark.parametrize("speed_mm_s", [5e-324, 1e-300, 1e-9])
def test_at_a_speed_that_is_none_it_rests(speed_mm_s: float) -> None:
    finger = start()
    finger.push(speed_mm_s, 0.4, SPAN_MM)
    assert not move(finger, 0.0, 3.0).velocity_mm_s.any()
    finger.push(80.0, 0.4, SPAN_MM)
    assert move(finger, 3.0, 3.0).velocity_mm_s.any()


def test_its_errors_are_of_the_stated_size(rng: np.random.Generator) -> None:
    errors = GuidedStrokes(speed_error=0.08, force_error=0.1)
    finger = start(errors, int(rng.integers(2**31)))
    finger.push(100.0, 0.4, SPAN_MM)
    motion = move(finger, 0.0, 300.0)
    vx = motion.velocity_mm_s[:, 0]
    steady = np.isclose(np.diff(vx), 0.0)
    strokes = np.unique(np.round(np.abs(vx[1:][steady]), 6))
    drawn = strokes[strokes > 20.0]
    assert drawn.size > 300
    assert np.std(drawn / 100.0) == pytest.approx(0.08, rel=0.15)
    assert np.mean(drawn / 100.0) == pytest.approx(1.0, abs=0.02)
    forces = []
    for _ in range(8):  # two of one finger's six waves may beat for minutes
        finger = start(errors, int(rng.integers(2**31)))
        finger.push(100.0, 0.4, SPAN_MM)
        forces.append(move(finger, 0.0, 60.0).normal_force_n)
    assert np.std(np.concatenate(forces) / 0.4) == pytest.approx(0.1, rel=0.15)


pushes = st.lists(
    st.tuples(
        st.floats(0.0, 1.5),
        st.one_of(st.just(0.0), st.floats(5.0, FASTEST_MM_S)),
        st.floats(0.05, 2.0),
        st.floats(-10.0, 40.0),
        st.floats(1.0, 70.0),
    ),
    max_size=8,
)


@settings(max_examples=60, deadline=None)
@given(asked=pushes, seed=st.integers(0, 2**31))
def test_whatever_it_is_asked_it_moves_smoothly_and_stays_on_the_screen(
    asked: list[tuple[float, float, float, float, float]], seed: int
) -> None:
    finger = start(GuidedStrokes(speed_error=0.05), seed)
    at_s, parts = 0.0, []
    for wait_s, speed, force, low, width in asked:
        parts.append(move(finger, at_s, round(wait_s, 3)))
        at_s += round(wait_s, 3)
        finger.push(speed, force, (low, low + width))
    parts.append(move(finger, at_s, 3.0))
    x = np.concatenate([part.position_mm[:, 0] for part in parts])
    vx = np.concatenate([part.velocity_mm_s[:, 0] for part in parts])
    force_n = np.concatenate([part.normal_force_n for part in parts])
    assert x.min() >= 0.0
    assert x.max() <= SCREEN_MM[0]
    slope = np.diff(x) * RATE_HZ
    np.testing.assert_allclose(slope, 0.5 * (vx[1:] + vx[:-1]), atol=20.0)
    assert np.all(force_n >= 0.05)
    assert np.abs(np.diff(force_n)).max(initial=0.0) < 0.05


def test_it_does_not_depend_on_how_time_is_split(rng: np.random.Generator) -> None:
    time_s = np.arange(8_000) / RATE_HZ
    whole, split = start(GuidedStrokes(), 7), start(GuidedStrokes(), 7)
    whole.push(70.0, 0.3, SPAN_MM)
    split.push(70.0, 0.3, SPAN_MM)
    cuts = [0, *np.sort(rng.integers(1, 7_999, 20)), 8_000]
    parts = [split.at(time_s[a:b]) for a, b in pairwise(cuts) if b > a]
    together = whole.at(time_s)
    for name in ("position_mm", "velocity_mm_s", "normal_force_n"):
        joined = np.concatenate([getattr(part, name) for part in parts])
        np.testing.assert_allclose(joined, getattr(together, name), atol=1e-9)


@pytest.mark.parametrize(
    "asked",
    [
        (float("nan"), 0.4, SPAN_MM),
        (-1.0, 0.4, SPAN_MM),
        (FASTEST_MM_S + 1.0, 0.4, SPAN_MM),
        (50.0, 0.0, SPAN_MM),
        (50.0, float("inf"), SPAN_MM),
        (50.0, 0.4, (40.0, 40.0)),
        (50.0, 0.4, (0.0, float("nan"))),
    ],
)
def test_absurd_guidance_is_refused(asked: tuple[float, float, tuple[float, float]]) -> None:
    with pytest.raises(ConfigError, match="accepted"):
        start().push(*asked)


def test_a_screen_that_is_too_narrow_is_refused() -> None:
    with pytest.raises(ConfigError, match="wide"):
        EXACT.start((8.0, 30.0), np.random.default_rng(0))


def test_a_rig_guides_only_a_guided_finger() -> None:
    adapter: TypeAdapter[Any] = TypeAdapter(FingerConfig)
    config = adapter.validate_python({"kind": "guided"})
    assert isinstance(config, GuidedStrokes)
    with SimulatedConfig(clock="virtual", finger=config).make() as rig:
        assert isinstance(rig, SimulatedRig)
        assert rig.follows_guidance
        assert rig.info.finger_source == "simulated"
        rig.guide_finger(60.0, 0.3, SPAN_MM)
        truths = [rig.exchange(np.zeros(1_000)).truth for _ in range(40)]
        assert truths[-1] is not None
        assert np.abs(truths[-1].velocity_mm_s[:, 0]).max() > 20.0
    with SimulatedConfig(clock="virtual", finger=SteadyStrokes()).make() as other:
        assert isinstance(other, SimulatedRig)
        assert not other.follows_guidance
        with pytest.raises(ConfigError, match="guided"):
            other.guide_finger(60.0, 0.3, SPAN_MM)
