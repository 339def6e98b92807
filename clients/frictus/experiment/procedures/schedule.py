"""Which trial comes next: a function of protocol, seed and the trials before, and nothing else.

So an experiment that was interrupted goes on where its log ends: the rows are taken in again,
and the next trial is the one that would have come.
"""

import math
from collections import Counter
from dataclasses import dataclass
from typing import Any, Final, Literal

from frictus.errors import ArgumentError
from frictus.experiment.procedures.orders import (
    flipped,
    generator,
    is_catch,
    latin_square,
    next_condition,
)
from frictus.experiment.procedures.plans import MAX_LEVEL, AnyProcedure
from frictus.experiment.protocol import Protocol
from frictus.experiment.stimuli import Pairs
from frictus.experiment.tasks import (
    Adjustment,
    Order,
    TwoAlternatives,
    correct_answer,
    order_of,
)

NOT_FELT: Final = "not felt"
"""Status of a trial whose answer is kept, and counts for nothing."""
MOST_NOT_FELT: Final = 10
"""In a row: then no finger is there, or the rig does not sense it."""


@dataclass(frozen=True, slots=True)
class ScheduledTrial:
    """A trial before it is presented.

    Attributes
    ----------
    number : int
        From 1, practice and refused trials included.
    phase : {'practice', 'main'}
        Practice is not counted.
    condition : str
        Name of the condition.
    level : float
        Asked for, in the unit of the stimulus; where it is set by the participant, the first.
    catch : bool
        Whether it is a catch trial.
    order : tuple of str
        What each interval presents, `test` or `reference`.
    correct : str or None
        The right answer, where one is.
    feedback : bool
        Whether the participant is told if the answer was right.
    pause : bool
        Whether a break comes before it.
    """

    number: int
    phase: Literal["practice", "main"]
    condition: str
    level: float
    catch: bool
    order: Order
    correct: str | None
    feedback: bool
    pause: bool


class Schedule:
    """The trials of an experiment in their order.

    Parameters
    ----------
    protocol : Protocol
        The experiment.
    seed : int
        Of everything that is drawn, 0 or above.
    order_row : int
        Row of the Latin square by which blocks follow each other, from 0: the participant's
        number.
    """

    def __init__(self, protocol: Protocol, seed: int, order_row: int = 0) -> None:
        self._protocol, self._seed = protocol, seed
        names = list(protocol.conditions)
        square = latin_square(len(names))
        self.conditions = [names[k] for k in square[order_row % len(square)]]
        self.procedures: dict[str, AnyProcedure] = {
            name: protocol.begin(name, generator(seed, "procedure", name)) for name in names
        }
        self._counted = dict.fromkeys(names, 0)
        self._repeats: Counter[tuple[str, float]] = Counter()
        self._limits: dict[str, float] = {}
        self._recorded = 0
        self._not_felt = 0
        self._practised = 0
        self._rested_at = 0

    @property
    def seed(self) -> int:
        """Of everything that is drawn."""
        return self._seed

    @property
    def recorded(self) -> int:
        """How many trials were recorded, practice and refused ones included."""
        return self._recorded

    def next(self) -> ScheduledTrial | None:
        """Return the next trial, the same until it is recorded; None after the last."""
        design = self._protocol.design
        if self._practised < design.practice:
            name = self.conditions[self._practised % len(self.conditions)]
            return self._trial("practice", name, self._practised, False)
        left = [name for name in self.conditions if not self.procedures[name].finished]
        if not left:
            return None
        if design.order == "blocked":
            name = left[0]
        else:
            done = {name: self._counted[name] for name in left}
            name = next_condition(self._seed, sum(self._counted.values()), done)
        place = self._counted[name]
        sets = isinstance(self._protocol.task, Adjustment)  # to a level: there is no catch
        catch = not sets and is_catch(self._seed, name, place, design.catch_every)
        return self._trial("main", name, place, catch)

    def _trial(
        self, phase: Literal["practice", "main"], name: str, place: int, catch: bool
    ) -> ScheduledTrial:
        protocol, task = self._protocol, self._protocol.task
        attention = catch and isinstance(task, TwoAlternatives)
        stimulus = protocol.conditions[name]
        if phase == "practice" and isinstance(stimulus, Pairs):
            draw = generator(self._seed, "practice", name, place)
            level = float(draw.integers(1, len(stimulus.pairs) + 1))
        elif phase == "practice" or attention:
            level = self._easiest(name)
        else:
            level = self.procedures[name].next_level()
        if isinstance(task, Adjustment):  # starts are not to tell where the answer is
            start = generator(self._seed, "start", phase, name, place).uniform(-1.0, 1.0)
            level = min(max(level * 2.0**start, task.low), task.high, self._renderable(name))
        flip = flipped(self._seed, f"{phase} {name}", place)
        alike = False
        if isinstance(stimulus, Pairs):
            alike = len(set(stimulus.names(level))) == 1
            repeat = self._repeats[name, level]
            flip = flipped(self._seed, f"{phase} {name} {level:g}", repeat, block=2)
        order = order_of(task, catch, flip)
        every = protocol.design.break_every
        counted = sum(self._counted.values())
        return ScheduledTrial(
            number=self._recorded + 1,
            phase=phase,
            condition=name,
            level=level,
            catch=catch,
            order=order,
            correct=correct_answer(task, order, alike),
            feedback=phase == "practice" or getattr(task, "feedback", False),
            pause=every > 0 and counted >= self._rested_at + every,
        )

    def _easiest(self, name: str) -> float:
        return min(self._protocol.plan_of(name).easiest, self._renderable(name))

    def _renderable(self, name: str) -> float:
        """Return a level below those that the rig refused; infinite where it refused none."""
        return 0.8 * self._limits.get(name, math.inf)

    def record(
        self, trial: ScheduledTrial, rendered_level: float, positive: bool | None
    ) -> None:
        """Take in an answered trial.

        Parameters
        ----------
        trial : ScheduledTrial
            What `next` returned.
        rendered_level : float
            Level as rendered; a choice at a level of 0 or below tells a procedure nothing.
        positive : bool or None
            Right, "yes" or "different"; None for numbers and settings.
        """
        self._take(trial)
        self._not_felt = 0
        if trial.phase == "practice":
            self._practised += 1
            return
        self._counted[trial.condition] += 1
        self._repeats[trial.condition, trial.level] += 1
        if not trial.catch:
            level = rendered_level if rendered_level > 0.0 else trial.level
            self.procedures[trial.condition].update(level, bool(positive))

    def repeat(self, trial: ScheduledTrial) -> None:
        """Take in a trial that was not felt: it comes next again, whatever was answered.

        Parameters
        ----------
        trial : ScheduledTrial
            What `next` returned.
        """
        self._take(trial)
        self._not_felt += 1

    def check_felt(self) -> None:
        """Check, after a trial that was not felt, that it is worth presenting it again.

        Raises
        ------
        ArgumentError
            After each `MOST_NOT_FELT` in a row.
        """
        if self._not_felt and self._not_felt % MOST_NOT_FELT == 0:
            raise ArgumentError(
                f"{self._not_felt} trials in a row were not felt: no finger touches and moves, "
                "or the rig does not sense it. Look at it in `frictus watch`, and go on "
                "with the same log"
            )

    def _take(self, trial: ScheduledTrial) -> None:
        self._recorded += 1
        if trial.pause:
            self._rested_at = sum(self._counted.values())

    def refuse(self, trial: ScheduledTrial) -> None:
        """Take in a trial that the rig could not render whole.

        Parameters
        ----------
        trial : ScheduledTrial
            What `next` returned; its level and those above are not proposed again.

        Raises
        ------
        ArgumentError
            If no level is left, or levels are pairs, which none can stand in for.
        """
        self._take(trial)
        name = trial.condition
        stimulus = self._protocol.conditions[name]
        if isinstance(stimulus, Pairs):
            raise ArgumentError(
                f"the rig cannot render the pair {' and '.join(stimulus.names(trial.level))} "
                "whole: lower the gain of these textures, or set on_scaled to 'flag'"
            )
        self._limits[name] = min(trial.level, self._limits.get(name, trial.level))
        if not isinstance(task := self._protocol.task, Adjustment):
            self.procedures[name].exclude(self._limits[name])
        elif self._renderable(name) < task.low:
            raise ArgumentError(
                f"the rig cannot render the reference, or no level from {task.low:g} on: lower "
                "the gain of the standard, or the least level"
            )


