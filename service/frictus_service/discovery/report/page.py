"""The page of a discovery in one HTML file, and what else a discovery leaves behind."""

import json
from importlib import resources
from pathlib import Path
from typing import Final

from matplotlib.figure import Figure

from frictus.model import Model
from frictus_service.discovery.catalogue.cause import title
from frictus_service.discovery.catalogue.causes import CAUSES
from frictus_service.discovery.document import Discovery
from frictus_service.discovery.report.findings import (
    folds_sentence,
    gain_sentence,
    kept_share,
    levels,
    model_named,
    parameters,
    place_of,
    places,
    shown,
    verdict_sentence,
)
from frictus_service.discovery.report.methods import SOURCES, bibtex, methods_paragraph
from frictus_service.discovery.report.residuals import (
    by_relevance,
    discrepancy_figure,
    remaining,
    residual_bode,
)
from frictus_service.durable import replace_file
from frictus_service.identification.report.html import fill, number, picture

REPORT: Final = "report.html"
DOCUMENT: Final = "report.json"
MODEL: Final = "extended_model.json"
DRAFT: Final = "draft"


def write(found: Discovery, folder: Path) -> list[Path]:
    """Write report, document and extended model, over what stands there; return their paths.

    Where nothing was tested, there is no extended model.

    Parameters
    ----------
    found : Discovery
        The document of a discovery.
    folder : Path
        Made where it is missing.
    """
    folder.mkdir(parents=True, exist_ok=True)
    contents = {
        folder / REPORT: render(found).encode(),
        folder / DOCUMENT: found.to_json(),
    }
    if found.verdict is None:
        (folder / MODEL).unlink(missing_ok=True)  # of an earlier run: nothing was tested
    else:
        model = json.dumps(json.loads(found.extended_model.to_json()), indent=2)
        contents[folder / MODEL] = model.encode()
    for path, content in contents.items():
        replace_file(path, content)
    return list(contents)


def write_draft(found: Discovery, name: str, folder: Path) -> list[Path]:
    """Write a draft of a cause below a folder, at its places in the sources; return the paths.

    Raises
    ------
    DraftCauseError
        If the name cannot be given, or nothing was characterised.
    """
    from frictus_service.discovery.beyond.draft import draft_cause  # late: loads the physics

    written = []
    for place, source in draft_cause(found, name).items():
        path = folder / DRAFT / place
        path.parent.mkdir(parents=True, exist_ok=True)
        replace_file(path, source.encode())
        written.append(path)
    return written


def render(found: Discovery) -> str:
    """Return the report as one HTML file with all figures in it.

    Parameters
    ----------
    found : Discovery
        The document of a discovery.
    """
    drawn = [(name, picture(residual_bode(found, name))) for name in by_relevance(found)]
    named = {one.id for one in found.causes}
    unsure = {one for pair in found.cannot_tell for one in pair.between}
    return fill(
        resources.files(__package__).joinpath("page.html.j2"),
        {
            "title": title,
            "shown": shown,
            "gain": gain_sentence,
            "model": model_in_words,
            "named": model_named,
            "folds": folds_sentence,
            "kept": kept_share,
        },
        found=found,
        verdict=verdict_sentence(found),
        residuals=drawn[:1],
        more_residuals=drawn[1:],
        parameters=_maybe(parameters(found)),
        places=_maybe(places(found)),
        discrepancy=_maybe(discrepancy_figure(found.discrepancy)),
        left=[(place_of(one), one.p_value) for one in found.unexplained],
        remaining=remaining(found),
        methods=methods_paragraph(found),
        sources=SOURCES,
        bibtex=bibtex(),
        levels=_maybe(levels(found)),
        compared="participants" if _of_people(found) else "blocks of trials",
        literature={
            one.id: cause.literature for one in found.causes if (cause := CAUSES.get(one.id))
        },
        state={one.id: _state(one.id, named, unsure) for one in found.tests},
        visible_with={id_: cause.visible_with for id_, cause in CAUSES.items()},
    )


def model_in_words(model: Model) -> str:
    """Return a model's law and effects in one line."""
    effects = [f"{title(effect.id)} ({_values(effect.parameters)})" for effect in model.effects]
    return "; ".join([_values(model.base.model_dump(exclude={"law"})), *effects])


def _values(parameters: dict[str, float]) -> str:
    return ", ".join(f"{name} {number(value)}" for name, value in parameters.items())


def _of_people(found: Discovery) -> bool:
    return found.evidence is None or found.evidence.held_out == "participants"


def _state(cause_id: str, named: set[str], unsure: set[str]) -> str:
    if cause_id in named:
        return "named"
    return "cannot tell" if cause_id in unsure else "not found"


def _maybe(figure: Figure | None) -> str | None:
    return None if figure is None else picture(figure)
