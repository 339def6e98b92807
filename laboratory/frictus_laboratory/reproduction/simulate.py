"""One trial as a rig would record it: raw samples through the twin and its further stages."""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy import signal

from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.friction import motion_fade
from frictus_hardware.physics.linear import Mount
from frictus_hardware.physics.screen import Screen, screen_voltage
from frictus_hardware.physics.stages import (
    FORCE_NOISE_N,
    FrictionResponse,
    Quantisation,
    SensorNoise,
    ZeroOrderHold,
    standard_twin,
)
from frictus_hardware.physics.twin import Signals, Twin, simulate
from frictus_laboratory.reproduction.plan import TrialPlan
from frictus_laboratory.reproduction.strokes import move, report
from frictus_service.study.layout import ConverterStep
from frictus_service.study.trial import StudyInfo, Trial

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
    return StudyInfo(RIG, screen.carrier_hz, screen.peak_v, Mount().lateral)


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
    twin = standard_twin(
        law=plan.law,
        mobility=plan.mobility,
        friction_coefficient=plan.friction_coefficient,
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
