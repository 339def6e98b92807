"""Where something is left that no cause explains, and what was measured besides responses."""

from collections.abc import Sequence
from itertools import groupby

from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator, StrMethodFormatter

from frictus_service.discovery.document import COVARIATES, Discovery, LevelBin
from frictus_service.identification.report.style import FIT, GRID

CHANNELS = {
    "second": "at twice the tone",
    "third": "at three times the tone",
    "line": "at the mains' line",
    "low": "4 to 30 Hz",
}
_SPAN_HZ = (20.0, 2_500.0)
"""Drawn at least, so that one look tells low from high."""
_BROADENED = 1.03
"""A single tone is drawn as a band of this ratio to either side."""


def places(found: Discovery) -> Figure | None:
    """Draw the bands in which something is left, by channel and covariate; None where none is.

    Parameters
    ----------
    found : Discovery
        The document of a discovery.
    """
    if not found.unexplained:
        return None
    left = sorted(found.unexplained, key=lambda one: one.p_value)
    figure = Figure(figsize=(9.5, 0.9 + 0.32 * len(left)), layout="constrained")
    axes = figure.subplots()
    for place, one in enumerate(left):
        low, high = one.band_hz
        low, high = low / _BROADENED, high * _BROADENED
        axes.barh(place, high - low, left=low, height=0.55, color=FIT)
    axes.set_yticks(
        range(len(left)),
        [f"{one.channel}, {one.covariate or 'all conditions'}" for one in left],
    )
    axes.invert_yaxis()
    axes.set_xscale("log")
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axes.xaxis.set_minor_locator(NullLocator())
    ends = [end for one in left for end in one.band_hz if end > 0.0]
    axes.set_xlim(min(_SPAN_HZ[0], *ends), max(_SPAN_HZ[1], *ends))
    axes.set_xlabel("frequency, Hz")
    axes.grid(axis="x", **GRID)
    return figure


def levels(found: Discovery) -> Figure | None:
    """Draw harmonics, mains line and low-frequency power over a covariate; None without any.

    Parameters
    ----------
    found : Discovery
        The document of a discovery.
    """
    panels = [
        (key, list(bins))
        for key, bins in groupby(
            sorted(found.levels, key=_panel_of), key=lambda one: (one.channel, one.covariate)
        )
    ]
    if not panels:
        return None
    columns = min(3, len(panels))
    rows = -(-len(panels) // columns)
    figure = Figure(figsize=(3.15 * columns, 2.6 * rows), layout="constrained")
    drawn = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes, ((channel, covariate), bins) in zip(drawn, panels, strict=False):
        at = [one.level for one in bins]
        measured, errors = zip(
            *((one.measured, one.standard_error) for one in bins), strict=True
        )
        axes.errorbar(at, measured, errors, fmt="ko", ms=3.5, lw=1.0, label="measured")
        axes.plot(at, [one.before for one in bins], "--", color="0.45", label="base")
        axes.plot(at, [one.after for one in bins], color=FIT, label="extended")
        axes.set_title(CHANNELS[channel], loc="left", fontsize="medium")
        axes.set_xlabel(f"{covariate}, {COVARIATES[covariate]}")
        axes.set_ylabel(bins[0].unit)
        axes.grid(**GRID)
    for axes in drawn[len(panels) :]:
        axes.set_axis_off()
    drawn[0].legend(frameon=False, fontsize="small")
    return figure


def _panel_of(one: LevelBin) -> tuple[int, int, float]:
    order: tuple[Sequence[str], Sequence[str]] = (list(CHANNELS), list(COVARIATES))
    return order[0].index(one.channel), order[1].index(one.covariate), one.level
