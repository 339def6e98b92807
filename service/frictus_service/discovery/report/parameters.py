"""Each cause's parameters: every participant, and all of them with the interval."""

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from frictus_service.discovery.catalogue.cause import NO_UNIT, title
from frictus_service.discovery.document import Discovery, NamedCause, ParameterEstimate
from frictus_service.identification.report.style import FIT, GRID

ROW_IN = 0.22
"""Height of one participant."""
_NORMAL_95 = 1.96


def parameters(found: Discovery) -> Figure | None:
    """Draw the parameters of all named causes; None where none is named.

    Grey: participants, estimated alone, with 95 % bars. Red: across participants with the 95 %
    interval. The line at zero is the base model.

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
    drawn = figure.subplots(len(panels), 1, squeeze=False, height_ratios=[n + 1 for n in rows])
    for axes, (name, estimate) in zip(drawn[:, 0], panels, strict=True):
        _forest(axes, estimate)
        axes.set_title(name, loc="left", fontsize="medium")
        axes.set_xlabel("share or exponent" if estimate.unit == NO_UNIT else estimate.unit)
    return figure


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
    axes.axvline(0.0, color="k", lw=0.8, ls="--")
    axes.set_yticks(range(last + 1), [*(one.participant for one in people), "all"])
    axes.set_ylim(last + 0.6, -0.6)
    axes.grid(axis="x", **GRID)
