"""What a calibration checks besides: sensors that lie as configured, a finger that is linear.

A linear response answers at the tones of an odd multisine alone. A remaining square answers at
even multiples of the base frequency, a cube at odd ones where no tone is played (Pintelon and
Schoukens, System Identification, chapter 4).
"""

from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from frictus.block import Block
from frictus.messages import Excitation, Tone, TouchState
from frictus_hardware.arrays import FloatArray
from frictus_service.calibration.design import BASE_HZ
from frictus_service.errors import AlignmentError, ExcitationDesignError
from frictus_service.identification.observation.sensor_alignment import align_sensors
from frictus_service.identification.observation.sensor_discrepancies import sensor_discrepancies
from frictus_service.identification.observation.stroke_pieces import SensedStrokes
from frictus_service.identification.observation.sweeps import find_sweeps, smooth
from frictus_service.study.trial import Trial

KEPT_S: Final = 90.0
APART_S: Final = 0.5
"""Blocks that are further apart begin another stretch."""
CHANNELS: Final = {"force": slice(0, 3), "accel": slice(3, 6)}


class StrokesCapture:
    """Keeps what was sensed while a finger touched, the newest 90 s of one run of a rig."""

    def __init__(self) -> None:
        self._run: int | None = None
        self._blocks: deque[tuple[str, Block]] = deque()
        self._touches: deque[TouchState] = deque()
        self._kept_s = 0.0

    def add_block(self, stream: str, block: Block) -> None:
        """Take a block of force or acceleration; of other streams nothing is kept."""
        if stream not in CHANNELS:
            return
        if block.run != self._run:  # the rig began anew, and its samples count from 0 again
            self._blocks.clear()
            self._touches.clear()
            self._run, self._kept_s = block.run, 0.0
        self._blocks.append((stream, block))
        self._kept_s += _seconds(block)
        while self._kept_s > KEPT_S * len(CHANNELS):
            self._kept_s -= _seconds(self._blocks.popleft()[1])
        oldest = self._blocks[0][1].first_sample
        while self._touches and self._touches[0].sample < oldest:
            self._touches.popleft()

    def add_touch(self, touch: TouchState) -> None:
        """Take a touch report; those without contact say nothing of the path."""
        if touch.in_contact and touch.run == self._run:
            self._touches.append(touch)

    def strokes(self) -> Iterator[SensedStrokes]:
        """Yield the stretches that were heard; what is missing within them is NaN."""
        blocks = sorted(self._blocks, key=lambda kept: kept[1].first_sample)
        stretch: list[tuple[str, Block]] = []
        end = 0
        for stream, block in blocks:
            if stretch and block.first_sample - end > APART_S * block.sample_rate_hz:
                yield self._joined(stretch, end)
                stretch = []
            stretch.append((stream, block))
            end = max(end, block.first_sample + block.data.shape[1])
        if stretch:
            yield self._joined(stretch, end)

    def _joined(self, stretch: list[tuple[str, Block]], end: int) -> SensedStrokes:
        first, rate_hz = stretch[0][1].first_sample, stretch[0][1].sample_rate_hz
        sensed = np.full((end - first, 6), np.nan)
        for stream, block in stretch:
            at = block.first_sample - first
            sensed[at : at + block.data.shape[1], CHANNELS[stream]] = block.data.T
        reports = {
            touch.sample: (touch.x_mm, touch.y_mm)
            for touch in self._touches
            if first <= touch.sample < end
        }
        at_sample = np.array(sorted(reports))
        position = np.array([reports[sample] for sample in at_sample]).reshape(-1, 2)
        return SensedStrokes(
            rate_hz, sensed[:, :3], sensed[:, 3:], (at_sample - first) / rate_hz, position
        )


def _seconds(block: Block) -> float:
    n_samples: int = block.data.shape[1]
    return n_samples / block.sample_rate_hz


def alignment_of(
    strokes: Sequence[SensedStrokes], declared_latency_s: float
) -> tuple[dict[str, Any] | None, tuple[str, ...]]:
    """Return how the sensors lie, as plain values, and notes on what is not as configured.

    Parameters
    ----------
    strokes : sequence of SensedStrokes
        What was heard.
    declared_latency_s : float
        Of the touch sensor.

    Returns
    -------
    details : dict or None
        The fields of a `SensorAlignment`; None where it cannot be told.
    notes : tuple of str
        Empty where all is as configured.
    """
    try:
        found = align_sensors(strokes)
    except AlignmentError as error:
        return None, (f"whether the sensors lie as configured is unknown: {error}",)
    notes = tuple(
        f"{slip.found}: {slip.to_do}, and calibrate again"
        for slip in sensor_discrepancies(found, declared_latency_s)
    )
    return asdict(found) | {"rotation": found.rotation.tolist()}, notes


LEAST_PERIODS: Final = 5
"""With a Hann window a line takes three bins; two more between lines tell the noise."""


@dataclass(frozen=True, slots=True)
class Distortion:
    """What stands at lines of one parity where no tone is played.

    Attributes
    ----------
    level : float
        Its amplitude over that of the tones; 0 where it does not rise above the noise.
    p_value : float
        Of no more than noise there: each line's F test, combined by Fisher's method.
    """

    level: float
    p_value: float


