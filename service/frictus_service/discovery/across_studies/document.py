"""`across-studies/1`: what holds in all studies, and what differs. JSON; null: not known."""

from typing import Annotated, Final, Literal

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat

from frictus.model import Model
from frictus_service.discovery.document import Interval, Probability, Response, Verdict

SizesVerdict = Literal[
    "holds_in_all", "size_differs", "in_some_only", "opposite_signs", "not_shown", "not_tested"
]
MOST_STUDIES: Final = 1000
AcrossVerdict = SizesVerdict | Literal["cannot_tell"]


class _Document(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", populate_by_name=True)


class StudyOutcome(_Document):
    """One study by itself."""

    name: str
    path: str
    sha256: str
    participants: int
    trials: int
    trials_used: int
    held_out: Literal["participants", "blocks"]
    verdict: Verdict | None
    """Its own discovery's."""
    causes: tuple[str, ...]
    """Named by its own discovery."""
    report: str
    """Of its own discovery, below the folder of this document."""


class StudyLeftOut(_Document):
    """A study that is not used."""

    path: str
    reason: str


class SizeInStudy(_Document):
    """A size in one study, the same causes beside it as in all others."""

    study: str
    value: FiniteFloat
    standard_error: FiniteFloat
    ci95: Interval
    people: int
    """Participants, or blocks of their trials."""
    named: bool
    """Whether the study's own discovery names the cause."""


class PooledEstimate(_Document):
    """A size over studies; see `meta_analysis.PooledSize`."""

    value: FiniteFloat
    standard_error: FiniteFloat
    ci95: Interval
    tau: FiniteFloat
    """Standard deviation between studies."""
    tau_ci95: Interval
    i2: Annotated[FiniteFloat, Field(ge=0.0, le=1.0)]
    q: FiniteFloat
    prediction95: Interval | None
    """Where the size of a new laboratory lies; null of fewer than three studies."""
    p_mean: Probability
    """That the mean over laboratories is none."""
    p_tau: Probability
    """That laboratories do not differ. Of causes both are corrected for all that was tested."""


class Alike(_Document):
    """Another cause that looks like one in all studies together."""

    id: str
    similarity: FiniteFloat
    separating_experiment: str


class CauseAcross(_Document):
    """A cause in all studies."""

    id: str
    verdict: AcrossVerdict
    sizes: SizesVerdict
    """What its sizes do, whichever of those that look alike it is."""
    sentence: str
    scope: Literal["participant", "instrument"]
    """Whose it is by its physics."""
    in_model: bool
    """Whether all sizes were taken beside it."""
    parameter: str
    unit: str
    held: dict[str, FiniteFloat] = {}
    """Its other parameters."""
    pooled: PooledEstimate | None
    studies: tuple[SizeInStudy, ...]
    alike: tuple[Alike, ...] = ()
    depends_on: tuple[str, ...] = ()
    """Studies without any one of which it would not be significant."""


class BaseParameterAcross(_Document):
    """A parameter of the base model in all studies, as a multiple of the base model's."""

    id: str
    differs: bool
    """Corrected for the number of these parameters."""
    sentence: str
    pooled: PooledEstimate
    """Of the logarithm."""
    studies: tuple[SizeInStudy, ...]
    """Of the logarithm."""


class AcrossStudies(_Document):
    """An `across-studies/1` document."""

    schema_: Annotated[Literal["across-studies/1"], Field(alias="schema")] = "across-studies/1"
    code_version: str
    response: Response
    base_model: Model
    sentence: str
    """The answer in words."""
    causes: tuple[CauseAcross, ...]
    """Every cause of the catalogue for this response, the clearest first."""
    base_parameters: tuple[BaseParameterAcross, ...]
    studies: tuple[StudyOutcome, ...]
    left_out: tuple[StudyLeftOut, ...]
    notes: tuple[str, ...] = ()

    def to_json(self) -> bytes:
        """Return the document as JSON bytes, indented for reading."""
        return self.model_dump_json(by_alias=True, indent=2).encode()
