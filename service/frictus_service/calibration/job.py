"""What a calibration is asked to do, how it tells its progress, and what comes of it."""

from typing import Annotated, Any, Final, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, model_validator

from frictus.model import Model
from frictus.names import Name

ToneHz = Annotated[FiniteFloat, Field(ge=0.01, le=5_000.0)]
SpeedMmS = Annotated[FiniteFloat, Field(ge=1.0, le=1_000.0)]
ForceN = Annotated[FiniteFloat, Field(gt=0.0, le=10.0)]
_LEVELS: Final = Field(min_length=1, max_length=100)
MOST_TRIALS: Final = 5_000
"""A day of them; the paper's are 375."""
Phase = Literal["break", "approach", "record", "analyse", "done"]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class PaperProtocol(_Strict):
    """The paper's: 15 tones, 5 speeds, 5 forces in random order, one tone per trial.

    Smaller lists give a smaller study by the same rules.
    """

    kind: Literal["paper"] = "paper"
    tones_hz: Annotated[tuple[ToneHz, ...], _LEVELS] | None = None
    """None: 15, spaced evenly in the logarithm from 30 Hz to 2 kHz."""
    speeds_mm_s: Annotated[tuple[SpeedMmS, ...], _LEVELS] = (20.0, 40.0, 60.0, 80.0, 100.0)
    forces_n: Annotated[tuple[ForceN, ...], _LEVELS] = (0.2, 0.3, 0.4, 0.5, 0.6)
    approach_s: Annotated[FiniteFloat, Field(ge=0.0, le=60.0)] = 7.0
    record_s: Annotated[FiniteFloat, Field(ge=0.5, le=120.0)] = 10.0
    trials_per_block: Annotated[int, Field(ge=1)] = 15
    """A break follows each block."""
    break_s: Annotated[FiniteFloat, Field(ge=0.0, le=3600.0)] = 10.0
    max_repeats: Annotated[int, Field(ge=0, le=100)] = 5
    """How often a rejected trial is asked for again; it is then left out, and listed."""

    @model_validator(mode="after")
    def _within_a_day(self) -> Self:
        tones = 15 if self.tones_hz is None else len(self.tones_hz)
        trials = tones * len(self.speeds_mm_s) * len(self.forces_n)
        if trials > MOST_TRIALS:
            raise ValueError(
                f"{trials} trials, every tone at every speed and force: ask for "
                f"fewer, at most {MOST_TRIALS}"
            )
        return self


FOR_DISCOVERY: Final = PaperProtocol(
    tones_hz=(35.0, 80.0, 180.0, 400.0, 850.0, 1700.0),
    speeds_mm_s=(20.0, 45.0, 75.0, 100.0),
    forces_n=(0.2, 0.4, 0.6),
    approach_s=2.0,
    record_s=2.0,
    trials_per_block=36,
)
"""One person's 72 trials in 5 minutes, of which `frictus discover` makes 8 blocks."""


class QuickProtocol(_Strict):
    """All tones at once, slow and fast in turn; ends when it is precise.

    Many conditions rather than many repeats: how a finger scatters about its law shows only
    between conditions, and a law from two of them holds for those two.
    """

    kind: Literal["quick"] = "quick"
    speeds_mm_s: Annotated[tuple[SpeedMmS, ...], _LEVELS] = (
        20.0,
        25.0,
        30.0,
        90.0,
        95.0,
        100.0,
    )
    forces_n: Annotated[tuple[ForceN, ...], _LEVELS] = (0.2, 0.3, 0.4, 0.5, 0.6)
    approach_s: Annotated[FiniteFloat, Field(ge=0.0, le=60.0)] = 2.0
    record_s: Annotated[FiniteFloat, Field(ge=0.5, le=120.0)] = 2.5
    precision: Annotated[FiniteFloat, Field(gt=0.0, le=1.0)] = 0.05
    """Stop when the 95 % interval of the cutoff, half its width over its value, is within this
    at every speed of the protocol."""
    max_recorded_s: Annotated[FiniteFloat, Field(gt=0.0, le=7200.0)] = 120.0
    """Stop then, precise or not; the result says which."""
    use_prior: bool = True
    max_repeats: Annotated[int, Field(ge=0, le=100)] = 5


class CalibrationSpec(_Strict):
    """One calibration."""

    rig: Name
    """Name of a rig: letters, digits, dots, ``_`` and ``-``."""
    participant: Name
    protocol: Annotated[PaperProtocol | QuickProtocol, Field(discriminator="kind")] = (
        QuickProtocol()
    )
    seed: Annotated[int, Field(ge=0)]
    """Of the order of trials and the phases of tones."""
    session: Annotated[int, Field(ge=0)] = 1
    prior: tuple[Model, ...] = ()
    """Earlier people's models, with covariances, that the quick protocol learns from."""


class Progress(_Strict):
    """Where a calibration stands; told at every change of phase and at least every second."""

    phase: Phase
    trials_done: int
    trials_planned: int | None
    """None where it depends on the precision that is reached."""
    trials_rejected: int
    recorded_s: FiniteFloat
    precision: FiniteFloat | None = None
    """Half width of the 95 % interval of the cutoff over its value, the worst speed's."""
    message: str = ""


class CalibrationResult(_Strict):
    """What came of a calibration."""

    model: Model
    """With covariance and provenance; not yet published."""
    study: str
    """Path of the study file with every trial, the rejected ones too; `notes` name those that
    cannot be read and are not in it."""
    recorded_s: FiniteFloat
    precision: FiniteFloat
    reached: bool
    """Whether the precision that was asked for was reached."""
    notes: tuple[str, ...] = ()
    details: dict[str, Any] = {}
