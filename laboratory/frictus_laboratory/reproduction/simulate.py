"""One trial as a rig would record it: raw samples through the twin and its further stages."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.effects import extended
from frictus_hardware.physics.friction import motion_fade
from frictus_hardware.physics.linear import Mount
from frictus_hardware.physics.screen import Screen, screen_voltage
from frictus_hardware.physics.simulator import Simulator
from frictus_hardware.physics.stages import (
    FORCE_NOISE_N,
    FrictionResponse,
    Quantisation,
    SensorNoise,
    ZeroOrderHold,
)
from frictus_hardware.physics.twin import Signals, Twin, simulate
from frictus_hardware.simulated.motion import FingerMotion, Press, Wander
from frictus_hardware.simulated.strokes import SteadyStrokes
from frictus_laboratory.reproduction.plan import TrialPlan
from frictus_service.study.layout import ConverterStep
from frictus_service.study.trial import StudyInfo, Trial

SPEED_OFFSET, SPEED_WANDER = 0.025, 0.05
FORCE_OFFSET, FORCE_WANDER = 0.025, 0.06
"""Standard deviations as shares of the target: of a trial's mean, and around it."""
SPEED_WANDER_HZ: Final = (0.2, 1.0)
DRIFT_HZ: Final = (0.05, 0.3)
DRIFT_MM: Final = 1.0
REVERSAL_S: Final = 0.05
SLOW_S: Final = 0.005
STROKES: Final = 3
"""A trial holds at least so many, of both directions, even if it is short: the span shrinks."""

TOO_FAST, TOO_HARD = 1.3, 1.4
LIFTED: Final = (0.3, 0.6)
"""Part of the trial during which a lifted finger is off the screen."""


@dataclass(frozen=True, slots=True)
class Reports:
    """What the position sensor says.

    Attributes
    ----------
    position_mm : ndarray, shape (k, 2)
    time_s : ndarray, shape (k,)
    """

    position_mm: FloatArray
    time_s: FloatArray


def move(plan: TrialPlan, time_s: FloatArray, rng: np.random.Generator) -> FingerMotion:
    """Return the finger at given times.

    Time runs a little unevenly for it: the finger of `SteadyStrokes`, with a clock that is off
    and wanders, so that position and velocity belong together.

    Parameters
    ----------
    plan : TrialPlan
        What is asked, and the truth.
    time_s : ndarray, shape (n_samples,)
        0 at the first recorded sample.
    rng : Generator
        Source of everything random.
    """
    screen = Screen()
    speed = plan.info.speed_mm_s * (TOO_FAST if plan.fault == "fast" else 1.0)
    span = min(plan.span_mm, speed * plan.seconds / STROKES)
    finger = SteadyStrokes(speed_mm_s=speed, span_mm=span, reversal_s=REVERSAL_S).start(
        screen.size_mm, rng
    )
    rms_s = SPEED_WANDER / (2.0 * np.pi * float(np.mean(SPEED_WANDER_HZ)))
    wander = Wander.draw(rng, SPEED_WANDER_HZ, rms_s)
    haste = 1.0 + SPEED_OFFSET * float(rng.standard_normal())
    begin_s = rng.uniform(1.0, 1.0 + 2.0 * span / speed)
    moved = finger.at(begin_s + haste * time_s + _slow(wander.value, time_s))
    drift = Wander.draw(rng, DRIFT_HZ, DRIFT_MM)
    position, velocity = moved.position_mm, moved.velocity_mm_s
    velocity *= (haste + _slow(wander.rate, time_s))[:, np.newaxis]
    position[:, 1] += _slow(drift.value, time_s)
    velocity[:, 1] += _slow(drift.rate, time_s)
    return _pressed(plan, FingerMotion(position, velocity, *_press(plan, time_s, rng)), time_s)


def _press(
    plan: TrialPlan, time_s: FloatArray, rng: np.random.Generator
) -> tuple[FloatArray, NDArray[np.bool_]]:
    target = plan.info.force_n * (TOO_HARD if plan.fault == "hard" else 1.0)
    aimed = target * (1.0 + FORCE_OFFSET * float(rng.standard_normal()))
    press = Press(target_n=aimed, wander_n=FORCE_WANDER * aimed).start(rng)
    return _slow(press.at, time_s), np.ones(time_s.size, dtype=np.bool_)


