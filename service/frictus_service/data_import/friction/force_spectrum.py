"""Spectra of the force by speed: third-octave levels, as a texture drives it.

Welch's method within each slide; a level is the root mean square of what lies in a band, its
interval that of the mean over slides of one speed. Centres of bands are 1000 · 10^(n/10) Hz, by
IEC 61260-1.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_service.data_import.friction.interval import Interval, mean_of
from frictus_service.data_import.friction.slides import Slide, force_of, whole
from frictus_service.data_import.strokes import conditions_of

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
        So many.
    mean : Interval
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
    mean: Interval
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
        forces = [getattr(each, name) for each in own]
        rate_hz = own[0].rate_hz
        levels = [
            _levels(flat, rate_hz)
            for each, force in zip(own, forces, strict=True)
            if each.rate_hz == rate_hz and (flat := whole(force)).size
        ]
        if not levels:
            continue
        # The shortest slide has the fewest bands.
        centres = min((centre for centre, _ in levels), key=len)
        table = np.array([rms[-centres.size :] for _, rms in levels]).reshape(-1, centres.size)
        level = np.array([float(np.nanmean(force)) for force in forces])
        found = [mean_of(column) for column in table.T]
        means = table.mean(axis=0)
        yield ForceSpectrum(
            speed_mm_s=speed,
            slides=len(own),
            mean=mean_of(level) or Interval(*[float(level.mean())] * 3),
            centre_hz=tuple(centres.tolist()),
            rms=tuple(means.tolist()),
            rms_low=_ends(found, means, "low"),
            rms_high=_ends(found, means, "high"),
        )


def _ends(found: list[Interval | None], means: FloatArray, end: str) -> tuple[float, ...]:
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
