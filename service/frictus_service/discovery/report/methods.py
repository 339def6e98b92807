"""The methods paragraph and its sources, ready to paste, from the numbers of the document."""

from dataclasses import dataclass
from typing import Final

from frictus_service.discovery.document import Discovery


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