def _slow(varies: Callable[[FloatArray], FloatArray], time_s: FloatArray) -> FloatArray:
    """Return what varies at 2 Hz or less, straight between instants 5 ms apart."""
    coarse = np.arange(time_s[0], time_s[-1] + 2.0 * SLOW_S, SLOW_S)
    values: FloatArray = np.interp(time_s, coarse, varies(coarse))
    return values


def _pressed(plan: TrialPlan, motion: FingerMotion, time_s: FloatArray) -> FingerMotion:
    if plan.fault != "lifted":
        return motion
    off = (time_s > LIFTED[0] * plan.seconds) & (time_s < LIFTED[1] * plan.seconds)
    return replace(
        motion, normal_force_n=np.where(off, 0.0, motion.normal_force_n), in_contact=~off
    )


def report(
    motion: FingerMotion,
    time_s: FloatArray,
    rate_hz: float,
    step_mm: float,
    rng: np.random.Generator,
) -> Reports:
    """Return what a position sensor reports of a finger, from the first recorded sample on.

    Parameters
    ----------
    motion : FingerMotion
        Position, velocity and force at each sample.
    time_s : ndarray, shape (n_samples,)
    rate_hz, step_mm : float
        Of the sensor.
    rng : Generator
        Its scans begin anywhere within their period.
    """
    scans = np.arange(rng.uniform(0.0, 1.0) / rate_hz, time_s[-1], 1.0 / rate_hz)
    rows = np.searchsorted(time_s, scans)
    return Reports(np.rint(motion.position_mm[rows] / step_mm) * step_mm, time_s[rows])


ROUGHNESS: Final = 0.05
ROUGHNESS_HZ: Final = 100.0


@dataclass(frozen=True, slots=True)
class Rubbing:
    """Friction noise of skin on glass: in proportion to friction, and stronger at low pitch.

    White noise through a first-order low-pass.

    Attributes
    ----------
    friction_coefficient : float
        Of skin on glass, friction over normal force without drive.
    seed : int
        Of everything random; the same seed gives the same result.
    share : float
        Its rms, as a share of ``mu F_n``.
    corner_hz : float
        Above it the noise falls.
    """

    friction_coefficient: float
    seed: int
    share: float = ROUGHNESS
    corner_hz: float = ROUGHNESS_HZ

    def initial(self) -> tuple[np.random.Generator, FloatArray]:
        """Return a generator, which moves on with each run, and the filter at rest."""
        return np.random.default_rng(self.seed), np.zeros(1)

    def run(
        self, signals: Signals, state: tuple[np.random.Generator, FloatArray]
    ) -> tuple[Signals, tuple[np.random.Generator, FloatArray]]:
        """Add noise to `friction_n`."""
        rng, kept = state
        decay = np.exp(-2.0 * np.pi * self.corner_hz / signals.sample_rate_hz)
        white = rng.standard_normal(signals.friction_n.size)
        noise, kept = signal.lfilter([np.sqrt(1.0 - decay**2)], [1.0, -decay], white, zi=kept)
        speed = np.hypot(signals.velocity_mm_s[:, 0], signals.velocity_mm_s[:, 1])
        rubbed = self.friction_coefficient * signals.normal_force_n * motion_fade(speed)
        felt = signals.friction_n + self.share * rubbed * noise * signals.in_contact
        return replace(signals, friction_n=felt), (rng, kept)


@dataclass(frozen=True, slots=True)
class LateDrive:
    """A channel between monitor and screen that passes everything on too late.

    Attributes
    ----------
    delay_s : float
        At least one step of the twin, and a multiple of it.
    """

    delay_s: float

    def initial(self) -> FloatArray | None:
        """Return None: before its first sample the screen is at 0 V."""
        return None

    def run(self, signals: Signals, state: FloatArray | None) -> tuple[Signals, FloatArray]:
        """Delay `screen_v`."""
        steps = self.delay_s * signals.sample_rate_hz
        if not (steps > 0.5 and abs(steps - round(steps)) < 1e-6):
            raise ValueError(
                f"a delay of {self.delay_s} s is {steps:g} steps of the twin; accepted: whole "
                f"multiples of {1.0 / signals.sample_rate_hz:g} s"
            )
        waiting = np.zeros(round(steps)) if state is None else state
        both = np.concatenate([waiting, signals.screen_v])
        passed, waiting = np.split(both, [signals.screen_v.size])
        return replace(signals, screen_v=passed), waiting


