"""Observations drawn from known laws: no raw samples, nothing shared with the fits."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from frictus_hardware.arrays import FloatArray
from frictus_service.identification.observation.response import (
    ResponseRows,
    TrialObservations,
)
from frictus_service.study.trial import TrialInfo

TONES_HZ = tuple(np.geomspace(30.0, 2000.0, 15).tolist())


@dataclass(frozen=True)
class Finger:
    """The truth about one participant."""

    gain_n: float = 0.39
    cutoff_0_hz: float = 385.68
    slope: float = 13.811
    mass_kg: float = 0.004
    mass_slope: float = 0.0
    damping: float = 1.3
    stiffness: float = 500.0
    stiffness_slope: float = 0.0
    delay_s: float = 0.0
    skin_delay_s: float = 0.0
    law_mm_s: tuple[float, float] = (0.0, np.inf)
    """Slower and faster, the cutoff is that at these speeds."""


@dataclass(frozen=True)
class Bench:
    """How everything is measured; standard deviations relative."""

    tones_hz: tuple[float, ...] = TONES_HZ
    speeds: tuple[float, ...] = (20.0, 40.0, 60.0, 80.0, 100.0)
    forces: tuple[float, ...] = (0.2, 0.3, 0.4, 0.5, 0.6)
    seconds: float = 10.0
    trial_gain: float = 0.10
    segment_gain: float = 0.05
    speed_wander: float = 0.05
    noise: float = 0.002
    """Of the friction response in a segment of one second, N."""
    together: bool = False
    """All tones in one trial."""
    info: dict[str, object] = field(default_factory=dict)


def friction(finger: Finger, tone: FloatArray, speed: FloatArray) -> NDArray[np.complex128]:
    """Return the true response."""
    cutoff = finger.cutoff_0_hz + finger.slope * np.clip(speed, *finger.law_mm_s)
    s = 2j * np.pi * tone
    low_pass = finger.gain_n / (1.0 + s / (2.0 * np.pi * cutoff))
    return np.asarray(low_pass * np.exp(-s * finger.delay_s), np.complex128)


def mobility(finger: Finger, tone: FloatArray, speed: FloatArray) -> NDArray[np.complex128]:
    """Return the true mobility."""
    s = 2j * np.pi * tone
    mass = finger.mass_kg + finger.mass_slope * (speed - 60.0)
    stiffness = finger.stiffness + finger.stiffness_slope * (speed - 60.0)
    response: NDArray[np.complex128] = (
        s / (mass * s**2 + finger.damping * s + stiffness) * np.exp(-s * finger.skin_delay_s)
    )
    return response


def observations(
    fingers: Sequence[Finger], bench: Bench, rng: np.random.Generator
) -> list[TrialObservations]:
    """Return the trials of all participants, in random order within each."""
    out = []
    for number, finger in enumerate(fingers):
        tones = [bench.tones_hz] if bench.together else [(tone,) for tone in bench.tones_hz]
        asked = [(v, f, t) for v in bench.speeds for f in bench.forces for t in tones]
        for order, at in enumerate(rng.permutation(len(asked)).tolist()):
            speed, force, tone = asked[at]
            info = TrialInfo(
                f"p{number:02}-{order:03}",
                f"P{number + 1:02}",
                1,
                order,
                speed,
                force,
                tone,
                150.0,
                20_000.0,
                "2026-01-01T00:00:00Z",
            )
            out.append(trial(finger, replace(info, **bench.info), bench, rng))  # type: ignore[arg-type]
    return out


def trial(
    finger: Finger, info: TrialInfo, bench: Bench, rng: np.random.Generator
) -> TrialObservations:
    """Return what one trial says."""
    stroke_s = 70.0 / info.speed_mm_s
    sweeps = max(int(bench.seconds / (stroke_s + 0.15)), 1)
    shape = (sweeps, 3, len(info.tones_hz))
    tone = np.broadcast_to(info.tones_hz, shape).astype(np.float64)
    speed = info.speed_mm_s * (1.0 + bench.speed_wander * rng.standard_normal((sweeps, 1, 1)))
    speed = np.broadcast_to(speed, shape)
    gain = (1.0 + bench.trial_gain * rng.standard_normal()) * (
        1.0 + bench.segment_gain * rng.standard_normal((sweeps, 3, 1))
    )

    def noise(size: FloatArray) -> NDArray[np.complex128]:
        drawn: NDArray[np.complex128] = rng.standard_normal(shape) + 1j * rng.standard_normal(
            shape
        )
        return size * drawn

    error = bench.noise / np.sqrt(stroke_s / 3.0) * np.ones(shape)
    clean = gain * friction(finger, tone, speed)
    skin = mobility(finger, tone, speed)
    skin_gain = (1.0 + bench.trial_gain * rng.standard_normal()) * (
        1.0 + bench.segment_gain * rng.standard_normal((sweeps, 3, 1))
    )
    skin_error: FloatArray = np.abs(skin) * np.abs(error / clean)
    sweep, third, _ = np.indices(shape)
    force = info.force_n * (1.0 + 0.05 * rng.standard_normal(shape))
    rows = ResponseRows(
        sweep=sweep.ravel(),
        direction=1 - 2 * (sweep.ravel() % 2),
        third=third.ravel(),
        speed_mm_s=speed.ravel(),
        normal_force_n=force.ravel(),
        position_mm=35.0 + (third.ravel() - 1) * 70.0 / 3.0,
        tone_hz=tone.ravel(),
        message=np.full(tone.size, 0.5 + 0j),
        friction_response=(clean + noise(error)).ravel(),
        friction_variance=(error**2).ravel(),
        mobility=(skin_gain * skin + noise(skin_error)).ravel(),
        mobility_variance=(skin_error**2).ravel(),
    )
    return TrialObservations(
        info, "", True, (), (), float(speed.mean()), float(force.mean()), rows
    )
