"""What the lines between the tones of an odd multisine say: whether the response is linear.

A linear response answers at the tones alone. A remaining square answers at even multiples of
the base frequency, a cube at odd ones where no tone is played (Pintelon and Schoukens, System
Identification, chapter 4).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from frictus.messages import Excitation
from frictus_hardware.arrays import FloatArray
from frictus_service.calibration.errors import ExcitationDesignError

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
