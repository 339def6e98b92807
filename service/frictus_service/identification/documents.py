"""`identification/1`: what an identification says. JSON; null where something is not known."""

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat

Interval = tuple[FiniteFloat, FiniteFloat]
Parameter = Literal["gain", "cutoff", "mass", "damping", "stiffness"]
PARAMETERS: tuple[Parameter, ...] = ("gain", "cutoff", "mass", "damping", "stiffness")
UNITS: dict[Parameter, str] = {
    "gain": "N",
    "cutoff": "Hz",
    "mass": "kg",
    "damping": "N s/m",
    "stiffness": "N/m",
}
Effect = Literal["speed", "force", "interaction"]
EFFECT_UNITS: dict[Effect, str] = {
    "speed": "per mm/s",
    "force": "per N",
    "interaction": "per (mm/s) N",
}


class _Document(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", populate_by_name=True)


class EstimatedQuantity(_Document):
    """A value, its standard error and its 95 % interval."""

    value: FiniteFloat
    standard_error: FiniteFloat | None = None
    ci95: Interval | None = None


class Settings(_Document):
    """What can be set."""

    least_tones: Annotated[int, Field(ge=3)] = 3
    """A condition with fewer tones is listed, not fitted."""
    mobility_highest_hz: Annotated[FiniteFloat, Field(gt=0.0)] = 750.0
    """Tones above are not used for the mobility: the mount's resonances leave little there."""
    outlier_mads: Annotated[FiniteFloat, Field(gt=0.0)] = 4.0
    """Conditions so many scaled median deviations from their participant's law are listed."""
    mixed_models: bool = True
    """Whether to cross-check with mixed models; they take most of the time."""
    sweeps: bool = True
    """Whether to fit every sweep by itself."""
    seed: Annotated[int, Field(ge=0)] = 0
    """Of random sign flips, where there are too many participants to try all."""


class Excluded(_Document):
    """A trial that is not used."""

    trial: str
    participant: str | None = None
    speed_mm_s: FiniteFloat | None = None
    force_n: FiniteFloat | None = None
    tones_hz: tuple[FiniteFloat, ...] = ()
    reasons: tuple[str, ...]


class TrialNote(_Document):
    """What a reader should know of a trial that is used."""

    trial: str
    notes: tuple[str, ...]


class TrialCount(_Document):
    """How many trials of a participant are used."""

    participant: str
    trials: int
    used: int
    without_drive: int


class StudySummary(_Document):
    """The study, and what of it is used."""

    path: str
    sha256: str
    simulated: bool = False
    """Whether it says that no finger was measured."""
    participants: int
    trials: int
    trials_used: int
    counts: tuple[TrialCount, ...]
    excluded: tuple[Excluded, ...]
    notes: tuple[TrialNote, ...]


class Friction(_Document):
    """First-order response of one condition."""

    gain_n: EstimatedQuantity
    cutoff_hz: EstimatedQuantity


class MobilityEstimate(_Document):
    """Mass, spring and damper of one condition."""

    mass_kg: EstimatedQuantity
    damping_n_s_m: EstimatedQuantity
    stiffness_n_m: EstimatedQuantity


class ConditionFit(_Document):
    """One participant at one speed and one force."""

    participant: str
    speed_mm_s: FiniteFloat
    force_n: FiniteFloat
    measured_speed_mm_s: FiniteFloat
    measured_force_n: FiniteFloat
    trials: int
    tones: int
    friction: Friction | None
    mobility: MobilityEstimate | None
    missing: tuple[str, ...] = ()
    """Why something was not estimated."""
    outlier: tuple[Parameter, ...] = ()
    """Parameters that lie far from the rest of the participant's."""


class SweepResult(_Document):
    """Sweep j of every tone's trial of a condition, together."""

    participant: str
    speed_mm_s: FiniteFloat
    force_n: FiniteFloat
    sweep: int
    direction: Literal[1, -1]
    tones: int
    gain_n: EstimatedQuantity
    cutoff_hz: EstimatedQuantity


class CovarianceResult(_Document):
    """Covariance of estimates, in the order and units of `parameters`."""

    parameters: tuple[str, ...]
    matrix: tuple[tuple[FiniteFloat, ...], ...]


class LawResult(_Document):
    """A speed law: `cutoff = cutoff_0 + slope |v|`, with gain and delay."""

    gain_n: EstimatedQuantity
    cutoff_0_hz: EstimatedQuantity
    slope_hz_per_mm_s: EstimatedQuantity
    delay_s: EstimatedQuantity
    covariance: CovarianceResult


class FrictionResult(_Document):
    """What one participant's friction is, law or not."""

    gain_n: EstimatedQuantity
    delay_s: EstimatedQuantity
    cutoff_at: tuple[tuple[FiniteFloat, EstimatedQuantity], ...]
    """Mean measured speed (mm/s) of a target speed's conditions, and their cutoff (Hz)."""
    law: LawResult | None
    without_law: str | None = None
    """Why there is no speed law."""
    law_without_outliers: LawResult | None = None
    """The same without the conditions that are listed as outliers; null: there are none."""
    degrees_of_freedom: FiniteFloat | None = None
    """Of the intervals of a law, the gain's aside: every trial tells that, and it has more."""
    excess_hz: FiniteFloat | None = None
    """How much the conditions' cutoffs scatter around the law beyond sampling error."""
    second_solution: str | None = None
    """What a second solution is that explains the trials alike; null: there is none."""


class MobilityResult(_Document):
    """One participant's skin: means over conditions."""

    mass_kg: EstimatedQuantity
    damping_n_s_m: EstimatedQuantity
    stiffness_n_m: EstimatedQuantity
    delay_s: EstimatedQuantity
    """Of the skin's channel against that of the force."""
    covariance: CovarianceResult


class ParticipantResult(_Document):
    """One participant."""

    participant: str
    speed_range_mm_s: Interval
    force_range_n: Interval
    drive_range_vpp: Interval
    conditions: int
    friction: FrictionResult | None
    mobility: MobilityResult | None


class PopulationValue(_Document):
    """A parameter across participants."""

    name: str
    unit: str
    n: int
    mean: EstimatedQuantity
    """Arithmetic mean; interval by t with n - 1 degrees of freedom, of the gain for lognormal
    values (Cox), as people differ in it by factors."""
    geometric: EstimatedQuantity | None
    """Geometric mean, interval on the logarithm; null where a value is not positive."""
    between_sd: FiniteFloat
    """Standard deviation of the participants' estimates, estimation error included."""
    without_outliers: FiniteFloat | None = None
    """The mean without the conditions that are listed as outliers."""


class Population(_Document):
    """Across participants; each counts once."""

    n: int
    values: tuple[PopulationValue, ...]
    covariance: CovarianceResult | None
    """Of the means of the friction law."""


class MixedCheck(_Document):
    """The same effect by a mixed model; a cross-check only."""

    value: FiniteFloat | None
    standard_error: FiniteFloat | None
    p: FiniteFloat | None
    trusted: bool
    why_not: str | None


class EffectTest(_Document):
    """Whether an effect, estimated in every participant, differs from zero across them."""

    parameter: Parameter
    effect: Effect
    unit: str
    n: int
    value: EstimatedQuantity
    t: FiniteFloat | None
    degrees_of_freedom: int
    p: FiniteFloat | None
    p_holm: FiniteFloat | None
    """Holm's correction of `p` over all effects tested."""
    p_sign_flip: FiniteFloat | None
    """Exact; null below six participants, who cannot reach 5 %."""
    p_max_t: FiniteFloat | None
    """Sign flips, corrected over all effects by the largest t."""
    per_participant: tuple[FiniteFloat, ...]
    without_outliers: FiniteFloat | None = None
    mixed: MixedCheck | None = None


class SpreadTest(_Document):
    """Likelihood-ratio test of the variance between participants (random intercept)."""

    parameter: Parameter
    minus_2_ll_reduced: FiniteFloat
    minus_2_ll_full: FiniteFloat
    ratio: FiniteFloat
    critical_5_percent: FiniteFloat
    p: FiniteFloat
    """From the mixture of a point at zero and chi-square with one degree of freedom."""
    between_sd: FiniteFloat
    residual_sd: FiniteFloat


class PairTest(_Document):
    """Wilcoxon's signed-rank test between two speeds at one force, paired by participant."""

    parameter: Parameter
    force_n: FiniteFloat
    speeds_mm_s: tuple[FiniteFloat, FiniteFloat]
    n: int
    median_difference: FiniteFloat
    p: FiniteFloat
    p_holm: FiniteFloat
    """Corrected over the pairs at this force."""


class OneCorrelation(_Document):
    """Spearman's correlation of some points."""

    r: FiniteFloat
    p: FiniteFloat
    n: int


class Correlation(_Document):
    """Spearman's correlation between a friction and a skin parameter, and what weakens it."""

    first: Parameter
    second: Parameter
    pooled: OneCorrelation
    per_participant: dict[str, OneCorrelation]
    within_mean: EstimatedQuantity | None
    """Mean over participants of their own correlation, by t on Fisher's z."""
    p_within: FiniteFloat | None
    at_equal_speed: OneCorrelation | None
    """Pooled, of what is left when each participant's trend with speed is taken out."""
    cautions: tuple[str, ...]


class Identification(_Document):
    """An `identification/1` document."""

    schema_: Annotated[Literal["identification/1"], Field(alias="schema")] = "identification/1"
    code_version: str
    settings: Settings
    study: StudySummary
    conditions: tuple[ConditionFit, ...]
    sweeps: tuple[SweepResult, ...]
    participants: tuple[ParticipantResult, ...]
    population: Population | None
    effects: tuple[EffectTest, ...]
    spreads: tuple[SpreadTest, ...]
    pairs: tuple[PairTest, ...]
    correlations: tuple[Correlation, ...]
    notes: tuple[str, ...]

    def to_json(self) -> bytes:
        """Return the document as JSON bytes."""
        return self.model_dump_json(by_alias=True).encode()
