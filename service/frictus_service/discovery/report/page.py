"""The page of a discovery in one HTML file, and what else a discovery leaves behind."""

import json
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Final

from matplotlib.figure import Figure

from frictus.model import Model
from frictus_service.discovery.catalogue.cause import title
from frictus_service.discovery.catalogue.causes import CAUSES
from frictus_service.discovery.document import DOCUMENT, REPORT, Discovery
from frictus_service.discovery.one_recording.phrasing import taken_away
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
from frictus_service.discovery.report.residuals import (
    by_relevance,
    discrepancy_figure,
    remaining,
    residual_bode,
)
from frictus_service.durable import replace_file, replace_files
from frictus_service.identification.report.html import fill, number, picture


@dataclass(frozen=True, slots=True)
class Source:
    """A source of the method.

    Attributes
    ----------
    key : str
        Of its BibTeX entry.
    authors, title, journal, year, volume, pages : str
        As BibTeX has them; empty where there is none.
    doi : str
        Empty where it is not known for certain.
    """

    key: str
    authors: str
    title: str
    journal: str
    year: str = ""
    volume: str = ""
    pages: str = ""
    doi: str = ""

    def bibtex(self) -> str:
        """Return the entry."""
        fields = {
            "author": self.authors,
            "title": f"{{{self.title}}}",
            "journal": self.journal,
            "year": self.year,
            "volume": self.volume,
            "pages": self.pages,
            "doi": self.doi,
        }
        inside = ",\n".join(f"  {name} = {{{text}}}" for name, text in fields.items() if text)
        return f"@article{{{self.key},\n{inside}\n}}"


SOURCES: Final = (
    Source(
        "balasubramanian_sliding",
        "Balasubramanian, Jagan K. and Pool, Daan M. and Vardar, Yasemin",
        "Sliding Speed Influences Electrovibration-Induced Finger Friction Dynamics on "
        "Touchscreens",
        "Tribology International",
    ),
    Source(
        "winkler2014permutation",
        "Winkler, Anderson M. and Ridgway, Gerard R. and Webster, Matthew A. and "
        "Smith, Stephen M. and Nichols, Thomas E.",
        "Permutation inference for the general linear model",
        "NeuroImage",
        "2014",
        "92",
        "381--397",
        "10.1016/j.neuroimage.2014.01.060",
    ),
    Source(
        "laird1982random",
        "Laird, Nan M. and Ware, James H.",
        "Random-Effects Models for Longitudinal Data",
        "Biometrics",
        "1982",
        "38",
        "963--974",
        "10.2307/2529876",
    ),
)
"""Base model, sign flips, random effects."""


def methods_paragraph(found: Discovery) -> str | None:
    """Return what was done, in past tense and with the document's own numbers.

    Parameters
    ----------
    found : Discovery
        The document of a discovery; None where nothing was tested.
    """
    if found.verdict is None or found.evidence is None:
        return None
    study, evidence = found.study, found.evidence
    tested = sum(one.not_tested is None for one in found.tests)
    what = (
        "friction force to drive" if found.response == "friction" else "skin velocity to force"
    )
    units = (
        f"{evidence.participants} participants"
        if evidence.held_out == "participants"
        else f"blocks of trials of {evidence.participants} participants"
    )
    own = (
        "gain and cutoff"
        if found.response == "friction"
        else "mass, damping and stiffness of the skin"
    )
    left_out = study.trials - study.trials_used
    dropped = f"; {left_out} were left out for reasons listed in the report" if left_out else ""
    return (
        f"The response of {what} was compared with a base model (law "
        f"{found.base_model.base.law}, after Balasubramanian, Pool and Vardar) in "
        f"{study.trials_used} of {study.trials} trials ({evidence.rows} responses at single "
        f"tones{dropped}). Units of inference were {units}, each counting once, with {own} "
        f"fitted to each. For {tested} causes (of {len(found.tests)} in the catalogue) the "
        "first-order change of the prediction was regressed on what the base model leaves, how "
        "much units differ being a random effect (Laird and Ware, 1982). Significance came "
        "from flipping the signs of whole units (Winkler et al., 2014), the largest statistic "
        "of all candidates correcting p for their number. Gains are those of units held out of "
        "the fit. Intervals are 95 %: mean over units with Student's t, joined with half the "
        "accuracy to which the instrument lets a parameter be known. Software: frictus "
        f"{found.code_version}; seed {found.seed}; study SHA-256 {study.sha256 or 'not known'}."
    )


def bibtex() -> str:
    """Return the entries of all sources of the paragraph."""
    return "\n\n".join(source.bibtex() for source in SOURCES)


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
    if found.verdict is not None:
        model = json.dumps(json.loads(found.extended_model.to_json()), indent=2)
        contents[folder / MODEL] = model.encode()
    replace_files(contents)
    if found.verdict is None:
        (folder / MODEL).unlink(missing_ok=True)  # of an earlier run: nothing was tested
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
            "taken_away": taken_away,
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
