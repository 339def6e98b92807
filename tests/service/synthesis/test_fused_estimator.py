"""All sensors together on the simulated rig: what they gain, and what is left without one.

The figures asked are those of docs/fidelity.md, with room for a few strokes of one seed.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray
from tests.service.synthesis.test_estimator import assert_continuous

from frictus.recordings import texture_of
from frictus_hardware.arrays import BoolArray, FloatArray
from frictus_hardware.base import TouchReport
from frictus_hardware.physics.friction import FrictionLaw
from frictus_hardware.physics.screen import Screen
from frictus_hardware.simulated.config import SimulatedConfig
from frictus_hardware.simulated.faults import SensorFault
from frictus_hardware.simulated.human import HumanStrokes
from frictus_hardware.simulated.rig import SimulatedRig
from frictus_hardware.simulated.sensors import NailConfig, TouchConfig
from frictus_hardware.simulated.strokes import SteadyStrokes
from frictus_service.fidelity.measure import full_gain
from frictus_service.fidelity.path import BLOCK_SAMPLES
from frictus_service.library import SHIPPED
from frictus_service.synthesis.chain import Chain, RenderedBlock
from frictus_service.synthesis.estimator import DEFAULT_TUNING, FingerEstimator
from frictus_service.synthesis.renderer import Renderer
from frictus_service.synthesis.scene import CompiledScene

pytestmark = pytest.mark.compiled

RATE = 20_000.0
LAW, SCREEN = FrictionLaw(), Screen()
BLOCK_S = BLOCK_SAMPLES / RATE


@cache
def paper() -> CompiledScene:
    texture = texture_of((SHIPPED / "paper.json").read_text(encoding="utf-8"))
    return full_gain(texture, LAW, SCREEN, RATE)


@dataclass(frozen=True)
class Strokes:
    """What was rendered while a texture played, and whether all sensors were used."""

    steps: list[RenderedBlock]
    fused: list[bool]
    position_mm: FloatArray
    velocity_mm_s: FloatArray
    in_contact: FloatArray
    lead_samples: int

    @property
    def played_at(self) -> NDArray[np.intp]:
        return self.lead_samples + BLOCK_SAMPLES * np.arange(len(self.steps))

    def errors(
        self, from_s: float = 1.0, until_s: float = np.inf
    ) -> tuple[FloatArray, FloatArray, BoolArray]:
        """Return the error of rendered position and speed in contact, and where turns are."""
        at = self.played_at
        kept = (at < self.position_mm.shape[0]) & (at >= from_s * RATE) & (at < until_s * RATE)
        kept &= self.in_contact[np.minimum(at, self.position_mm.shape[0] - 1)] > 0.0
        at = at[kept]
        rendered = np.array([step.motion[:4] for step in self.steps])[kept]
        position = np.hypot(*(rendered[:, :2] - self.position_mm[at]).T)
        speed = rendered[:, 2] - self.velocity_mm_s[at, 0]
        turned = np.flatnonzero(np.diff(np.sign(self.velocity_mm_s[:, 0])) != 0)
        near = np.min(np.abs(at[:, np.newaxis] - turned), axis=1) < 0.1 * RATE
        return position, speed, near


def stroke(
    config: SimulatedConfig,
    seconds: float,
    fuses: bool = True,
    faults: tuple[SensorFault, ...] = (),
) -> Strokes:
    virtual = config.model_copy(update={"clock": "virtual", "faults": faults})
    steps, fused = [], []
    with SimulatedRig(virtual) as rig:
        estimator = FingerEstimator(RATE, fuses=fuses)
        renderer = Renderer(LAW, SCREEN, RATE, BLOCK_SAMPLES, paper())
        chain = Chain(rig, estimator, renderer, BLOCK_SAMPLES)
        rig.arm()
        for _ in range(round(seconds / BLOCK_S)):
            steps.append(chain.step(allow=True))
            fused.append(estimator.fused)
    truths = [step.exchange.truth for step in steps if step.exchange.truth is not None]
    return Strokes(
        steps,
        fused,
        np.concatenate([truth.position_mm for truth in truths]),
        np.concatenate([truth.velocity_mm_s for truth in truths]),
        np.concatenate([truth.in_contact for truth in truths]).astype(np.float64),
        config.lead_samples,
    )


def rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def seeded(rng: np.random.Generator) -> int:
    return int(rng.integers(2**31))


@pytest.mark.parametrize("speed", [20.0, 60.0, 100.0])
@pytest.mark.parametrize(
    ("lead_ms", "position_mm", "near_mm_s"), [(20.0, 0.3, 40.0), (5.0, 0.2, 14.0)]
)
def test_position_and_speed_through_turns(
    rng: np.random.Generator, speed: float, lead_ms: float, position_mm: float, near_mm_s: float
) -> None:
    config = SimulatedConfig(
        finger=SteadyStrokes(speed_mm_s=speed), seed=seeded(rng), lead_ms=lead_ms
    )
    strokes = stroke(config, 6.0)
    position, error, near = strokes.errors()
    assert rms(position) < position_mm
    assert np.mean(position > 1.5) < 0.002
    assert rms(error[near]) < near_mm_s
    assert_continuous(step.course for step in strokes.steps)


def test_free_strokes_are_followed_better_than_by_touch_alone(
    rng: np.random.Generator,
) -> None:
    config = SimulatedConfig(finger=HumanStrokes(), seed=seeded(rng))
    fused, touch = (stroke(config, 6.0, fuses) for fuses in (True, False))
    assert rms(fused.errors()[0]) < 0.35
    assert rms(fused.errors()[0]) < 0.8 * rms(touch.errors()[0])
    assert rms(fused.errors()[1]) < 0.75 * rms(touch.errors()[1])
    assert all(fused.fused[60:])
    assert not any(touch.fused)


@pytest.mark.parametrize("fuses", [True, False])
def test_reports_that_are_stamped_as_they_arrive_cost_next_to_nothing(
    rng: np.random.Generator, fuses: bool
) -> None:
    """With 3 ms the rendered position was off by more than twice as much."""
    seed = seeded(rng)
    exact, scattered = (
        stroke(SimulatedConfig(seed=seed, touch=TouchConfig(latency_sd_s=sd_s)), 8.0, fuses)
        for sd_s in (0.0, 3e-3)
    )
    assert rms(scattered.errors(2.0)[0]) < 1.15 * rms(exact.errors(2.0)[0])
    assert_continuous(step.course for step in scattered.steps)


TURNED = [(0.0, 0.0, 180.0), (0.0, 0.0, 90.0), (180.0, 0.0, 0.0), (40.0, 70.0, 10.0)]


@pytest.mark.parametrize("mounted_deg", TURNED)
def test_a_sensor_mounted_another_way_costs_next_to_nothing(
    rng: np.random.Generator, mounted_deg: tuple[float, float, float]
) -> None:
    seed = seeded(rng)
    finger = SteadyStrokes(speed_mm_s=60.0)
    nail = NailConfig(mounted_deg=mounted_deg)
    config = SimulatedConfig(finger=finger, seed=seed, nail=nail)
    turned, touch = (stroke(config, 8.0, fuses) for fuses in (True, False))
    # Touch alone until a wrong acceleration has shown itself, and from then on.
    assert rms(turned.errors(3.0)[0]) < 1.25 * rms(touch.errors(3.0)[0]) + 0.1
    assert_continuous(step.course for step in turned.steps)


@pytest.mark.parametrize("sensor", ["accel", "force"])
@pytest.mark.parametrize("becomes", ["dead", "stuck", "saturated", "loose"])
def test_a_sensor_that_fails_takes_nothing_with_it(
    rng: np.random.Generator, sensor: str, becomes: str
) -> None:
    config = SimulatedConfig(finger=SteadyStrokes(speed_mm_s=60.0), seed=seeded(rng))
    fault = SensorFault.model_validate(
        {"at_sample": 40_000, "samples": 60_000, "sensor": sensor, "becomes": becomes}
    )
    failing = stroke(config, 8.0, faults=(fault,))
    touch = stroke(config, 8.0, fuses=False)
    worse = rms(failing.errors(2.5, 5.0)[0]) / rms(touch.errors(2.5, 5.0)[0])
    assert worse < 1.25
    # It never leaps: what is not continuous is cross-faded over a block.
    assert_continuous(step.course for step in failing.steps)
    assert not any(step.rendered.clipped_samples for step in failing.steps[60:])
    # And it is used again.
    assert rms(failing.errors(6.5)[0]) < 0.5 * rms(touch.errors(6.5)[0])
    if sensor == "accel" and becomes != "loose":
        at = round(40_000 / BLOCK_SAMPLES)
        assert not any(failing.fused[at + 12 : at + 590])
        assert all(failing.fused[-100:])


def test_contact_is_felt_within_a_block_and_a_lead(rng: np.random.Generator) -> None:
    config = SimulatedConfig(finger=HumanStrokes(lift_probability=1.0), seed=seeded(rng))
    strokes = stroke(config, 8.0)
    applied = np.zeros(strokes.position_mm.shape[0] + 40_000)
    for step in strokes.steps:
        at = step.exchange.play_sample
        applied[at : at + BLOCK_SAMPLES] = step.exchange.applied_v
    touches = strokes.in_contact > 0.0
    landed = np.flatnonzero(touches[1:] & ~touches[:-1]) + 1
    lifted = np.flatnonzero(~touches[1:] & touches[:-1]) + 1
    landed, lifted = landed[landed > RATE], lifted[lifted > RATE]
    assert landed.size > 3
    block, lead = BLOCK_SAMPLES, config.lead_samples
    for at in landed[:-1]:
        # It presses with nothing at first, and with the threshold a few milliseconds later.
        sounds = np.flatnonzero(applied[at:] != 0.0)[0]
        assert sounds <= lead + 2 * block
    for at in lifted[:-1]:
        silent = np.flatnonzero(applied[at + lead + 2 * block :] == 0.0)
        assert silent[0] <= block
    assert not np.any(applied[lifted[0] + lead + 3 * block : landed[landed > lifted[0]][0]])


def test_a_finger_that_comes_down_elsewhere_begins_anew_with_its_first_report(
    rng: np.random.Generator,
) -> None:
    """The sensor repeats where a finger was lifted until it sees it again, 30 ms late."""
    estimator = FingerEstimator(RATE)
    scans = 0
    for k in range(300):
        first, end = BLOCK_SAMPLES * k, BLOCK_SAMPLES * (k + 1)
        force = 0.002 * rng.standard_normal((BLOCK_SAMPLES, 3))
        touches = end > 1.0 * RATE
        force[:, 2] += 0.4 * touches
        estimator.predict(first + 400, BLOCK_SAMPLES)
        estimator.sense(first, force, 0.05 * rng.standard_normal((BLOCK_SAMPLES, 3)))
        assert estimator.in_contact == touches
        while (measured := scans * RATE / 60.0) + 600.0 < end:
            seen = measured > 1.0 * RATE
            estimator.observe(TouchReport(measured, 55.0 if seen else 12.0, 17.0, seen))
            scans += 1
            if seen:
                (x_mm, vx_mm_s), (_, vy_mm_s) = estimator.estimate(end).tolist()
                assert x_mm == pytest.approx(55.0, abs=0.3)
                assert np.hypot(vx_mm_s, vy_mm_s) < 10.0


@pytest.mark.parametrize("silent", [False, True])
def test_a_hand_that_is_turned_where_nothing_reports_it_moves_no_finger(
    rng: np.random.Generator, silent: bool
) -> None:
    """Gravity goes over from one axis of the nail to another, in the air or unseen."""
    estimator = FingerEstimator(RATE)
    pace = 2.0 * np.pi * 0.7
    scans = 0
    for k in range(2400):
        first, end = BLOCK_SAMPLES * k, BLOCK_SAMPLES * (k + 1)
        away = 2.0 * RATE < end <= 10.0 * RATE
        force = 0.002 * rng.standard_normal((BLOCK_SAMPLES, 3))
        force[:, 2] += 0.0 if away and not silent else 0.4
        accel = 0.05 * rng.standard_normal((BLOCK_SAMPLES, 3))
        accel[:, 0] += 9.0 if 3.0 * RATE < end <= 9.0 * RATE else 0.3
        time_s = np.arange(first, end) / RATE
        accel[:, 0] -= 1e-3 * 20.0 * pace**2 * np.sin(pace * time_s)
        motion = estimator.predict(first + 400, BLOCK_SAMPLES).motion
        assert np.hypot(motion.vx_1, motion.vy_1) < 200.0
        if not away and (first < 2.0 * RATE or first > 10.5 * RATE) and first > RATE:
            x_mm = 35.0 + 20.0 * np.sin(pace * (first + 400) / RATE)
            assert abs(motion.x_mm - x_mm) < 3.0
        estimator.sense(first, force, accel)
        while (measured := scans * RATE / 60.0) + 600.0 < end:
            if not (away and silent):
                x_mm = 35.0 + 20.0 * np.sin(pace * measured / RATE)
                estimator.observe(TouchReport(measured, float(x_mm), 17.0, not away))
            scans += 1


def test_a_correction_is_bounded(rng: np.random.Generator) -> None:
    strokes = stroke(SimulatedConfig(finger=HumanStrokes(), seed=seeded(rng)), 3.0)
    for step in strokes.steps[60:]:
        motion = step.motion
        along = np.hypot(motion.vx_1, motion.vy_1)
        share = DEFAULT_TUNING.correct_share * motion.speed_1
        limit = max(share, DEFAULT_TUNING.correct_least_mm_s)
        assert abs(along - motion.speed_1) <= np.sqrt(2.0) * limit + 1e-9
