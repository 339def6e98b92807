"""What an experiment is: a document that a TOML file holds and every log begins with."""

import re
import tomllib
from pathlib import Path
from typing import Annotated, Final, Literal, Self, TypeAlias

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, ValidationError, model_validator

from frictus.errors import ArgumentError, explain
from frictus.experiment.procedures.constant import ConstantStimuli
from frictus.experiment.procedures.quest_plus import QuestPlus
from frictus.experiment.procedures.staircase import Staircase
from frictus.experiment.psychometrics.psychometric import LAPSE_FLOOR, FloatArray, ParameterGrid
from frictus.experiment.stimuli import Amplitude, Difference, Pairs, Stimulus
from frictus.experiment.tasks import Adjustment, Magnitude, SameDifferent, Task, guess_rate
from frictus.textures import Texture

MAX_TOML_BYTES: Final = 10_000_000
MAX_CANDIDATES: Final = 200_000
MAX_TABLE: Final = 10_000_000
"""Levels times candidates of QUEST+ times conditions; of each, 32 bytes are held."""
MAX_LEVEL: Final = 1e6
MAX_TRIALS: Final = 10_000
"""Of one condition."""
_LONG_KEY: Final = re.compile(
    rb"""(?<![\w-])(?:(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){20}"""
)
Level = Annotated[FiniteFloat, Field(gt=0.0, le=MAX_LEVEL)]
Trials = Annotated[int, Field(ge=1, le=MAX_TRIALS)]
AnyProcedure: TypeAlias = QuestPlus | Staircase | ConstantStimuli


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class LevelRange(_Part):
    """Levels in even steps of their logarithm."""

    low: Level
    high: Level
    count: Annotated[int, Field(ge=2, le=500)] = 31

    @model_validator(mode="after")
    def _rises(self) -> Self:
        if not self.low < self.high:
            raise ValueError(f"low {self.low:g} must be below high {self.high:g}")
        return self

    @property
    def values(self) -> FloatArray:
        """The levels, shape (count,)."""
        return np.geomspace(self.low, self.high, self.count)


class QuestPlusPlan(_Part):
    """QUEST+ over a range of levels; candidate thresholds are looked for in the same range."""

    kind: Literal["quest+"] = "quest+"
    levels: LevelRange
    trials: Trials = 60
    slopes: Annotated[
        list[Annotated[FiniteFloat, Field(ge=0.1, le=100.0)]],
        Field(min_length=1, max_length=30),
    ] = [1.0, 1.4, 2.0, 2.8, 4.0, 5.7, 8.0]
    guesses: Annotated[list[FiniteFloat], Field(min_length=1, max_length=10)] = [0.02, 0.1, 0.2]
    """Of tasks whose guess rate is the participant's own; at least 0.005, or one false alarm
    would rule out every high threshold."""
    lapses: Annotated[list[FiniteFloat], Field(min_length=1, max_length=10)] = [
        0.01,
        0.03,
        0.06,
    ]
    """At least 0.005."""

    @model_validator(mode="after")
    def _bounded(self) -> Self:
        for name, rates in (("lapses", self.lapses), ("guesses", self.guesses)):
            if not all(LAPSE_FLOOR <= rate <= 0.5 for rate in rates):
                raise ValueError(f"{name} {rates}: {LAPSE_FLOOR} to 0.5 accepted")
        return self

    @property
    def highest(self) -> float:
        """Greatest level."""
        return self.levels.high

    @property
    def lowest(self) -> float:
        """Least level."""
        return self.levels.low

    def candidates(self, guess: float | None) -> int:
        """Return how many candidate functions there are.

        Parameters
        ----------
        guess : float or None
            Guess rate of the task; None: its own candidates.
        """
        guesses = 1 if guess is not None else len(self.guesses)
        return self.levels.count * len(self.slopes) * guesses * len(self.lapses)

    @property
    def easiest(self) -> float:
        """Level of practice and of catch trials that present something."""
        return self.levels.high

    def begin(self, guess: float | None, rng: np.random.Generator) -> QuestPlus:
        """Return the procedure before its first trial.

        Parameters
        ----------
        guess : float or None
            Guess rate of the task; None: its own candidates.
        rng : numpy.random.Generator
            Is not used.
        """
        guesses = self.guesses if guess is None else [guess]
        levels = self.levels.values
        grid = ParameterGrid.of(levels, self.slopes, guesses, self.lapses)
        return QuestPlus(levels, grid, self.trials)


