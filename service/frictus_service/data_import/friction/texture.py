"""Texture in the force of a slide: levels by band and speed, and lines that follow the speed.

Levels are of third octaves, by Welch's method within each slide: a level is the root mean
square of what lies in a band, its interval that of the mean over slides of one speed. Centres
of bands are 1000 · 10^(n/10) Hz, by IEC 61260-1.

A texture of period p makes a line at v / p: its frequency rises as the speed. A resonance, or
the mains, stays where it is. Each slide gives its strongest line; the slope of log frequency
over log speed, 1 or 0, tells them apart (spatial spectrum: Wiertlewski, Lozada, Hayward 2011).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from statistics import mode
from typing import Final, Literal

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from frictus_hardware.arrays import FloatArray
from frictus_service.data_import.drive_tones import line_hz
from frictus_service.data_import.friction.coefficient import (
    StudentInterval,
    mean_of,
    regression,
)
from frictus_service.data_import.friction.slides import Slide, force_of, whole
from frictus_service.data_import.motion import conditions_of

WINDOW_S: Final = 1.0
HIGHEST_HZ: Final = 1000.0
"""Above, fingers feel nothing of a texture."""
HIGHEST_SHARE: Final = 0.4
"""Of the sample rate: above lies the roll-off of whatever filtered the samples."""
LEAST_BINS: Final = 2


@dataclass(frozen=True, slots=True)
class ForceSpectrum:
    """Of the slides of one speed.

    Attributes
    ----------
    speed_mm_s : float
        Middle of their speeds.
    slides : int
        Used: those at the sample rate of most, long enough to have bands.
    mean : StudentInterval
        Of the force itself; of no width where fewer than three slides are there, as below.
    centre_hz : tuple of float
        Of the third-octave bands.
    rms : tuple of float
        Root mean square of the force in each band, mean over slides.
    rms_low, rms_high : tuple of float
        95 % interval.
    """

    speed_mm_s: float
    slides: int
    mean: StudentInterval
    centre_hz: tuple[float, ...]
    rms: tuple[float, ...]
    rms_low: tuple[float, ...]
    rms_high: tuple[float, ...]


def force_spectra(slides: Sequence[Slide]) -> tuple[ForceSpectrum, ...]:
    """Return the spectra, by rising speed.

    Parameters
    ----------
    slides : sequence of Slide
        Without a drive.
    """
    return tuple(_spectra(slides))


def _spectra(slides: Sequence[Slide]) -> Iterator[ForceSpectrum]:
    of_speed = conditions_of(np.array([each.speed_mm_s for each in slides]))
    name = force_of(slides)
    for speed in np.unique(of_speed[np.isfinite(of_speed)]).tolist():
        own = [each for each, at in zip(slides, of_speed, strict=True) if at == speed]
        # Bands of two rates end elsewhere, and the shortest slides have none.
        rate_hz = mode(each.rate_hz for each in own)
        forces = [getattr(each, name) for each in own if each.rate_hz == rate_hz]
        both = [
            (force, *_levels(flat, rate_hz)) for force in forces if (flat := whole(force)).size
        ]
        used = [(force, centre, rms) for force, centre, rms in both if centre.size]
        if not used:
            continue
        # The shortest slide has the fewest bands.
        centres = min((centre for _, centre, _ in used), key=len)
        table = np.array([rms[-centres.size :] for _, _, rms in used])
        level = np.array([float(np.nanmean(force)) for force, _, _ in used])
        found = [mean_of(column) for column in table.T]
        means = table.mean(axis=0)
        yield ForceSpectrum(
            speed_mm_s=speed,
            slides=len(used),
            mean=mean_of(level) or StudentInterval(*[float(level.mean())] * 3),
            centre_hz=tuple(centres.tolist()),
            rms=tuple(means.tolist()),
            rms_low=_ends(found, means, "low"),
            rms_high=_ends(found, means, "high"),
        )


def _ends(
    found: list[StudentInterval | None], means: FloatArray, end: str
) -> tuple[float, ...]:
    return tuple(
        float(mean) if each is None else max(float(getattr(each, end)), 0.0)
        for each, mean in zip(found, means, strict=True)
    )


def _levels(flat: FloatArray, rate_hz: float) -> tuple[FloatArray, FloatArray]:
    """Return the centres of the bands, and the rms of a slide in each."""
    from scipy import signal

    window = min(flat.size, round(WINDOW_S * rate_hz))
    hz, power = signal.welch(flat, rate_hz, "hann", window, detrend="constant")
    step = hz[1]
    highest_hz = min(HIGHEST_HZ, HIGHEST_SHARE * rate_hz)
    highest = int(np.floor(10.0 * np.log10(highest_hz / 1000.0) + 1e-9))
    centres, levels = [], []
    for number in range(highest, -31, -1):
        centre = 1000.0 * 10.0 ** (number / 10.0)
        inside = (hz >= centre * 10.0**-0.05) & (hz < centre * 10.0**0.05) & (hz >= 2.0 * step)
        if np.count_nonzero(inside) < LEAST_BINS:
            break
        centres.append(centre)
        levels.append(float(np.sqrt(power[inside].sum() * step)))
    return np.array(centres[::-1]), np.array(levels[::-1])


LEAST: Final = 64
"""Samples of a slide that is looked at."""
WINDOWS: Final = 4
"""A slide is divided into so many windows, half overlapping seven."""
CHANCE: Final = 1e-3
"""That noise alone makes a line anywhere in the spectrum of a slide."""
SIDE_BINS: Final = 6
"""On either side of a line, its background;"""
LINE_BINS: Final = 2
"""and between the two, which Hann's window fills."""
SLOPE_SLACK: Final = 0.05
"""A line's frequency is known to a fraction of a bin, which does not average out."""
LEAST_SPEEDS: Final = 1.3


