"""The page of several studies in one HTML file, with a forest plot of each cause."""

from importlib import resources
from pathlib import Path
from typing import Final

import numpy as np
from matplotlib.figure import Figure

from frictus_service.discovery.across_studies.document import (
    AcrossStudies,
    PooledEstimate,
    SizeInStudy,
)
from frictus_service.discovery.catalogue.cause import NO_UNIT, title
from frictus_service.discovery.document import DOCUMENT, REPORT
from frictus_service.discovery.report.page import model_in_words
from frictus_service.durable import replace_files
from frictus_service.identification.report.html import FIT, GRID, fill, picture

VERDICTS: Final = {
    "holds_in_all": "holds in all studies",
    "size_differs": "size differs between studies",
    "in_some_only": "in some studies only",
    "opposite_signs": "sign differs between studies",
    "cannot_tell": "cannot be told from another",
    "not_shown": "not shown",
    "not_tested": "not tested",
}


def write(found: AcrossStudies, folder: Path) -> list[Path]:
    """Write report and document over what stands there; return their paths.

    Parameters
    ----------
    found : AcrossStudies
        The document.
    folder : Path
        Made where it is missing.
    """
    folder.mkdir(parents=True, exist_ok=True)
    contents = {folder / REPORT: render(found).encode(), folder / DOCUMENT: found.to_json()}
    replace_files(contents)
    return list(contents)


def render(found: AcrossStudies) -> str:
    """Return the report as one HTML file with all figures in it.

    Parameters
    ----------
    found : AcrossStudies
        The document.
    """
    shown = [each for each in found.causes if each.in_model]
    return fill(
        resources.files(__package__).joinpath("page.html.j2"),
        {"title": title, "model": model_in_words, "verdict": VERDICTS.__getitem__},
        found=found,
        causes=[
            (
                each,
                picture(
                    forest_plot(each.studies, each.pooled, _label(each.parameter, each.unit))
                ),
            )
            for each in shown
            if each.pooled
        ],
        base=[
            (
                each,
                picture(
                    forest_plot(each.studies, each.pooled, f"ln of {each.id} over base model's")
                ),
            )
            for each in found.base_parameters
        ],
        others=[each for each in found.causes if not each.in_model],
    )


def _label(parameter: str, unit: str) -> str:
    return parameter if unit == NO_UNIT else f"{parameter}, {unit}"


def forest_plot(studies: tuple[SizeInStudy, ...], pooled: PooledEstimate, label: str) -> Figure:
    """Draw a size in every study, its mean over laboratories, and where a new one's lies.

    Squares have the area of a study's precision, filled where its own discovery names the
    cause.

    Parameters
    ----------
    studies : tuple of SizeInStudy
        From top to bottom.
    pooled : PooledEstimate
        Over them.
    label : str
        Of the axis.
    """
    count = len(studies)
    figure = Figure(figsize=(7.5, 1.3 + 0.26 * (count + 2)), layout="constrained")
    axes = figure.add_subplot()
    rows = -np.arange(count, dtype=np.float64)
    value = np.array([each.value for each in studies])
    ends = np.array([each.ci95 for each in studies])
    axes.hlines(rows, ends[:, 0], ends[:, 1], color="0.35", lw=1.2)
    precision = np.array([each.standard_error for each in studies]) ** -2.0
    axes.scatter(
        value,
        rows,
        12.0 + 70.0 * precision / precision.max(),
        marker="s",
        facecolors=["0.2" if each.named else "white" for each in studies],
        edgecolors="0.2",
        zorder=3,
    )
    low, high = pooled.ci95
    mean = -count - 0.3
    axes.fill(
        (low, pooled.value, high, pooled.value), (mean, mean + 0.3, mean, mean - 0.3), color=FIT
    )
    labels = [each.study for each in studies] + ["mean of laboratories"]
    places = [*rows, mean]
    if pooled.prediction95 is not None:
        places.append(mean - 0.9)
        labels.append("a new laboratory")
        axes.hlines(places[-1], *pooled.prediction95, color=FIT, lw=2.0)
    axes.axvline(0.0, color="0.6", lw=0.8)
    axes.set_yticks(places, labels)
    axes.set_ylim(min(places) - 0.6, 0.7)
    axes.set_xlabel(label)
    axes.grid(axis="x", **GRID)
    return figure
