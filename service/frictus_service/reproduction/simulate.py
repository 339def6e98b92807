"""One trial as a rig would record it: raw samples through the twin."""

from typing import Final

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.mount import Mount
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
from frictus_service.reproduction.plan import TrialPlan
from frictus_service.reproduction.stages import LateDrive, Rubbing
from frictus_service.reproduction.strokes import move, report
from frictus_service.study.encoding import ConverterStep
from frictus_service.study.trial import StudyInfo, Trial

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
