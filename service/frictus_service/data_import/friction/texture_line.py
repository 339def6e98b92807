"""Lines in the spectrum of the force, and whether they follow the speed as a texture's do.

A texture of period p makes a line at v / p: its frequency rises as the speed. A resonance, or
the mains, stays where it is. Each slide gives its strongest line; the slope of log frequency
over log speed, 1 or 0, tells them apart (spatial spectrum: Wiertlewski, Lozada, Hayward 2011).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from frictus_hardware.arrays import FloatArray
from frictus_service.data_import.drive_tones import line_hz
from frictus_service.data_import.friction.interval import Interval, mean_of, regression
from frictus_service.data_import.friction.slides import Slide, force_of, whole

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
    rms : Interval or None
        Of the force within a slide, its straight line left out; in its unit.
    slope : Interval or None
        Of log frequency over log speed; None where speeds differ too little, or lines are few.
    origin : {'texture', 'fixed frequency', 'cannot tell', 'none'}
        What the slope says.
    period_mm : Interval or None
        Of a texture.
    frequency_hz : Interval or None
        Of a line at a fixed frequency.
    """

    slides: int
    lines: int
    force: Literal["tangential", "normal"]
    rms: Interval | None
    slope: Interval | None
    origin: Literal["texture", "fixed frequency", "cannot tell", "none"]
    period_mm: Interval | None
    frequency_hz: Interval | None


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
    lines: int, slope: Interval | None
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
