"""The paper's values beside what came out of the pipeline."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, Final

HEADINGS: Final = (
    "quantity",
    "unit",
    "paper",
    "drawn",
    "came out",
    "95 % interval",
    "significant (p)",
    "in the paper (p)",
)


@dataclass(frozen=True, slots=True)
class Row:
    """One quantity.

    Attributes
    ----------
    quantity, unit : str
        As people read them.
    paper : str
        Value in the paper, or why there is none.
    drawn : float
        Truth: the mean over the people who were drawn.
    estimate : float
        What came out.
    ci95 : tuple of float or None
        Its 95 % interval; None where there is no honest one.
    p_value : float or None
        None where no hypothesis is tested.
    paper_p : float or None
        The paper's, as `p_value`.
    """

    quantity: str
    unit: str
    paper: str
    drawn: float
    estimate: float
    ci95: tuple[float, float] | None
    p_value: float | None = None
    paper_p: float | None = None

    @property
    def covers(self) -> bool | None:
        """Whether the interval holds the truth; None without an interval."""
        return None if self.ci95 is None else self.ci95[0] <= self.drawn <= self.ci95[1]

    @property
    def agrees(self) -> bool | None:
        """Whether the verdict at 5 % is the paper's; None where one of them has none."""
        if self.p_value is None or self.paper_p is None:
            return None
        return (self.p_value < 0.05) == (self.paper_p < 0.05)

    def cells(self) -> tuple[str, ...]:
        """Return the cells under `HEADINGS`."""
        return (
            self.quantity,
            self.unit,
            self.paper,
            _plain(self.drawn),
            _plain(self.estimate),
            "" if self.ci95 is None else "[{}, {}]".format(*map(_plain, self.ci95)),
            _verdict(self.p_value),
            _verdict(self.paper_p),
        )

    def fields(self) -> dict[str, Any]:
        """Return what a JSON line holds."""
        return asdict(self) | {"covers": self.covers, "agrees": self.agrees}


def markdown(rows: Sequence[Row]) -> str:
    """Return the rows as a table in Markdown."""
    ruler = ["---"] * len(HEADINGS)
    lines = [HEADINGS, ruler, *(row.cells() for row in rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"


def _plain(number: float) -> str:
    return f"{number:.4g}"


def _chance(p_value: float) -> str:
    return "< 0.001" if p_value <= 0.001 else f"{p_value:.3f}"


def _verdict(p_value: float | None) -> str:
    if p_value is None:
        return ""
    return f"{'yes' if p_value < 0.05 else 'no'} ({_chance(p_value)})"