@dataclass(frozen=True, slots=True)
class TextureLine:
    """What lines the force has.

    Attributes
    ----------
    slides, lines : int
        Looked at, and of these with a line.
    force : {'tangential', 'normal'}
        Whose spectrum.
    rms : StudentInterval or None
        Of the force within a slide, its straight line left out; in its unit.
    slope : StudentInterval or None
        Of log frequency over log speed; None where speeds differ too little, or lines are few.
    origin : {'texture', 'fixed frequency', 'cannot tell', 'none'}
        What the slope says.
    period_mm : StudentInterval or None
        Of a texture.
    frequency_hz : StudentInterval or None
        Of a line at a fixed frequency.
    """

    slides: int
    lines: int
    force: Literal["tangential", "normal"]
    rms: StudentInterval | None
    slope: StudentInterval | None
    origin: Literal["texture", "fixed frequency", "cannot tell", "none"]
    period_mm: StudentInterval | None
    frequency_hz: StudentInterval | None


def texture_line(slides: Sequence[Slide]) -> TextureLine | None:
    """Return the lines of the slides; None where no slide is long enough.

    Parameters
    ----------
    slides : sequence of Slide
        Without a drive.
    """
    name = force_of(slides)
    kept = [
        (each, values)
        for each in slides
        if (values := whole(getattr(each, name))).size >= LEAST
    ]
    if not kept:
        return None
    rms = np.array([float(np.std(values)) for _, values in kept])
    found = [(each.speed_mm_s, strongest_line(values, each.rate_hz)) for each, values in kept]
    lines = np.array([(speed, hz) for speed, hz in found if hz is not None]).reshape(-1, 2)
    speed, hz = lines.T
    slope = None
    if len(lines) >= 4 and speed.max() >= LEAST_SPEEDS * speed.min():
        fitted = regression(
            np.column_stack([np.ones(speed.size), np.log(speed / speed.mean())]), np.log(hz)
        )
        slope = None if fitted is None else fitted[1]
    origin = _origin(len(lines), slope)
    period = mean_of(np.log(speed / hz)) if origin == "texture" else None
    fixed = mean_of(np.log(hz)) if origin == "fixed frequency" else None
    return TextureLine(
        slides=len(kept),
        lines=len(lines),
        force="tangential" if name == "friction" else "normal",
        rms=mean_of(rms),
        slope=slope,
        origin=origin,
        period_mm=None if period is None else period.transformed(np.exp),
        frequency_hz=None if fixed is None else fixed.transformed(np.exp),
    )


def _origin(
    lines: int, slope: StudentInterval | None
) -> Literal["texture", "fixed frequency", "cannot tell", "none"]:
    if not lines:
        return "none"
    if slope is None:
        return "cannot tell"
    texture, fixed = (
        slope.low - SLOPE_SLACK <= value <= slope.high + SLOPE_SLACK for value in (1.0, 0.0)
    )
    if texture == fixed:
        return "cannot tell"
    return "texture" if texture else "fixed frequency"


def strongest_line(values: FloatArray, rate_hz: float) -> float | None:
    """Return the frequency that stands out most from its neighbours; None where none does.

    Parameters
    ----------
    values : ndarray, shape (n,)
        A straight line taken out.
    rate_hz : float
        Of the samples.
    """
    from scipy import signal, stats

    window = max(int(values.size / ((WINDOWS + 1) / 2.0)), LEAST // 2)
    hz, power = signal.welch(values, rate_hz, "hann", window, detrend="constant")
    amplitude, step_hz = np.sqrt(power), float(hz[1])
    hz, power = hz[2:-1], power[2:-1]
    if hz.size < 4 * SIDE_BINS or not power.min() > 0.0:
        return None
    # The higher side: a spectrum that only falls has no line, however steeply.
    level = np.log(power)
    sides = np.median(sliding_window_view(level, SIDE_BINS), axis=1)
    apart = SIDE_BINS + 2 * LINE_BINS + 1
    around = np.maximum(sides[:-apart], sides[apart:])
    first = SIDE_BINS + LINE_BINS
    free = 2.0 * WINDOWS  # of the half overlapping windows about as many are independent
    middle = stats.chi2.median(free) / free
    ratio = np.exp(level[first : first + around.size] - around) * middle
    best = int(np.argmax(ratio))
    threshold = stats.chi2.isf(CHANCE / hz.size, free) / free
    # Three bins share a line through Hann's window, and a background of few bins is uncertain.
    if not ratio[best] > 2.0 * threshold:
        return None
    return line_hz(amplitude, best + first + 2, step_hz)