@dataclass(frozen=True, slots=True)
class Nonlinearity:
    """Distortion at even lines (a square) and at odd ones (a cube, or a limit)."""

    even: Distortion
    odd: Distortion


def nonlinearity(
    stretches: Sequence[FloatArray], excitation: Excitation, sample_rate_hz: float
) -> Nonlinearity:
    """Look for what is not linear between the lowest and the highest tone.

    Parameters
    ----------
    stretches : sequence of ndarray, shape (n_samples,)
        Friction force while the finger slid steadily; each at least 5 periods.
    excitation : Excitation
        An odd multisine, with its period.
    sample_rate_hz : float

    Raises
    ------
    ExcitationDesignError
        If the excitation has no period, or no stretch is long enough.
    """
    if excitation.period_s is None:
        raise ExcitationDesignError("the excitation has no period: its lines are not known")
    period = round(excitation.period_s * sample_rate_hz)
    tones = {round(tone.hz * excitation.period_s) for tone in excitation.tones}
    lines = np.arange(min(tones), max(tones) + 1)
    powers, noises = [], []
    for stretch in stretches:
        periods = stretch.size // period
        if periods >= LEAST_PERIODS:
            power, noise = _line_powers(stretch[: periods * period], periods, lines)
            powers.append(power)
            noises.append(noise)
    if not powers:
        raise ExcitationDesignError(
            f"no stretch lasts {LEAST_PERIODS} periods of {excitation.period_s:g} s"
        )
    power, noise = np.array(powers), np.array(noises)
    played = np.isin(lines, sorted(tones))
    total = float(np.sum(power[:, played] - noise[:, played]))
    even, odd = lines % 2 == 0, (lines % 2 == 1) & ~played
    return Nonlinearity(
        even=_judge(power[:, even], noise[:, even], total),
        odd=_judge(power[:, odd], noise[:, odd], total),
    )


def _line_powers(
    samples: FloatArray, periods: int, lines: NDArray[np.int64]
) -> tuple[FloatArray, FloatArray]:
    """Return power at each line, and that of noise halfway to its neighbours."""
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(samples.size) / samples.size)
    power = np.abs(np.fft.rfft((samples - samples.mean()) * window)) ** 2
    half = periods // 2
    between = 0.5 * (power[lines * periods - half] + power[lines * periods + half])
    return power[lines * periods], between


def _judge(power: FloatArray, noise: FloatArray, total: float) -> Distortion:
    """Judge lines, shape (n_stretches, n_lines), each against the noise beside it."""
    stretches, lines = power.shape
    if not lines:
        return Distortion(0.0, 1.0)
    ratio = power.mean(axis=0) / noise.mean(axis=0)
    each = stats.f.logsf(ratio, 2 * stretches, 4 * stretches)
    excess = float(np.sum(power - noise))
    return Distortion(
        level=float(np.sqrt(max(excess, 0.0) / total)),
        p_value=float(stats.chi2.sf(-2.0 * each.sum(), 2 * lines)),
    )


SURE: Final = 0.01
"""Distortion is noted where noise alone would show as much less often than this,"""
LARGE: Final = 0.01
"""and where it is so large a share of the tones: below, no rendering suffers from it."""
WHAT: Final = {"even": "a square of the drive", "odd": "a cube of the drive, or a limit"}


def linearity_of(trials: Iterable[Trial]) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Return what stands at the lines between the tones, and what is to be noted of it.

    Parameters
    ----------
    trials : iterable of Trial
        With the same odd multisine's tones, whatever their phases.

    Returns
    -------
    details : dict
        Level over that of the tones and p value, of even and of odd lines; empty where no
        sweep lasts long enough to tell.
    notes : tuple of str
    """
    stretches: list[FloatArray] = []
    asked = None
    for trial in trials:
        asked = trial.info
        stretches += stretches_of(trial)
    if asked is None:
        return {}, ()
    tones = [Tone(hz=hz, amplitude=0.1) for hz in asked.tones_hz]
    lines = Excitation(tones=tones, period_s=1.0 / BASE_HZ)
    try:
        found = nonlinearity(stretches, lines, asked.sample_rate_hz)
    except ExcitationDesignError as error:
        return {}, (f"linearity was not judged: {error}",)
    parities: dict[str, Distortion] = {"even": found.even, "odd": found.odd}
    details = {
        parity: {"level": one.level, "p_value": one.p_value} for parity, one in parities.items()
    }
    notes = tuple(
        f"the response is not linear: {WHAT[parity]} shows at {parity} lines with "
        f"{100.0 * one.level:.1f} % of the tones (p = {one.p_value:.2g})"
        for parity, one in parities.items()
        if one.p_value < SURE and one.level > LARGE
    )
    return details, notes


def stretches_of(trial: Trial) -> Iterator[FloatArray]:
    """Yield the friction force of each steady sweep of which no sample is missing, N."""
    motion = smooth(trial.position_mm, trial.position_t_s)
    rate_hz = trial.info.sample_rate_hz
    for sweep in find_sweeps(motion, np.ones(motion.time_s.size, dtype=np.bool_)):
        first, last = max(round(sweep.begin_s * rate_hz), 0), round(sweep.end_s * rate_hz)
        stretch = sweep.direction * trial.force_n[first:last, 0]
        if np.all(np.isfinite(stretch)):
            yield stretch
