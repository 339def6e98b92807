"""The findings of a discovery: parameters of causes, what is left where, and the sentences."""

from collections.abc import Sequence
from itertools import groupby

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator, StrMethodFormatter

from frictus_service.discovery.catalogue.cause import NO_UNIT, title
from frictus_service.discovery.document import (
    COVARIATES,
    Discovery,
    Gain,
    LevelBin,
    NamedCause,
    OneRecording,
    ParameterEstimate,
    RankedModel,
    RivalCost,
    Unexplained,
)
from frictus_service.identification.report.html import FIT, GRID


def verdict_sentence(found: Discovery) -> str:
    """Return the answer: what the base model gets wrong, and why.

    Parameters
    ----------
    found : Discovery
        The document of a discovery.
    """
    if found.verdict is None and found.one_recording is not None:
        return found.one_recording.statement
    if found.verdict is None:
        return "Nothing could be tested, so nothing is said of the base model."
    seen = found.evidence
    blocks = seen is not None and seen.held_out == "blocks"
    if found.verdict == "clean":
        units = "blocks" if blocks else "people"
        return (
            "The base model explains these data: nothing that it gets wrong is reproducible in "
            f"the mean over {units}. Whether it is wrong of some of them alone is not tested."
        )
    wrong = "The base model is wrong"
    if seen is not None and blocks:
        people = seen.participants
        wrong += f" of these {people} people" if people > 1 else " of this person"
    if found.verdict == "characterised":
        more = f" More is left{_where(found)}." if found.unexplained else ""
        return (
            f"{wrong}, no known cause explains it, and this describes it: "
            f"{_forms(found)}.{more}"
        )
    if found.verdict == "unexplained":
        return f"{wrong}, and no known cause explains it{_where(found)}."
    named = ", ".join(_named(cause) for cause in found.causes)
    unsure = "; ".join(
        f"either {title(a)} or {title(b)}"
        for a, b in (one.between for one in found.cannot_tell)
    )
    what = "; ".join(part for part in (named, unsure, _forms(found)) if part)
    if found.verdict == "explained":
        return f"{wrong}, and the data say why: {what}. Nothing else is left."
    why = "the data say partly why" if found.causes else "the data leave open why"
    more = f" More is left{_where(found)}." if found.unexplained else ""
    return f"{wrong}, and {why}: {what}.{more}"


def _forms(found: Discovery) -> str:
    return ", ".join(f"{title(form.id)} (characterised)" for form in found.characterised)


def _named(cause: NamedCause) -> str:
    shape = "" if cause.verdict == "confirmed" else ", in another shape than the catalogue's"
    return f"{title(cause.id)}{shape}"


def _where(found: Discovery) -> str:
    if not found.unexplained:
        return ""
    strongest = min(found.unexplained, key=lambda one: one.p_value)
    return f", most clearly in {place_of(strongest)}"


def place_of(one: Unexplained) -> str:
    """Return where something unexplained is."""
    low, high = one.band_hz
    where = f"{one.channel}, {low:.4g} to {high:.4g} Hz"
    if one.covariate is None:
        return f"{where}, in all conditions"
    return f"{where}, by {one.covariate}"


def gain_sentence(gain: Gain) -> str:
    """Return by how much data are predicted better that were not used to fit."""
    (db, less_db), (deg, less_deg) = gain.residual_db, gain.residual_deg
    return (
        f"Of held-out data it takes away {_less(gain.residual_db)} of the mean square that the "
        f"base model leaves in size ({db:.2g} to {less_db:.2g} dB RMS) and "
        f"{_less(gain.residual_deg)} in phase ({deg:.2g} to {less_deg:.2g}°), noise included."
    )


NEGLIGIBLE = 1e-3
"""Share of a mean square that is told as nothing."""


def _less(rms: tuple[float, float]) -> str:
    before, after = rms
    share = 1.0 - (after / before) ** 2 if before > 0.0 else 0.0
    if share < -NEGLIGIBLE:
        return f"nothing (it leaves {-100.0 * share:.2g} % more)"
    return "nothing" if share < NEGLIGIBLE else f"{100.0 * share:.3g} %"


def kept_share(rival: RivalCost) -> str:
    """Return the share of a named cause's gain that a rival in its place keeps."""
    whole = rival.nats_per_unit + rival.cost
    share = rival.nats_per_unit / whole if whole > 0.0 else 0.0
    return "nothing" if share < NEGLIGIBLE else f"{100.0 * share:.2g} %"


