"""The figure of what no cause explains: smooth over frequency, by its covariate."""

from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator, StrMethodFormatter

from frictus_service.discovery.document import COVARIATES, Discrepancy
from frictus_service.identification.report.html import GRID, ordered


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