class StaircasePlan(_Part):
    """A transformed staircase."""

    kind: Literal["staircase"] = "staircase"
    start: Level
    low: Level
    high: Level
    down: Annotated[int, Field(ge=1, le=10)] = 3
    up: Annotated[int, Field(ge=1, le=10)] = 1
    steps_db: Annotated[
        list[Annotated[FiniteFloat, Field(gt=0.0, le=40.0)]], Field(min_length=1, max_length=20)
    ] = [6.0, 4.0, 2.0]
    """20 log10 of the ratio of levels: before the first reversal, the second, and so on."""
    reversals: Trials = 16
    trials: Trials = 100

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if not self.low <= self.start <= self.high or self.low == self.high:
            raise ValueError(
                f"low {self.low:g}, start {self.start:g}, high {self.high:g}: in this order"
            )
        return self

    @property
    def easiest(self) -> float:
        """Level of practice and of catch trials that present something."""
        return self.start

    @property
    def highest(self) -> float:
        """Greatest level."""
        return self.high

    @property
    def lowest(self) -> float:
        """Least level."""
        return self.low

    def begin(self, guess: float | None, rng: np.random.Generator) -> Staircase:
        """Return the procedure before its first trial.

        Parameters
        ----------
        guess : float or None
            Is not used.
        rng : numpy.random.Generator
            Is not used.
        """
        return Staircase(
            self.start,
            self.low,
            self.high,
            self.down,
            self.up,
            self.steps_db,
            self.reversals,
            self.trials,
        )


class ConstantPlan(_Part):
    """Levels given in advance, each as often as the others."""

    kind: Literal["constant"] = "constant"
    levels: Annotated[list[Level], Field(max_length=500)] = []
    """Empty: each pair of a stimulus of pairs."""
    repeats: Annotated[int, Field(ge=1, le=1_000)] = 20

    @property
    def easiest(self) -> float:
        """Level of practice and of catch trials that present something."""
        return max(self.levels)

    @property
    def highest(self) -> float:
        """Greatest level."""
        return max(self.levels)

    @property
    def lowest(self) -> float:
        """Least level."""
        return min(self.levels)

    def begin(self, guess: float | None, rng: np.random.Generator) -> ConstantStimuli:
        """Return the procedure before its first trial.

        Parameters
        ----------
        guess : float or None
            Is not used.
        rng : numpy.random.Generator
            Draws the order.
        """
        return ConstantStimuli(self.levels, self.repeats, rng)


Plan = Annotated[QuestPlusPlan | StaircasePlan | ConstantPlan, Field(discriminator="kind")]


class Presentation(_Part):
    """How the intervals of a trial are presented."""

    interval_s: Annotated[FiniteFloat, Field(ge=0.05, le=60.0)] = 1.0
    """Of each interval, its fades included."""
    gap_s: Annotated[FiniteFloat, Field(ge=0.0, le=60.0)] = 0.5
    """Between intervals, and before the first."""
    fade_s: Annotated[FiniteFloat, Field(ge=0.0, le=5.0)] = 0.1
    """Raised cosine at both ends, in steps that the rig cross-fades."""
    mask: Texture | None = None
    """Felt during the gaps instead of a smooth screen."""
    on_scaled: Literal["flag", "refuse"] = "refuse"
    """What becomes of a trial that the rig cannot render whole: it goes on with its flag and
    the level as rendered, or it is not presented and the level not proposed again."""

    @model_validator(mode="after")
    def _fades_fit(self) -> Self:
        if 2.0 * self.fade_s > self.interval_s:
            raise ValueError(
                f"two fades of {self.fade_s:g} s do not fit in {self.interval_s:g} s"
            )
        return self


class Design(_Part):
    """The order of trials."""

    order: Literal["interleaved", "blocked"] = "interleaved"
    """Of several conditions; blocks follow each other by a Latin square over participants."""
    practice: Annotated[int, Field(ge=0, le=1_000)] = 0
    """Trials at the easiest level before the others, with feedback, not counted."""
    catch_every: Literal[0] | Annotated[int, Field(ge=2, le=1_000)] = 0
    """One catch trial in so many, at a random place; 0 for none. Of 1 no other would come."""
    break_every: Annotated[int, Field(ge=0, le=10_000)] = 0
    """Trials between breaks; 0 for none."""