def begun(protocol: Protocol, header: dict[str, Any], source: str = "log") -> Schedule:
    """Return the schedule of a log before its first trial.

    Parameters
    ----------
    protocol : Protocol
        The experiment; it must be the one of the log.
    header : dict
        First row of the log.
    source : str
        Name of the log, for messages.

    Raises
    ------
    ArgumentError
        If the header cannot be read, or the log is of another protocol.
    """
    try:
        held = Protocol.model_validate(header["protocol"])
        schedule = Schedule(held, int(header["seed"]), int(header["order_row"]))
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise ArgumentError(f"{source}: its header cannot be read: {error}") from error
    if held != protocol:
        changed = [
            name
            for name in type(protocol).model_fields
            if getattr(held, name) != getattr(protocol, name)
        ]
        raise ArgumentError(
            f"{source} was begun with another protocol ({', '.join(changed)} differ): go on "
            "with that one, or begin a new log"
        )
    return schedule


def resumed(protocol: Protocol, rows: list[dict[str, Any]], source: str = "log") -> Schedule:
    """Return a schedule that stands where the rows of a log end.

    Parameters
    ----------
    protocol : Protocol
        The experiment; it must be the one of the log.
    rows : list of dict
        Header and trials.
    source : str
        Name of the log, for messages.

    Raises
    ------
    ArgumentError
        If the log is of another protocol, or its trials are not those of this one.
    """
    schedule = begun(protocol, rows[0], source)
    for row in rows:
        if "trial" not in row:
            continue
        trial = schedule.next()
        same = trial is not None and all(
            row.get(name) == value
            for name, value in (
                ("trial", trial.number),
                ("phase", trial.phase),
                ("condition", trial.condition),
                ("catch", trial.catch),
                ("order", list(trial.order)),
            )
        )
        if trial is None or not same:
            raise ArgumentError(
                f"{source}, trial {row.get('trial')!r}: not the one that this version of the "
                "protocol presents; it cannot be gone on with"
            )
        if row.get("status") == "refused":
            schedule.refuse(trial)
            continue
        if row.get("status") == NOT_FELT:
            schedule.repeat(trial)
            continue
        level = row.get("level_rendered")
        if not (isinstance(level, int | float) and 0.0 <= level <= MAX_LEVEL):
            raise ArgumentError(
                f"{source}, trial {trial.number}: level_rendered is no level from 0 to "
                f"{MAX_LEVEL:g}"
            )
        schedule.record(trial, float(level), row.get("positive"))
    return schedule
