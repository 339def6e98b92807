"""`plan/1`: what a design shows and what it needs. JSON; null where there is nothing to say."""

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat

from frictus_service.discovery.document import Response

Shown = Literal["yes", "larger only", "no"]
"""Of the size that is wanted: yes, only a larger one, or no size at all."""


class _Document(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", populate_by_name=True)


class Addition(_Document):
    """The cheapest further trials that help, and what they reach."""

    additions: tuple[str, ...]
    """In words; to be made together."""
    finger_s: Annotated[FiniteFloat, Field(ge=0.0)]
    """Seconds on the finger, of all participants together."""
    reaches: FiniteFloat
    """Smallest size found, or largest cosine."""


class PlannedEffect(_Document):
    """One effect of the catalogue in this design."""

    id: str
    parameter: str
    unit: str
    held: dict[str, FiniteFloat] = {}
    """Its other parameters."""
    shown: Shown
    wanted: FiniteFloat
    detectable: FiniteFloat | None
    """Smallest size that is found in four of five studies."""
    standard_error: FiniteFloat | None
    """Of the mean over units; null of a size that shows as its square."""
    needs: str | None = None
    """What a design needs to show it at all."""
    cheapest: Addition | None = None
    """Null where it is shown as small as wanted, or no addition achieves it."""


class PlannedPair(_Document):
    """Two effects that look alike in this design."""

    between: tuple[str, str]
    cosine: Annotated[FiniteFloat, Field(ge=-1.0, le=1.0)]
    separable: Literal["no", "weakly"]
    separating_experiment: str
    cheapest: Addition | None = None
    """Null where they are separable, or no addition of trials separates them."""


class Plan(_Document):
    """A `plan/1` document."""

    schema_: Annotated[Literal["plan/1"], Field(alias="schema")] = "plan/1"
    code_version: str
    seed: Annotated[int, Field(ge=0)]
    source: str
    """The study or the design."""
    response: Response
    participants: int
    trials: int
    """Of each participant, on average."""
    finger_s: FiniteFloat
    """Of all participants together."""
    units: int
    compared: Literal["participants", "blocks"]
    critical_t: FiniteFloat | None
    """|t| that the largest of all effects exceeds by chance in one study of twenty; null where
    nothing can be tested."""
    effects: tuple[PlannedEffect, ...]
    pairs: tuple[PlannedPair, ...]
    """Most alike first."""
    notes: tuple[str, ...]
    """What a reader must know first."""
    assumptions: str

    def to_json(self) -> bytes:
        """Return the document as JSON bytes, indented for reading."""
        return self.model_dump_json(by_alias=True, indent=2).encode()
