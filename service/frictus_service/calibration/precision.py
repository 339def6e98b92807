"""How precise a protocol is to be expected, before anyone slides a finger.

Observations drawn directly at the level of `ResponseRows`: the law, and what varies around it
from condition to condition, trial to trial and stretch to stretch. Fast enough for thousands
of people; raw samples, with all else that happens on the way, are simulated elsewhere.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from frictus.messages import Excitation
from frictus_hardware.arrays import FloatArray
from frictus_service.calibration import coordinates, design
from frictus_service.calibration.plan import Ask
from frictus_service.identification.observation.response import (
    ResponseRows,
    TrialObservations,
)
from frictus_service.study.trial import TrialInfo

PAPER_SPEEDS_MM_S: Final = (20.0, 40.0, 60.0, 80.0, 100.0)
FORCES_N: Final = (0.2, 0.3, 0.4, 0.5, 0.6)
SLOW_MM_S: Final = (20.0, 25.0, 30.0)
FAST_MM_S: Final = (90.0, 95.0, 100.0)
"""Near the ends of the range, where a line is best held; several, as every condition lies a
little off the line and only new ones average that out."""
STROKE_MM: Final = 60.0
MIDDLE_MM: Final = 35.0
STROKES: Final = 2
"""At least so many in a trial: they are shorter where it is short."""
TURN_S: Final = 0.15
"""Lost at each end of a stroke."""
RATE_HZ: Final = 20_000.0


@dataclass(frozen=True, slots=True)
class Variation:
    """What differs from one trial or stretch to the next, and the noise.

    Attributes
    ----------
    trial_gain, segment_gain : float
        Relative standard deviations of the gain: between trials, and of the thirds of a stroke
        within.
    condition_cutoff, trial_cutoff : float
        Relative standard deviations of the cutoff about the law: of each target speed and
        force, the same whenever it comes again, and of each trial.
    speed : float
        Relative standard deviation of the mean speed of a stroke, which is measured.
    sensor_n : float
        White noise of the force sensor, per sample.
    friction_share, friction_corner_hz : float
        Noise of skin on glass: its rms over mu F_n, and the corner of its low-pass.
    friction_coefficient : float
        mu.
    """

    trial_gain: float = 0.10
    segment_gain: float = 0.05
    condition_cutoff: float = 0.05
    trial_cutoff: float = 0.0
    speed: float = 0.05
    sensor_n: float = 0.002
    friction_share: float = 0.05
    friction_corner_hz: float = 100.0
    friction_coefficient: float = 0.5

    def density(self, tone_hz: FloatArray, force_n: float) -> FloatArray:
        """Return the one-sided power density of the noise at each tone, N²/Hz."""
        white = 2.0 * self.sensor_n**2 / RATE_HZ
        rms_n = self.friction_share * self.friction_coefficient * force_n
        corner = self.friction_corner_hz
        coloured: FloatArray = (
            2.0 * rms_n**2 / (np.pi * corner) / (1.0 + (tone_hz / corner) ** 2)
        )
        return white + coloured


def paper_asks(record_s: float = 10.0) -> list[Ask]:
    """Return the paper's 375 trials: every tone, speed and force by itself.

    Parameters
    ----------
    record_s : float
        Recorded per trial, s.
    """
    return [
        Ask(speed, force, design.single(tone), 7.0, record_s)
        for speed in PAPER_SPEEDS_MM_S
        for force in FORCES_N
        for tone in design.paper_tones().tolist()
    ]


def quick_asks(
    rng: np.random.Generator, excitation: Excitation, n_trials: int, record_s: float = 2.5
) -> list[Ask]:
    """Return trials of all tones at once, slow and fast in turn, in ever new conditions.

    Parameters
    ----------
    rng : numpy.random.Generator
        Of their order.
    excitation : Excitation
        The tones to play.
    n_trials : int
        How many.
    record_s : float
        Recorded per trial, s.
    """
    ends = []
    for speeds in (SLOW_MM_S, FAST_MM_S):
        pairs = [(speed, force) for speed in speeds for force in FORCES_N]
        ends.append([pairs[at] for at in rng.permutation(len(pairs))])
    asks = []
    for trial in range(n_trials):
        pairs = ends[trial % 2]
        speed, force = pairs[trial // 2 % len(pairs)]
        asks.append(Ask(speed, force, excitation, 2.0, record_s))
    return asks


def draw(
    rng: np.random.Generator, truth: FloatArray, asks: Sequence[Ask], variation: Variation
) -> list[TrialObservations]:
    """Draw what the trials of one person would say.

    Parameters
    ----------
    rng : numpy.random.Generator
        Source of everything random.
    truth : ndarray, shape (4,)
        The person, in `coordinates`.
    asks : sequence of Ask
        What is asked of each trial.
    variation : Variation
        Between conditions, trials and stretches.
    """
    shift = {
        condition: variation.condition_cutoff * rng.standard_normal()
        for condition in sorted({(ask.speed_mm_s, ask.force_n) for ask in asks})
    }
    trials = []
    for order, ask in enumerate(asks):
        person = truth.copy()
        person[:2] += shift[ask.speed_mm_s, ask.force_n]
        person[:2] += variation.trial_cutoff * rng.standard_normal()
        trials.append(_trial(rng, person, ask, variation, order))
    return trials


def _trial(
    rng: np.random.Generator, person: FloatArray, ask: Ask, variation: Variation, order: int
) -> TrialObservations:
    tone = np.array([item.hz for item in ask.excitation.tones])
    amplitude = np.array([item.amplitude for item in ask.excitation.tones])
    stroke_mm = min(STROKE_MM, ask.speed_mm_s * ask.record_s / STROKES)
    sweeps = int(ask.record_s / (stroke_mm / ask.speed_mm_s + TURN_S))
    speed = ask.speed_mm_s * (1.0 + variation.speed * rng.standard_normal((sweeps, 1, 1)))
    shape = (sweeps, 3, tone.size)
    gain = np.exp(person[2]) * (1.0 + variation.trial_gain * rng.standard_normal())
    gain *= 1.0 + variation.segment_gain * rng.standard_normal((sweeps, 3, 1))
    cutoff = coordinates.cutoff_hz(person, speed.ravel()).reshape(speed.shape)
    response = gain * cutoff / (cutoff + 1j * tone) * np.exp(-2j * np.pi * tone * person[3])
    length_s = np.broadcast_to(stroke_mm / 3.0 / speed, shape)
    variance = variation.density(tone, ask.force_n) / (length_s * amplitude**2)
    noise = rng.standard_normal(shape) + 1j * rng.standard_normal(shape)
    sweep, third, _ = np.indices(shape)
    every = np.broadcast_to(tone, shape).ravel()
    nothing = np.full(every.size, np.nan)
    rows = ResponseRows(
        sweep=sweep.ravel(),
        direction=1 - 2 * (sweep.ravel() % 2),
        third=third.ravel(),
        speed_mm_s=np.broadcast_to(speed, shape).ravel(),
        normal_force_n=np.full(every.size, ask.force_n),
        position_mm=(MIDDLE_MM + (third.ravel() - 1) * stroke_mm / 3.0),
        tone_hz=every,
        message=np.broadcast_to(amplitude, shape).ravel().astype(np.complex128),
        friction_response=(response + np.sqrt(variance) * noise).ravel(),
        friction_variance=variance.ravel(),
        mobility=nothing.astype(np.complex128),
        mobility_variance=nothing,
    )
    speed_mm_s, force_n = ask.speed_mm_s, ask.force_n
    info = TrialInfo(
        f"t{order}", "p", 1, order, speed_mm_s, force_n, ask.tones_hz, 150.0, RATE_HZ, ""
    )
    return TrialObservations(info, "", True, (), (), speed_mm_s, force_n, rows)
