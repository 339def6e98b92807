"""Stick-slip: friction that builds up slowly and lets go at once.

The rate of the friction is then skewed to falling: many small rises, few large drops. Noise and
textures that are the same both ways have a skewness of zero. Falls beyond what the bulk of the
rate, and the steps of the sensor, allow are counted as slips.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_service.data_import.friction.coefficient import StudentInterval, mean_of
from frictus_service.data_import.friction.slides import Slide

SMOOTHED_S: Final = 1e-3
"""The friction is averaged over so long: noise of the sensor has as many drops as rises."""
LEAST_RATE_HZ: Final = 500.0
"""Slips last some milliseconds: a slower recording does not see them."""
SKEWED: Final = -0.5
BEYOND: Final = 5.0
"""Standard deviations of the bulk below which a fall is a slip."""
BEYOND_STEPS: Final = 1.5
"""Steps of the sensor, likewise: noise alone falls by one."""
ROUNDING: Final = 1e-6
"""Of the spread of the rate: smaller steps are none of the sensor's."""
MAD_TO_SIGMA: Final = 1.4826


@dataclass(frozen=True, slots=True)
class StickSlipStatistics:
    """Of slides without a drive.

    Attributes
    ----------
    slides : int
        Looked at.
    skewness : StudentInterval
        Of the rate of friction, mean over slides.
    slips_per_s : StudentInterval or None
        Exact interval of a Poisson rate; None where the verdict is none.
    drop_share : float or None
        Median fall of a slip over the mean friction; None where there are none.
    verdict : {'stick-slip', 'none', 'cannot tell'}
        Stick-slip where the interval of the skewness lies below -0.5; none where it does not
        reach it.
    """

    slides: int
    skewness: StudentInterval
    slips_per_s: StudentInterval | None
    drop_share: float | None
    verdict: Literal["stick-slip", "none", "cannot tell"]


def stick_slip(slides: Sequence[Slide]) -> StickSlipStatistics | None:
    """Return whether slides stick and slip; None where fewer than three can show it.

    Parameters
    ----------
    slides : sequence of Slide
        Without a drive.
    """
    kept = [
        each
        for each in slides
        if each.rate_hz >= LEAST_RATE_HZ and np.isfinite(each.friction).mean() > 0.9
    ]
    looked = [_slips(each.friction, each.rate_hz) for each in kept]
    skewness = mean_of(np.array([skewed for skewed, _ in looked]))
    if skewness is None:
        return None
    seconds = sum(each.friction.size / each.rate_hz for each in kept)
    level = float(np.median([np.nanmean(each.friction) for each in kept]))
    if skewness.high < SKEWED:
        verdict: Literal["stick-slip", "none", "cannot tell"] = "stick-slip"
    else:
        verdict = "none" if skewness.low > SKEWED else "cannot tell"
    # What falls without a skewed rate rises as often: it lets nothing go.
    slips = verdict != "none"
    drops = np.concatenate([drop for _, drop in looked if slips] or [np.empty(0)])
    return StickSlipStatistics(
        slides=len(kept),
        skewness=skewness,
        slips_per_s=_poisson(drops.size, seconds) if slips else None,
        drop_share=float(np.median(drops)) / level if drops.size and level > 0.0 else None,
        verdict=verdict,
    )


def _slips(friction: FloatArray, rate_hz: float) -> tuple[float, FloatArray]:
    """Return the skewness of the rate of friction, and the fall of each slip."""
    width = max(round(SMOOTHED_S * rate_hz), 1)
    blocks = friction.size // width
    level = friction[: blocks * width].reshape(blocks, width).mean(axis=1)
    steps = np.diff(level)
    steps = steps[np.isfinite(steps)]
    spread = float(steps.std()) if steps.size > 2 else 0.0
    if spread == 0.0:
        return np.nan, np.empty(0)
    middle = float(np.median(steps))
    skewness = float(np.mean(((steps - steps.mean()) / spread) ** 3))
    bulk = MAD_TO_SIGMA * float(np.median(np.abs(steps - middle)))
    # Of a coarse sensor most steps are 0, and the bulk with them.
    own = np.abs(np.diff(friction))
    coarse = float(own[own > ROUNDING * spread].min(initial=np.inf))
    falling = steps < middle - max(BEYOND * bulk, BEYOND_STEPS * coarse)
    # Adjacent falls are one slip.
    begins = np.flatnonzero(falling & ~np.concatenate([[False], falling[:-1]]))
    totals = np.add.reduceat(np.where(falling, -steps, 0.0), begins) if begins.size else begins
    return skewness, np.asarray(totals, dtype=np.float64)


def _poisson(count: int, seconds: float) -> StudentInterval:
    from scipy import stats

    low = float(stats.chi2.ppf(0.025, 2 * count)) / 2.0 if count else 0.0
    high = float(stats.chi2.ppf(0.975, 2 * count + 2)) / 2.0
    return StudentInterval(count / seconds, low / seconds, high / seconds)
