"""Tasks: what intervals a trial presents, which answers are accepted, and what they say."""

import math
from typing import Annotated, Final, Literal, TypeAlias

from pydantic import Field, FiniteFloat, model_validator

from frictus.errors import ArgumentError
from frictus.lenient import NO_TRUTH, Exact

Interval = Literal["test", "reference"]
Order: TypeAlias = tuple[Interval, ...]
Question = Annotated[str, Field(min_length=1, max_length=300)]


class TwoAlternatives(Exact):
    """Two intervals, one of them the test: which? Catch trials present the highest level."""

    kind: Literal["2afc"] = "2afc"
    question: Question = "Which felt stronger, the first (1) or the second (2)?"
    feedback: bool = False


class SameDifferent(Exact):
    """Two intervals: the same or different? In catch trials they are the same."""

    kind: Literal["same-different"] = "same-different"
    question: Question = "Did the two feel the same (s) or different (d)?"
    feedback: bool = False


class YesNo(Exact):
    """One interval: did you feel it? Catch trials present the reference."""

    kind: Literal["yes-no"] = "yes-no"
    question: Question = "Did you feel a texture, yes (y) or no (n)?"
    feedback: bool = False


class Magnitude(Exact):
    """A number for what was felt: of one interval, or of how two differ."""

    kind: Literal["magnitude"] = "magnitude"
    question: Question = "How strong was it? Any number above 0."
    intervals: Annotated[Literal[1, 2], NO_TRUTH] = 1
    low: FiniteFloat = 1e-6
    high: Annotated[FiniteFloat, Field(le=1e9)] = 1e6
    """Least and greatest number accepted."""

    @model_validator(mode="after")
    def _range(self) -> "Magnitude":
        if not self.low < self.high:
            raise ValueError(f"low {self.low:g} must be below high {self.high:g}")
        return self


class Adjustment(Exact):
    """The participant sets the level of the test: up, down, until it matches the reference."""

    kind: Literal["adjustment"] = "adjustment"
    question: Question = "Make the second feel like the first: + stronger, - weaker, = done"
    step_db: Annotated[FiniteFloat, Field(ge=0.05, le=20.0)] = 1.0
    """Ratio of levels of one step, 20 log10."""
    low: Annotated[FiniteFloat, Field(gt=0.0)] = 1e-3
    high: Annotated[FiniteFloat, Field(le=1e6)] = 1.0
    """Least and greatest level that can be set."""
    steps: Annotated[int, Field(ge=1, le=1_000)] = 100
    """After which the setting is taken as it is."""

    @model_validator(mode="after")
    def _range(self) -> "Adjustment":
        if not self.low < self.high:
            raise ValueError(f"low {self.low:g} must be below high {self.high:g}")
        return self

    def moved(self, level: float, response: str) -> float:
        """Return the level after a key, within the range.

        Parameters
        ----------
        level : float
            Before it.
        response : str
            ``+``, ``-`` or ``=``.
        """
        sign = {"+": 1.0, "-": -1.0}.get(response, 0.0)
        moved = level * math.pow(10.0, sign * self.step_db / 20.0)
        return min(max(moved, self.low), self.high)


Task = Annotated[
    TwoAlternatives | SameDifferent | YesNo | Magnitude | Adjustment,
    Field(discriminator="kind"),
]
KEYS: Final[dict[str, tuple[str, ...]]] = {
    "2afc": ("1", "2"),
    "same-different": ("s", "d"),
    "yes-no": ("y", "n"),
    "magnitude": (),
    "adjustment": ("+", "-", "="),
}
"""Answers that each task accepts; none where it is a number."""


def guess_rate(task: Task) -> float | None:
    """Return the guess rate of a task; None where it is the participant's own.

    Parameters
    ----------
    task : Task
        The task.
    """
    return 0.5 if isinstance(task, TwoAlternatives) else None


def order_of(task: Task, catch: bool, flip: bool) -> Order:
    """Return what each interval of a trial presents.

    Parameters
    ----------
    task : Task
        The task.
    catch : bool
        Whether it is a catch trial.
    flip : bool
        Whether the reference comes first, where there are two.
    """
    single = isinstance(task, YesNo) or (isinstance(task, Magnitude) and task.intervals == 1)
    if single:
        return ("reference",) if catch else ("test",)
    if isinstance(task, Adjustment):
        return ("reference", "test")
    if catch and not isinstance(task, TwoAlternatives):
        return ("reference", "reference")
    return ("reference", "test") if flip else ("test", "reference")


def correct_answer(task: Task, order: Order, alike: bool = False) -> str | None:
    """Return the right answer; None where no answer is wrong.

    Parameters
    ----------
    task : Task
        The task.
    order : tuple of str
        What each interval presents.
    alike : bool
        Whether test and reference are the same texture.
    """
    if isinstance(task, TwoAlternatives):
        return str(order.index("test") + 1)
    if isinstance(task, YesNo):
        return "y" if "test" in order else "n"
    if isinstance(task, SameDifferent):
        return "d" if "test" in order and not alike else "s"
    return None


def is_positive(task: Task, order: Order, response: str) -> bool | None:
    """Return what a psychometric function counts: right, "yes" or "different".

    Parameters
    ----------
    task : Task
        The task.
    order : tuple of str
        What each interval presented.
    response : str
        As `checked` returns it.

    Returns
    -------
    bool or None
        None for numbers and settings.
    """
    if isinstance(task, TwoAlternatives):
        return response == correct_answer(task, order)
    if isinstance(task, YesNo | SameDifferent):
        return response in ("y", "d")
    return None


def checked(task: Task, response: str) -> str:
    """Return an answer as it is kept, or refuse it.

    Parameters
    ----------
    task : Task
        What was asked.
    response : str
        What was answered.

    Raises
    ------
    ArgumentError
        If the task has no such answer; the text says which it has.
    """
    answer = response.strip().lower()[:50]
    if not isinstance(task, Magnitude):
        if answer in KEYS[task.kind]:
            return answer
        raise ArgumentError(f"{answer!r}: {', '.join(KEYS[task.kind])} accepted")
    try:
        number = float(answer)
    except ValueError:
        number = math.nan
    if not task.low <= number <= task.high:
        raise ArgumentError(f"{answer!r}: a number from {task.low:g} to {task.high:g} accepted")
    return repr(number)
