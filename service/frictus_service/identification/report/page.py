"""The page: figures and tables of an identification in one HTML file."""

import base64
import io
from collections.abc import Sequence
from importlib import resources

import jinja2
from matplotlib.figure import Figure

from frictus_service.identification.documents import (
    PARAMETERS,
    ConditionResult,
    Estimate,
    Identification,
)
from frictus_service.identification.observation import TrialObservations
from frictus_service.identification.report.bode import bode, points_of
from frictus_service.identification.report.overview import (
    boxes,
    correlation,
    effects,
    laws,
)

EXAMPLE_SPEED_MM_S, EXAMPLE_FORCE_N = 40.0, 0.2
"""The paper's example; of each participant the condition next to it is drawn."""
_DPI = 110


def render(found: Identification, observations: Sequence[TrialObservations]) -> str:
    """Return the report as one HTML file with all figures in it.

    Parameters
    ----------
    found : Identification
    observations : sequence of TrialObservations
        From which it was identified.
    """
    environment = jinja2.Environment(
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"number": number, "interval": interval, "p": p_value}
    text = resources.files(__package__).joinpath("page.html.j2").read_text(encoding="utf-8")
    with_law = [p for p in found.participants if p.friction and p.friction.law]
    stiffness = [
        one for one in found.correlations if (one.first, one.second) == ("cutoff", "stiffness")
    ]
    return environment.from_string(text).render(
        found=found,
        study=found.study,
        with_law=with_law,
        laws=picture(laws(found)) if any(c.friction for c in found.conditions) else None,
        effects=_maybe(effects(found)),
        boxes=[
            (parameter, picture(figure))
            for parameter in PARAMETERS
            if (figure := boxes(found, parameter)) is not None
        ],
        bodes=_bodes(found, observations),
        correlation=picture(correlation(found, stiffness[0])) if stiffness else None,
        significant=[pair for pair in found.pairs if pair.p < 0.05],
        outliers=[c for c in found.conditions if c.outlier],
        missing=[c for c in found.conditions if c.missing],
    )


def _bodes(
    found: Identification, observations: Sequence[TrialObservations]
) -> list[tuple[ConditionResult, str]]:
    """Return a Bode plot of one condition of each participant."""
    out = []
    for person in found.participants:
        own = [
            c
            for c in found.conditions
            if c.participant == person.participant and c.friction is not None
        ]
        if not own or person.friction is None:
            continue
        chosen = min(
            own,
            key=lambda c: (
                abs(c.speed_mm_s - EXAMPLE_SPEED_MM_S),
                abs(c.force_n - EXAMPLE_FORCE_N),
            ),
        )
        points = points_of(observations, chosen)
        figure = bode(points, chosen, person, found.settings.mobility_highest_hz)
        out.append((chosen, picture(figure)))
    return out


def picture(figure: Figure) -> str:
    """Return a figure as a data URI."""
    stored = io.BytesIO()
    figure.savefig(stored, format="png", dpi=_DPI)
    return "data:image/png;base64," + base64.b64encode(stored.getvalue()).decode("ascii")


def _maybe(figure: Figure | None) -> str | None:
    return None if figure is None else picture(figure)


def number(value: float | None, digits: int = 4) -> str:
    """Return a number for reading; a dash where it is not known."""
    if value is None:
        return "-"
    return f"{value:.{digits}g}"


def interval(estimate: Estimate | None, factor: float = 1.0) -> str:
    """Return a value with its 95 % interval."""
    if estimate is None:
        return "-"
    value = number(factor * estimate.value)
    if estimate.ci95 is None:
        return value
    low, high = (number(factor * end) for end in estimate.ci95)
    return f"{value} [{low}, {high}]"


def p_value(value: float | None) -> str:
    """Return a p value for reading."""
    if value is None:
        return "-"
    return "<0.001" if value < 0.001 else f"{value:.3f}"
