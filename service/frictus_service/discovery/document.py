"""`discovery/1`: what a discovery says. JSON; null where something is not known."""

from typing import Annotated, Final, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, model_validator

from frictus.model import Model

REPORT: Final = "report.html"
DOCUMENT: Final = "report.json"
"""Where a discovery's folder keeps its page and this document."""
Interval = tuple[FiniteFloat, FiniteFloat]
Probability = Annotated[FiniteFloat, Field(ge=0.0, le=1.0)]
Response = Literal["friction", "mobility"]
Verdict = Literal["clean", "explained", "partly_explained", "characterised", "unexplained"]
Covariate = Literal["speed", "force", "minutes", "direction", "position"]
COVARIATES: dict[Covariate, str] = {
    "speed": "mm/s",
    "force": "N",
    "minutes": "min",
    "direction": "+1: left to right",
    "position": "mm",
}
"""What the figures are drawn over, and the unit."""


class _Document(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", populate_by_name=True)


class TrialsLeftOut(_Document):
    """One kind of reason for which trials are not used."""

    reason: str
    """Of the first trial that has it; others of its kind differ in figures."""
    trials: int


class StudyFacts(_Document):
    """The study, and how much of it is used."""

    path: str
    sha256: str
    simulated: bool = False
    """Whether it says that no finger was measured."""
    participants: int
    trials: int
    trials_used: int
    left_out: tuple[TrialsLeftOut, ...] = ()
    """All reasons, the most frequent first; a trial that has several counts for each."""


class ParticipantValue(_Document):
    """A parameter in one participant, estimated from their trials alone."""

    participant: str
    value: FiniteFloat
    standard_error: FiniteFloat | None = None


class ParameterEstimate(_Document):
    """A parameter of a cause; across participants where there are several."""

    value: FiniteFloat
    ci95: Interval | None
    unit: str
    standard_error: FiniteFloat | None = None
    per_participant: tuple[ParticipantValue, ...] = ()


class Alternative(_Document):
    """Another cause that looks much like it in this design."""

    id: str
    similarity: Annotated[FiniteFloat, Field(ge=-1.0, le=1.0)]
    """Cosine between the two signatures, own gain and cutoff taken out."""
    separating_experiment: str


class RivalCost(_Document):
    """Another cause in the place of a named one, to first order."""

    id: str
    nats_per_unit: FiniteFloat
    """What it predicts better than the model without either; mean over held-out units. All
    are weighed by the extended model's scatter: to compare them, and too large as odds."""
    cost: FiniteFloat
    """By how much the named cause predicts better than it, nats per unit."""
    ci95: Interval


class Gain(_Document):
    """How much better data are predicted that were not used to fit."""

    heldout_loglik: FiniteFloat
    """Increase of the log-likelihood, nats, all held-out units together; each model predicts
    them with the scatter that it leaves in the others."""
    ci95: Interval | None
    """Where the same of another study, of as many units and of this one's models, lies."""
    residual_db: tuple[FiniteFloat, FiniteFloat]
    """RMS of what is left in size, dB: before, after."""
    residual_deg: tuple[FiniteFloat, FiniteFloat]
    """The same in phase, degrees."""


class Evidence(_Document):
    """What a finding rests on."""

    participants: int
    trials: int
    rows: int
    held_out: Literal["participants", "blocks"]
    """What was left out in turn; blocks of trials where there are fewer than six."""
    statement: str
    """How strong that is, in a sentence."""


class NamedCause(_Document):
    """A cause that the data name."""

    id: str
    statement: str
    verdict: Literal["confirmed", "family"]
    """`family`: the cause is of this kind, but its shape is not the catalogue's."""
    parameters: dict[str, ParameterEstimate]
    """None where only another shape than the catalogue's explains the data."""
    p_value: Probability
    """Corrected for all causes that were tested together."""
    gain: Gain | None
    """Null where it is not in the extended model: its shape is not the catalogue's."""
    alternatives: tuple[Alternative, ...]
    next_experiment: str
    evidence: Evidence | None = None
    rivals: tuple[RivalCost, ...] = ()
    """What else would do best in its place, the cheapest first."""


class CannotTell(_Document):
    """Two causes of which this design cannot say which it is."""

    between: tuple[str, str]
    separating_experiment: str
    similarity: FiniteFloat | None = None
    p_value: Probability | None = None
    """That it is either."""

    @model_validator(mode="after")
    def _two(self) -> Self:
        if self.between[0] == self.between[1]:
            raise ValueError("between: two different causes, not one twice")
        return self


class Unexplained(_Document):
    """Something reproducible that no cause accounts for, and where it is."""

    channel: str
    band_hz: Interval
    covariate: str | None
    """None: it is the same in all conditions."""
    p_value: Probability


class Rival(_Document):
    """Another form that held-out people do not tell from the one that is given."""

    id: str
    could_be: str


class CharacterisedForm(_Document):
    """The form of what no cause explains: it predicts, but nobody has confirmed what it is."""

    id: str
    """Of its effect in the extended model."""
    statement: str
    verdict: Literal["characterised"] = "characterised"
    parameters: dict[str, ParameterEstimate]
    p_value: Probability
    """Corrected for all forms and shapes that were tried."""
    nats_per_person: FiniteFloat
    """Mean gain of people who were held out of choosing, and of fitting, the form."""
    ci95: Interval
    share: Probability
    """Of what the causes leave reproducibly."""
    could_be: str
    told_by: str
    """The experiment that tells which."""
    rivals: tuple[Rival, ...] = ()


class DiscrepancyBin(_Document):
    """Smooth discrepancy at one tone and one level of its covariate."""

    level: FiniteFloat
    tone_hz: FiniteFloat
    size_db: FiniteFloat
    half_db: FiniteFloat
    """Half the 95 % interval."""
    phase_deg: FiniteFloat
    half_deg: FiniteFloat
    form_db: FiniteFloat | None = None
    """What the characterised form makes of it; null without one."""
    form_deg: FiniteFloat | None = None


class Discrepancy(_Document):
    """What the causes leave, smooth over frequency, by the covariate that it follows most."""

    covariate: Covariate | None
    """None: the same in all conditions."""
    nats_per_person: FiniteFloat
    """Mean gain of people who were held out."""
    ci95: Interval
    in_model: bool
    """Whether the extended model has it: it predicts, and no form does."""
    bins: tuple[DiscrepancyBin, ...]


class CauseTest(_Document):
    """What came of one cause of the catalogue, named or not."""

    id: str
    statistic: FiniteFloat | None = None
    p_value: Probability | None = None
    detectable: dict[str, FiniteFloat] = {}
    """By parameter: the smallest size that this design shows in four of five studies."""
    not_tested: str | None = None
    """Why not; None where it was tested."""


class ResidualBin(_Document):
    """Measured over predicted response at one tone and one level of a covariate.

    Means over participants, as dB and degrees, with the base model (before) and the extended
    one (after); each participant's own gain and cutoff are fitted in both.
    """

    covariate: Covariate
    level: FiniteFloat
    tone_hz: FiniteFloat
    before_db: FiniteFloat
    before_deg: FiniteFloat
    after_db: FiniteFloat
    after_deg: FiniteFloat
    error_db: FiniteFloat
    """Standard error of the mean with the extended model."""
    error_deg: FiniteFloat
    before_error_db: FiniteFloat | None = None
    """The same with the base model; null where it was not written down."""
    before_error_deg: FiniteFloat | None = None


class LevelBin(_Document):
    """What was measured besides the response, and what the models expect, at one level."""

    channel: Literal["second", "third", "line", "low"]
    covariate: Covariate
    level: FiniteFloat
    measured: FiniteFloat
    before: FiniteFloat
    after: FiniteFloat
    standard_error: FiniteFloat
    unit: str


class UnseenCondition(_Document):
    """Prediction of a speed or a force that was never used to fit."""

    covariate: Covariate
    level: FiniteFloat
    residual_db: tuple[FiniteFloat, FiniteFloat]
    """RMS: before, after."""
    residual_deg: tuple[FiniteFloat, FiniteFloat]


class RankedModel(_Document):
    """One model of one recording, beside the base model."""

    causes: tuple[str, ...]
    """None: the base model."""
    parameters: dict[str, dict[str, ParameterEstimate]]
    """By cause."""
    heldout_loglik: FiniteFloat
    """Over the base model's: nats, all folds together, each predicted from the others. All
    are weighed by the scatter that the best leaves: to rank them, and too large as odds."""
    explained: FiniteFloat | None = None
    """Share of what the base model leaves in held-out folds that it takes away; null in a
    document from before it was computed."""
    standard_error: FiniteFloat
    """From how folds differ."""
    aic: FiniteFloat
    """Less the base model's, 2 ln K for the search among K candidates included."""


class OneRecording(_Document):
    """What ranks first in one recording; it holds for this recording only, without a p."""

    holds_for: Literal["this recording only"] = "this recording only"
    statement: str
    """The answer in words."""
    beyond_threshold: bool
    """Whether the first model says more than chance gives."""
    margin: FiniteFloat
    """By how many nats it does."""
    threshold: str
    """The rule."""
    models: tuple[RankedModel, ...]
    """Best first."""
    searched: int
    """Candidates of which the recording shows something."""
    silent: tuple[str, ...]
    """Causes of which it shows nothing that its own gain and cutoff do not."""
    participant: str
    seconds: FiniteFloat
    windows: int
    folds: int
    window_s: FiniteFloat
    apart_s: FiniteFloat
    """Between two windows."""
    correlation_s: FiniteFloat
    """Of what is random in the friction."""
    refused: tuple[str, ...] = ()
    """Trials that repeat others and count as none."""


class Discovery(_Document):
    """A `discovery/1` document."""

    schema_: Annotated[Literal["discovery/1"], Field(alias="schema")] = "discovery/1"
    code_version: str
    seed: Annotated[int, Field(ge=0)]
    """Of everything random in it."""
    study: StudyFacts
    response: Response
    base_model: Model
    extended_model: Model
    verdict: Verdict | None
    """Null: nothing could be tested; the notes say why."""
    causes: tuple[NamedCause, ...]
    cannot_tell: tuple[CannotTell, ...]
    unexplained: tuple[Unexplained, ...]
    characterised: tuple[CharacterisedForm, ...] = ()
    """The form of what no cause explains."""
    discrepancy: Discrepancy | None = None
    """Null where nothing is left of the response."""
    explained_share: FiniteFloat | None
    """Share of what is reproducibly wrong with the base model that the extended one has not."""
    gain: Gain | None
    """All causes together; null where none is named."""
    evidence: Evidence | None = None
    tests: tuple[CauseTest, ...] = ()
    """Every cause of the catalogue."""
    unseen: tuple[UnseenCondition, ...] = ()
    residuals: tuple[ResidualBin, ...] = ()
    levels: tuple[LevelBin, ...] = ()
    notes: tuple[str, ...] = ()
    """What a reader must know first."""
    one_recording: OneRecording | None = None
    """Where there are too few people and trials for a test."""

    def to_json(self) -> bytes:
        """Return the document as JSON bytes, indented for reading."""
        return self.model_dump_json(by_alias=True, indent=2).encode()