class Protocol(_Part):
    """An experiment as a document."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9-]{1,60}$")]
    description: Annotated[str, Field(max_length=2_000)] = ""
    task: Task
    procedure: Plan
    conditions: Annotated[
        dict[Annotated[str, Field(pattern=r"^[A-Za-z0-9_.-]{1,50}$")], Stimulus],
        Field(min_length=1, max_length=32),
    ]
    presentation: Presentation = Presentation()
    design: Design = Design()
    record: bool = False
    """Whether the rig's recorder records the session."""

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        pairs = [isinstance(each, Pairs) for each in self.conditions.values()]
        constant = isinstance(self.procedure, ConstantPlan)
        if any(pairs):
            compares = isinstance(self.task, SameDifferent) or (
                isinstance(self.task, Magnitude) and self.task.intervals == 2
            )
            if not (constant and compares and not self.design.catch_every):
                raise ValueError(
                    "pairs of textures take the procedure 'constant', no catch trials, and the "
                    "task 'same-different' or 'magnitude' with two intervals"
                )
        elif isinstance(self.procedure, ConstantPlan) and not self.procedure.levels:
            raise ValueError("the procedure 'constant' takes levels, except with pairs")
        if not constant and self.task.kind in ("magnitude", "adjustment"):
            raise ValueError(
                f"the task {self.task.kind!r} has no right answer for a procedure to follow: "
                "use 'constant'"
            )
        for name, stimulus in self.conditions.items():
            self._check_levels(name, stimulus)
        return self

    def _check_levels(self, name: str, stimulus: Amplitude | Difference | Pairs) -> None:
        """Refuse levels that no scene can hold, and more of them than are kept in memory."""
        plan = self.plan_of(name)
        highest = self.task.high if isinstance(self.task, Adjustment) else plan.highest
        if not highest <= stimulus.max_level:
            raise ValueError(
                f"condition {name!r}: level {highest:g}, at most {stimulus.max_level:g} "
                f"({stimulus.unit}) accepted"
            )
        against_itself = (
            isinstance(stimulus, Amplitude) and stimulus.standard == stimulus.texture
        )
        if against_itself and self.task.kind in ("2afc", "same-different") and plan.lowest <= 1:
            raise ValueError(
                f"condition {name!r}: level {plan.lowest:g} of a texture against itself, which "
                "is level 1: only from there on does the test feel stronger. Use levels above "
                "1, or the stimulus 'difference', whose levels are dB above the texture"
            )
        if isinstance(plan, ConstantPlan):
            if isinstance(stimulus, Pairs) and any(level % 1.0 for level in plan.levels):
                raise ValueError(f"condition {name!r}: levels of pairs are their whole numbers")
            trials = len(plan.levels) * plan.repeats
            if trials > MAX_TRIALS:
                raise ValueError(
                    f"condition {name!r}: {trials} trials, at most {MAX_TRIALS}: use fewer "
                    "levels or repeats"
                )
        elif isinstance(plan, QuestPlusPlan):
            candidates = plan.candidates(guess_rate(self.task))
            table = candidates * plan.levels.count * len(self.conditions)
            if candidates > MAX_CANDIDATES or table > MAX_TABLE:
                raise ValueError(
                    f"{candidates} candidates at {plan.levels.count} levels in "
                    f"{len(self.conditions)} conditions: at most {MAX_CANDIDATES} candidates, "
                    f"and {MAX_TABLE} times levels and conditions; use coarser ranges"
                )

    def plan_of(self, condition: str) -> QuestPlusPlan | StaircasePlan | ConstantPlan:
        """Return the procedure of a condition, with the levels of pairs filled in.

        Parameters
        ----------
        condition : str
            Its name.
        """
        stimulus, plan = self.conditions[condition], self.procedure
        if isinstance(stimulus, Pairs) and isinstance(plan, ConstantPlan) and not plan.levels:
            numbers = [float(k + 1) for k in range(len(stimulus.pairs))]
            return plan.model_copy(update={"levels": numbers})
        return plan

    def begin(self, condition: str, rng: np.random.Generator) -> AnyProcedure:
        """Return the procedure of a condition before its first trial.

        Parameters
        ----------
        condition : str
            Its name.
        rng : numpy.random.Generator
            Draws an order where there is one to draw.
        """
        return self.plan_of(condition).begin(guess_rate(self.task), rng)


def ready_protocols() -> dict[str, Path]:
    """Return the files of the protocols that come with the package, by name."""
    folder = Path(__file__).parent / "protocols"
    return {each.stem: each for each in sorted(folder.glob("*.toml"))}


def parse_protocol(toml: bytes, source: str) -> Protocol:
    """Read a protocol.

    Parameters
    ----------
    toml : bytes
        The document.
    source : str
        Where it is from, for messages.

    Raises
    ------
    ArgumentError
        If it is no protocol; the text says where.
    """
    if _LONG_KEY.search(toml):  # it would be read for minutes
        raise ArgumentError(f"{source}: a key of more than 20 parts; no protocol has one")
    try:
        return Protocol.model_validate(tomllib.loads(toml.decode("utf-8-sig")))
    except ValidationError as error:
        raise ArgumentError(f"{source}: {explain(error)}") from error
    except (ValueError, RecursionError) as error:  # integers of 4300 digits: no TOMLDecodeError
        raise ArgumentError(f"{source} is not TOML: {error}") from error


def load_protocol(source: str | Path) -> Protocol:
    """Read a protocol from a TOML file, or one that comes with the package.

    Parameters
    ----------
    source : str or Path
        A file; or `detection`, `amplitude-difference` or `similarity`.

    Raises
    ------
    ArgumentError
        If the file is no protocol; the text says where.
    FileNotFoundError
        If there is no such file.
    """
    path, ready = Path(source), ready_protocols()
    if not path.is_file():
        if str(source) not in ready:
            raise FileNotFoundError(
                f"there is no file {str(source)!r}; ready protocols: {', '.join(ready)}"
            )
        path = ready[str(source)]
    if path.stat().st_size > MAX_TOML_BYTES:
        raise ArgumentError(f"{path.name}: more than {MAX_TOML_BYTES} bytes")
    return parse_protocol(path.read_bytes(), path.name)