def shown(estimate: ParameterEstimate) -> str:
    """Return a parameter with interval and unit."""
    value = f"{estimate.value:.4g}"
    if estimate.ci95 is not None:
        value += f" [{estimate.ci95[0]:.4g}, {estimate.ci95[1]:.4g}]"
    return value if estimate.unit == NO_UNIT else f"{value} {estimate.unit}"


def model_named(model: RankedModel) -> str:
    """Return the causes of a model of one recording, with their parameters."""
    if not model.causes:
        return "base model alone"
    return "; ".join(
        f"{title(cause)} ("
        + ", ".join(f"{name} {shown(each)}" for name, each in found.items())
        + ")"
        for cause, found in model.parameters.items()
    )


def folds_sentence(one: OneRecording) -> str:
    """Return what a ranking rests on, and for what it holds."""
    return (
        f"It holds for {one.holds_for}: {one.windows} windows of {one.window_s:g} s, "
        f"{1e3 * one.apart_s:.0f} ms apart, where what is random in the friction resembles "
        f"itself for {1e3 * one.correlation_s:.1f} ms; {one.folds} folds in time, each "
        f"predicted from the others. Beyond the base model counts: {one.threshold}."
    )


ROW_IN = 0.22
"""Height of one participant."""
_NORMAL_95 = 1.96


def parameters(found: Discovery) -> Figure | None:
    """Draw the parameters of all named causes; None where none is named.

    Grey: participants, estimated alone, with 95 % bars. Red: across participants with the 95 %
    interval. The line at zero is the base model. Beside it the interval on an axis of its own.

    Parameters
    ----------
    found : Discovery
        The document of a discovery.
    """
    panels = [
        (_name(cause, parameter), estimate)
        for cause in found.causes
        for parameter, estimate in cause.parameters.items()
    ]
    if not panels:
        return None
    rows = [1 + len(estimate.per_participant) for _, estimate in panels]
    figure = Figure(figsize=(9.5, sum(ROW_IN * n + 0.75 for n in rows)), layout="constrained")
    drawn = figure.subplots(
        len(panels), 2, squeeze=False, height_ratios=[n + 1 for n in rows], width_ratios=(3, 2)
    )
    for (axes, near), (name, estimate) in zip(drawn, panels, strict=True):
        _forest(axes, estimate)
        axes.axvline(0.0, color="k", lw=0.8, ls="--")
        axes.set_title(name, loc="left", fontsize="medium")
        _zoomed(near, estimate)
        for each in (axes, near):
            each.set_xlabel("share or exponent" if estimate.unit == NO_UNIT else estimate.unit)
    return figure


def _zoomed(axes: Axes, estimate: ParameterEstimate) -> None:
    """Draw the interval alone, on an axis that it fills to a third."""
    if estimate.ci95 is None:
        axes.set_axis_off()
        return
    low, high = estimate.ci95
    _forest(axes, estimate)
    if high > low:
        axes.set_xlim(low - (high - low), high + (high - low))
    axes.set_title(f"zoomed: [{low:.4g}, {high:.4g}]", loc="left", fontsize="medium")
    axes.set_yticklabels([])
    axes.axvspan(low, high, color=FIT, alpha=0.12, lw=0.0)
    axes.locator_params(axis="x", nbins=5)


def _name(cause: NamedCause, parameter: str) -> str:
    if len(cause.parameters) == 1:
        return title(cause.id)
    return f"{title(cause.id)}: {parameter.replace('_', ' ')}"


def _forest(axes: Axes, estimate: ParameterEstimate) -> None:
    people = estimate.per_participant
    for place, one in enumerate(people):
        half = _NORMAL_95 * (one.standard_error or 0.0)
        axes.errorbar(one.value, place, xerr=half, fmt="o", ms=4, lw=1.0, color="0.45")
    last = len(people)
    axes.plot(estimate.value, last, "D", ms=6, color=FIT)
    if estimate.ci95 is not None:
        axes.plot(estimate.ci95, (last, last), color=FIT, lw=2.5)
    axes.set_yticks(range(last + 1), [*(one.participant for one in people), "all"])
    axes.set_ylim(last + 0.6, -0.6)
    axes.grid(axis="x", **GRID)


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
