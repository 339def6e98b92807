"""A cause of the catalogue in words; its equation is the effect of the same id."""

from dataclasses import dataclass
from typing import Final, Literal

Response = Literal["friction", "mobility", "both"]
NO_UNIT: Final = "1"
"""How effects write that a parameter is a plain number."""


@dataclass(frozen=True, slots=True)
class Cause:
    """Something that a base model can get wrong, for people.

    The equation, parameters, units and bounds stand in `frictus_hardware.physics.effects`,
    under the same id.

    Attributes
    ----------
    id : str
        The same as that of its effect.
    response : str
        Which response it changes: ``friction``, ``mobility`` or ``both``.
    statement : str
        The cause in one plain sentence.
    literature : str
        Where it stands; "the paper" is Balasubramanian, Pool and Vardar.
    confusable : tuple of (str, str)
        Ids that a design may take for it, each with the experiment that separates the two. A
        pair stands with one of its causes.
    next_experiment : str
        What makes the finding firmer.
    visible_with : str
        What a design needs to show it at all.
    """

    id: str
    response: Response
    statement: str
    literature: str
    confusable: tuple[tuple[str, str], ...]
    next_experiment: str
    visible_with: str


def title(cause_id: str) -> str:
    """Return a cause's id as words."""
    return cause_id.replace("_", " ")
