"""Procedures as a protocol holds them, from which each condition begins its own."""

from typing import Annotated, Final, Literal, Self, TypeAlias

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, model_validator

from frictus.experiment.procedures.next_level import ConstantStimuli, QuestPlus, Staircase
from frictus.experiment.psychometrics.psychometric import LAPSE_FLOOR, FloatArray, ParameterGrid

MAX_LEVEL: Final = 1e6
MAX_TRIALS: Final = 10_000
"""Of one condition."""
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
