"""Trials of the standard twin, with the truth at hand."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.friction import FrictionLaw, frequency_response
from frictus_hardware.physics.linear import Mobility, Mount
from frictus_hardware.physics.screen import Screen, screen_voltage
from frictus_hardware.physics.stages import SensorNoise, standard_twin
from frictus_hardware.physics.twin import Signals, simulate
from frictus_hardware.simulated.motion import Press
from frictus_hardware.simulated.strokes import SteadyStrokes
from frictus_service.study.trial import StudyInfo, Trial, TrialInfo

RATE_HZ = 20_000.0
PAPER_TONES_HZ = tuple(np.geomspace(30.0, 2000.0, 15).tolist())
STUDY = StudyInfo("twin", mount=Mount().lateral)
LAW = FrictionLaw()
MOBILITY = Mobility()


@dataclass(frozen=True)
class Made:
    """What a trial is made of.

    `turned_deg` turns the path on the screen, and forces and accelerations with it.
    """

    tones_hz: tuple[float, ...] = (100.0,)
    speed_mm_s: float = 60.0
    force_n: float = 0.4
    seconds: float = 2.0
    span_mm: float = 60.0
    wander_n: float = 0.02
    noise_n: float = 0.0
    noise_m_s2: float = 0.0
    turned_deg: float = 0.0
    position_noise_mm: float = 0.0


def trial(
    made: Made,
    rng: np.random.Generator,
    drawn: Callable[[tuple[float, ...], FloatArray, np.random.Generator], FloatArray]
    | None = None,
    screen: Callable[[FloatArray], FloatArray] = lambda drive: drive,
) -> Trial:
    """Simulate a trial.

    `drawn` gives another drive than tones of equal size; `screen` is what the screen makes of
    the drive fraction, of which the voltage that is kept knows nothing.
    """
    time_s = np.arange(round(made.seconds * RATE_HZ)) / RATE_HZ
    strokes = SteadyStrokes(
        speed_mm_s=made.speed_mm_s,
        span_mm=made.span_mm,
        press=Press(target_n=made.force_n, wander_n=made.wander_n),
    )
    motion = strokes.start((70.0, 35.0), rng).at(time_s)
    turn = np.deg2rad(made.turned_deg)
    turned = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    middle = np.array([35.0, 17.5])
    position = (motion.position_mm - middle) @ turned + middle
    drive = (drawn or message)(made.tones_hz, time_s, rng)
    voltage = volts(drive)
    sensors = (SensorNoise(made.noise_n, made.noise_m_s2, int(rng.integers(2**31))),)
    felt = simulate(
        standard_twin(law=LAW, mobility=MOBILITY, sensors=sensors),
        Signals.driven(
            RATE_HZ,
            volts(screen(drive)),
            position,
            motion.velocity_mm_s @ turned,
            motion.normal_force_n,
            motion.in_contact,
        ),
    )
    scans = np.arange(0.0, time_s.size, RATE_HZ / 60.0).astype(int)
    seen = position[scans] + made.position_noise_mm * rng.standard_normal((scans.size, 2))
    return Trial(
        info=TrialInfo(
            id="t0",
            participant="P01",
            session=0,
            order=0,
            speed_mm_s=made.speed_mm_s,
            force_n=made.force_n,
            tones_hz=made.tones_hz,
            drive_vpp=150.0,
            sample_rate_hz=RATE_HZ,
            started_utc="2026-01-05T09:00:00Z",
        ),
        voltage_v=voltage if made.tones_hz else None,
        force_n=felt.force_n,
        accel_m_s2=felt.accel_m_s2,
        skin_velocity_m_s=None,
        position_mm=np.round(seen, 1),
        position_t_s=scans / RATE_HZ,
    )


def message(
    tones_hz: tuple[float, ...], time_s: FloatArray, rng: np.random.Generator
) -> FloatArray:
    """Return a drive fraction between 0 and 1, of tones of equal size."""
    if not tones_hz:
        return np.zeros(time_s.size)
    phase = rng.uniform(0.0, 2.0 * np.pi, len(tones_hz))
    waves = np.cos(2.0 * np.pi * np.multiply.outer(time_s, np.array(tones_hz)) + phase)
    total = waves.sum(axis=1)
    drive: FloatArray = 0.5 + 0.499 * total / np.abs(total).max()
    return drive


def volts(drive: FloatArray) -> FloatArray:
    """Return the screen's volts for a drive fraction."""
    return screen_voltage(Screen(), drive, 0, RATE_HZ)


def true_friction(tone_hz: FloatArray, speed_mm_s: float) -> NDArray[np.complex128]:
    """Return the friction response of the twin."""
    return frequency_response(LAW, tone_hz, speed_mm_s)


def true_mobility(tone_hz: FloatArray) -> NDArray[np.complex128]:
    """Return the mobility of the twin's skin."""
    return MOBILITY.velocity.frequency_response(tone_hz)


def numbered(original: Trial, number: int) -> Trial:
    """Return the same trial as another one of its participant."""
    return replace(original, info=replace(original.info, id=f"t{number}", order=number))
