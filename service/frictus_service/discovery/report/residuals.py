"""What models leave, drawn: residuals by covariate, their size, and what no cause explains."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator, StrMethodFormatter

from frictus_hardware.arrays import FloatArray
from frictus_service.discovery.document import (
    COVARIATES,
    Covariate,
    Discovery,
    Discrepancy,
    ResidualBin,
)
from frictus_service.identification.report.html import GRID, ordered

PARTS = (("size, dB", "db"), ("phase, °", "deg"))
STAGES = (("before", "base model"), ("after", "extended model"))


def by_relevance(found: Discovery) -> list[Covariate]:
    """Return the covariates that can be drawn, first the one whose levels fan out most.

    Parameters
    ----------
    found : Discovery
        The document of a discovery.
    """
    drawn: list[Covariate] = [
        name for name in COVARIATES if any(one.covariate == name for one in found.residuals)
    ]
    return sorted(drawn, key=lambda name: -_spread(found.residuals, name))


def residual_bode(found: Discovery, covariate: Covariate) -> Figure:
    """Draw the residual Bode plot by a covariate: size over phase, before beside after.

    A model that is right leaves all levels on the line at zero, within their bars of one
    standard error, of each model its own.

    Parameters
    ----------
    found : Discovery
        With residuals over `covariate`.
    covariate : str
        What it follows.
    """
    bins = [one for one in found.residuals if one.covariate == covariate]
    levels = sorted({one.level for one in bins})
    figure = Figure(figsize=(9.5, 4.8), layout="constrained")
    panels = figure.subplots(2, 2, sharex=True, sharey="row")
    for row, (label, part) in zip(panels, PARTS, strict=True):
        row[0].set_ylabel(label)
        for axes, (stage, _) in zip(row, STAGES, strict=True):
            for level, colour in zip(levels, ordered(len(levels)), strict=True):
                _line(axes, [b for b in bins if b.level == level], stage, part, colour)
            _dress(axes)
    for axes, (_, model) in zip(panels[0], STAGES, strict=True):
        axes.set_title(model, loc="left")
    for axes in panels[1]:
        axes.set_xlabel("frequency, Hz")
    lines, _ = panels[0, 0].get_legend_handles_labels()
    figure.legend(
        lines,
        [f"{level:.4g}" for level in levels],
        title=f"{covariate}, {COVARIATES[covariate]}",
        loc="outside right upper",
        frameon=False,
        fontsize="small",
    )
    return figure


def _line(
    axes: Axes,
    bins: Sequence[ResidualBin],
    stage: str,
    part: str,
    colour: tuple[float, float, float, float],
) -> None:
    tones = sorted(bins, key=lambda one: one.tone_hz)
    axes.errorbar(
        [one.tone_hz for one in tones],
        [getattr(one, f"{stage}_{part}") for one in tones],
        _errors(tones, stage, part),
        fmt="o-",
        ms=3.5,
        lw=1.0,
        color=colour,
        label="level",
    )


def _errors(bins: Sequence[ResidualBin], stage: str, part: str) -> list[float] | None:
    """Return the standard errors of a model; None where a document does not hold them."""
    name = f"error_{part}" if stage == "after" else f"before_error_{part}"
    errors = [getattr(one, name) for one in bins]
    return None if None in errors else errors


def _dress(axes: Axes) -> None:
    axes.axhline(0.0, color="k", lw=0.8)
    axes.set_xscale("log")
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.grid(**GRID)


def _spread(bins: Sequence[ResidualBin], covariate: Covariate) -> float:
    """Return how far the base model's levels lie apart, in standard errors (RMS).

    At each tone from the mean of its levels: what all levels share is an offset, which says
    nothing of the covariate.
    """
    own = [one for one in bins if one.covariate == covariate]
    squares: list[float] = []
    for tone_hz in {one.tone_hz for one in own}:
        levels = [one for one in own if one.tone_hz == tone_hz]
        for _, part in PARTS:
            values = np.array([getattr(one, f"before_{part}") for one in levels])
            errors = np.array(_errors(levels, "before", part) or _errors(levels, "after", part))
            if errors.all() and values.size > 1:
                squares += np.square((values - values.mean()) / errors).tolist()
    return float(np.sqrt(np.mean(squares))) if squares else 0.0


@dataclass(frozen=True, slots=True)
class ToneResidual:
    """What is left at one tone.

    Attributes
    ----------
    tone_hz : float
        Of the drive.
    before_db, after_db, before_deg, after_deg : float
        RMS over the levels of the covariate: base and extended model.
    noise_db, noise_deg : float
        What chance alone would leave with the extended model: RMS of its standard errors.
    largest : str
        The level of the covariate at which most is left in size.
    beyond : bool
        Whether more is left than twice what chance leaves.
    """

    tone_hz: float
    before_db: float
    after_db: float
    noise_db: float
    before_deg: float
    after_deg: float
    noise_deg: float
    largest: str
    beyond: bool


CHANCE = 2.0
"""Times the standard error: more than this is pointed at."""


def remaining(found: Discovery) -> tuple[str, list[ToneResidual]] | None:
    """Return what is left at each tone, by the covariate that fans out most; None without any.

    Parameters
    ----------
    found : Discovery
        The document of a discovery.
    """
    names = by_relevance(found)
    if not names:
        return None
    own = [one for one in found.residuals if one.covariate == names[0]]
    tones_hz = sorted({one.tone_hz for one in own})
    return names[0], [_at([one for one in own if one.tone_hz == hz]) for hz in tones_hz]


def _at(bins: Sequence[ResidualBin]) -> ToneResidual:
    def rms(name: str) -> float:
        values: FloatArray = np.array([getattr(one, name) for one in bins])
        return float(np.sqrt(np.mean(np.square(values))))

    after_db, noise_db = rms("after_db"), rms("error_db")
    after_deg, noise_deg = rms("after_deg"), rms("error_deg")
    largest = max(bins, key=lambda one: abs(one.after_db))
    return ToneResidual(
        tone_hz=bins[0].tone_hz,
        before_db=rms("before_db"),
        after_db=after_db,
        noise_db=noise_db,
        before_deg=rms("before_deg"),
        after_deg=after_deg,
        noise_deg=noise_deg,
        largest=f"{largest.level:.4g} ({largest.after_db:+.2g} dB)",
        beyond=after_db > CHANCE * noise_db or after_deg > CHANCE * noise_deg,
    )


def discrepancy_figure(found: Discrepancy | None) -> Figure | None:
    """Draw size over phase with 95 % bands, and the form's curve dashed; None without any.

    Parameters
    ----------
    found : Discrepancy or None
        Of the document of a discovery.
    """
    if found is None:
        return None
    levels = sorted({one.level for one in found.bins})
    figure = Figure(figsize=(9.5, 4.8), layout="constrained")
    panels = figure.subplots(2, 1, sharex=True)
    parts = (("size", "db", "size, dB"), ("phase", "deg", "phase, °"))
    for axes, (name, unit, label) in zip(panels, parts, strict=True):
        for level, colour in zip(levels, ordered(len(levels)), strict=True):
            bins = [one for one in found.bins if one.level == level]
            tones = [one.tone_hz for one in bins]
            middle = [getattr(one, f"{name}_{unit}") for one in bins]
            half = [getattr(one, f"half_{unit}") for one in bins]
            named = (
                "all conditions"
                if found.covariate is None
                else f"{level:.4g} ({COVARIATES[found.covariate]})"
            )
            axes.plot(tones, middle, color=colour, lw=1.5, label=named)
            ends = [[m + s * h for m, h in zip(middle, half, strict=True)] for s in (-1.0, 1.0)]
            axes.fill_between(tones, *ends, color=colour, alpha=0.2, lw=0.0)
            form = [getattr(one, f"form_{unit}") for one in bins]
            if None not in form:
                axes.plot(tones, form, "--", color=colour, lw=1.2)
        axes.axhline(0.0, color="k", lw=0.8)
        axes.set_ylabel(label)
        axes.set_xscale("log")
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axes.xaxis.set_minor_locator(NullLocator())
        axes.grid(**GRID)
    panels[1].set_xlabel("frequency, Hz")
    figure.legend(
        *panels[0].get_legend_handles_labels(),
        title=found.covariate or "",
        loc="outside right upper",
        frameon=False,
        fontsize="small",
    )
    return figure
