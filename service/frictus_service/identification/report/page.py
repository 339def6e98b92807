"""The page: figures and tables of an identification in one HTML file."""

from collections.abc import Sequence
from importlib import resources

from matplotlib.figure import Figure

from frictus_service.identification.documents import (
    PARAMETERS,
    ConditionResult,
    Estimate,
    Identification,
)
from frictus_service.identification.observation.observations import TrialObservations
from frictus_service.identification.report.bode import bode, points_of
from frictus_service.identification.report.html import fill, number, picture
from frictus_service.identification.report.overview import (
    boxes,
    correlation,
    effects,
    laws,
)

EXAMPLE_SPEED_MM_S, EXAMPLE_FORCE_N = 40.0, 0.2
"""The paper's example; of each participant the condition next to it is drawn."""


def render(found: Identification, observations: Sequence[TrialObservations]) -> str:
    """Return the report as one HTML file with all figures in it.

    Parameters
    ----------
    found : Identification
        The document of an identification.
    observations : sequence of TrialObservations
        From which it was identified.
    """
    with_law = [p for p in found.participants if p.friction and p.friction.law]
    stiffness = [
        one for one in found.correlations if (one.first, one.second) == ("cutoff", "stiffness")
    ]
    return fill(
        resources.files(__package__).joinpath("page.html.j2"),
        {"interval": interval},
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


def _maybe(figure: Figure | None) -> str | None:
    return None if figure is None else picture(figure)


def interval(estimate: Estimate | None, factor: float = 1.0) -> str:
    """Return a value with its 95 % interval."""
    if estimate is None:
        return "-"
    value = number(factor * estimate.value)
    if estimate.ci95 is None:
        return value
    low, high = (number(factor * end) for end in estimate.ci95)
    return f"{value} [{low}, {high}]"
