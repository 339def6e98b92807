"""What the paper reports, beside what came out of the pipeline.

Balasubramanian, Pool and Vardar, Sections 3.1 and 3.2.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, Final

PARTICIPANTS: Final = 10
CONDITIONS: Final = 25
SPEEDS_MM_S: Final = (20.0, 40.0, 60.0, 80.0, 100.0)
FORCES_N: Final = (0.2, 0.3, 0.4, 0.5, 0.6)

CUTOFF_0_HZ: Final = 385.68
CUTOFF_SLOPE_HZ_PER_MM_S: Final = 13.811
GAIN_N_PER_V: Final = 0.0123
GAIN_N: Final = 0.39
"""Of a drive fraction of 1: K times 15.9 V of one upper sideband over its half drive."""
MASS_SLOPE_KG_PER_MM_S: Final = 3.5e-5
"""Section 3.2; abstract and discussion say 3.23e-5."""
MASS_SLOPE_ELSEWHERE_KG_PER_MM_S: Final = 3.23e-5
MASS_RISE_PER_MM_S: Final = 0.0082
"""The slope over the mass at the lowest speed."""
STIFFNESS_SLOPE_N_M_PER_MM_S: Final = 4.036
STIFFNESS_RISE_PER_MM_S: Final = 0.0111
DAMPING_N_S_M: Final = 1.3
CUTOFF_STIFFNESS_CORRELATION: Final = 0.34
CUTOFF_STIFFNESS_P: Final = 2.8e-8
"""Spearman's, over all participants and conditions."""

MASS_20_KG: Final = MASS_SLOPE_KG_PER_MM_S / MASS_RISE_PER_MM_S
STIFFNESS_20_N_M: Final = STIFFNESS_SLOPE_N_M_PER_MM_S / STIFFNESS_RISE_PER_MM_S
"""At the lowest speed. 20 mm/s further it is 444 N/m, the paper's example."""


@dataclass(frozen=True, slots=True)
class Likelihoods:
    """-2 log-likelihood without and with a random intercept of the participant."""

    reduced: float
    full: float


LIKELIHOODS: Final = {
    "gain": Likelihoods(-1594.327, -1631.082),
    "cutoff": Likelihoods(3732.094, 3698.635),
    "mass": Likelihoods(-2267.563, -2352.209),
    "damping": Likelihoods(592.744, 550.981),
    "stiffness": Likelihoods(3301.393, 3241.765),
}
"""Gain in N/V, cutoff in Hz, mass in kg, damping in N s/m, stiffness in N/m."""

P_VALUES: Final = {
    ("gain", "speed"): 0.399,
    ("gain", "force"): 0.578,
    ("gain", "interaction"): 0.346,
    ("cutoff", "speed"): 0.001,
    ("cutoff", "force"): 0.291,
    ("cutoff", "interaction"): 0.399,
    ("mass", "speed"): 0.008,
    ("mass", "force"): 0.724,
    ("mass", "interaction"): 0.271,
    ("damping", "speed"): 0.093,
    ("damping", "force"): 0.071,
    ("damping", "interaction"): 0.207,
    ("stiffness", "speed"): 0.001,
    ("stiffness", "force"): 0.285,
    ("stiffness", "interaction"): 0.053,
}
"""Of the mixed models; 0.001 where the paper says less than that."""


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