RIG: Final = "simulated"
LEAD_S: Final = 0.1
"""Simulated before the first recorded sample: mount and skin swing in."""
BLOCK_SAMPLES: Final = 4000
"""Small enough that a block's arrays stay in the processor's cache."""
POSITION_HZ, POSITION_STEP_MM = 60.0, 0.1
ACCEL_NOISE_M_S2 = 0.05
CLIPPED_AT: Final = 0.6
"""Share of its largest value at which a clipped force saturates."""
VOLTAGE_STEP_V: Final = 1000.0 / 65536.0
"""A 16-bit converter of ±10 V, times the amplifier's gain of 50."""

STEPS: Final = {
    "voltage_v": ConverterStep(VOLTAGE_STEP_V),
    "force_n": ConverterStep(Quantisation().force_step_n),
    "accel_m_s2": ConverterStep(Quantisation().accel_step_m_s2),
}
"""How the converters count; what `StudyWriter.add` stores."""


def study_info() -> StudyInfo:
    """Return what holds for every trial of a simulated study."""
    screen = Screen()
    mount = Mount().lateral
    return StudyInfo(RIG, screen.carrier_hz, screen.peak_v, mount, extras={"simulated": 1})


def simulate_trial(plan: TrialPlan) -> Trial:
    """Return a trial as it would be recorded.

    Parameters
    ----------
    plan : TrialPlan
        Everything random hangs on its seed: the result is the same in any process.

    Raises
    ------
    ValueError
        If the plan's delay is not a multiple of the twin's step.
    """
    rng = np.random.default_rng(plan.seed)
    rate_hz = plan.info.sample_rate_hz
    lead = round(LEAD_S * rate_hz)
    first = np.arange(-lead, round(plan.seconds * rate_hz))
    time_s = first / rate_hz
    motion = move(plan, time_s, rng)
    voltage = _voltage(plan, time_s, -lead, rng)
    signals = Signals.driven(
        rate_hz,
        voltage,
        motion.position_mm,
        motion.velocity_mm_s,
        motion.normal_force_n,
        motion.in_contact,
    )
    felt = simulate(_twin(plan, rng), signals, BLOCK_SAMPLES).rows(slice(lead, None))
    seen = report(motion, time_s, POSITION_HZ, POSITION_STEP_MM, rng)
    return Trial(
        info=plan.info,
        voltage_v=felt.voltage_v,
        force_n=_clipped(felt.force_n) if plan.fault == "clipped" else felt.force_n,
        accel_m_s2=felt.accel_m_s2,
        skin_velocity_m_s=None,
        position_mm=seen.position_mm,
        position_t_s=seen.time_s,
    )


def _voltage(
    plan: TrialPlan, time_s: FloatArray, first_sample: int, rng: np.random.Generator
) -> FloatArray:
    """Return what the converter puts out: the message at full drive, on the carrier."""
    tones = np.array(plan.info.tones_hz)
    phases = rng.uniform(0.0, 2.0 * np.pi, tones.size)
    message = np.cos(2.0 * np.pi * np.multiply.outer(time_s, tones) + phases).mean(axis=1)
    fraction = np.clip(0.5 + 0.5 * message, 0.0, 1.0)
    volts = screen_voltage(Screen(), fraction, first_sample, plan.info.sample_rate_hz)
    rounded: FloatArray = np.rint(volts / VOLTAGE_STEP_V) * VOLTAGE_STEP_V
    return rounded


def _twin(plan: TrialPlan, rng: np.random.Generator) -> Twin:
    seeds = rng.integers(2**63, size=2)
    bare = Simulator(law=plan.law, mobility=plan.mobility)
    twin = extended(bare, plan.effects).twin(
        Screen(),
        plan.friction_coefficient,
        sensors=(SensorNoise(FORCE_NOISE_N, ACCEL_NOISE_M_S2, int(seeds[0])), Quantisation()),
    )
    twin = twin.with_stage(
        Rubbing(plan.friction_coefficient, int(seeds[1])), after=FrictionResponse
    )
    return (
        twin.with_stage(LateDrive(plan.delay_s), after=ZeroOrderHold) if plan.delay_s else twin
    )


def _clipped(force_n: FloatArray) -> FloatArray:
    limit = CLIPPED_AT * np.abs(force_n).max(axis=0)
    step = Quantisation().force_step_n
    limit = np.rint(limit / step) * step
    clipped: FloatArray = np.clip(force_n, -limit, limit)
    return clipped
