"""What an experiment is: a document that a TOML file holds and every log begins with."""

import json
from pathlib import Path
from typing import Annotated, Final, Literal, Self

import numpy as np
from pydantic import Field, FiniteFloat, ValidationError, model_validator

from frictus.errors import ArgumentError, explain
from frictus.experiment.procedures.plans import (
    MAX_TRIALS,
    AnyProcedure,
    ConstantPlan,
    Plan,
    QuestPlusPlan,
    StaircasePlan,
)
from frictus.experiment.stimuli import Amplitude, Difference, Pairs, Stimulus
from frictus.experiment.tasks import Adjustment, Magnitude, SameDifferent, Task, guess_rate
from frictus.files import MAX_TOML_BYTES, read_bounded, read_toml
from frictus.lenient import NO_TRUTH, Exact
from frictus.names import Matching
from frictus.textures import Texture

MAX_CANDIDATES: Final = 200_000
MAX_TABLE: Final = 10_000_000
"""Levels times candidates of QUEST+ times conditions; of each, 32 bytes are held."""


class Presentation(Exact):
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


class Design(Exact):
    """The order of trials."""

    order: Literal["interleaved", "blocked"] = "interleaved"
    """Of several conditions; blocks follow each other by a Latin square over participants."""
    practice: Annotated[int, Field(ge=0, le=1_000)] = 0
    """Trials at the easiest level before the others, with feedback, not counted."""
    catch_every: Annotated[Literal[0] | Annotated[int, Field(ge=2, le=1_000)], NO_TRUTH] = 0
    """One catch trial in so many, at a random place; 0 for none. Of 1 no other would come."""
    break_every: Annotated[int, Field(ge=0, le=10_000)] = 0
    """Trials between breaks; 0 for none."""


_CONDITION: Final = Matching(
    r"^[A-Za-z0-9_.-]{1,50}$", "1 to 50 ASCII letters, digits, '_', '.' and '-' are accepted"
)


class Protocol(Exact):
    """An experiment as a document."""

    name: Annotated[
        str,
        Matching(r"^[A-Za-z0-9-]{1,60}$", "1 to 60 ASCII letters, digits and '-' are accepted"),
    ]
    description: Annotated[str, Field(max_length=2_000)] = ""
    task: Task
    procedure: Plan
    conditions: Annotated[
        dict[Annotated[str, _CONDITION], Stimulus],
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
    try:
        # By way of JSON, whose strict mode still takes whole numbers and arrays. Textures pass
        # over what they do not know; here that would be another stimulus.
        as_json = json.dumps(read_toml(toml.decode("utf-8-sig")), default=str)
        return Protocol.model_validate_json(as_json, strict=True, extra="forbid")
    except ValidationError as error:
        raise ArgumentError(f"{source}: {explain(error)}") from error
    except ValueError as error:  # integers of 4300 digits: no TOMLDecodeError
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
            named = repr(str(source))
            found = f"{named} is no file" if path.exists() else f"there is no file {named}"
            raise FileNotFoundError(f"{found}; ready protocols: {', '.join(ready)}")
        path = ready[str(source)]
    return parse_protocol(read_bounded(path, MAX_TOML_BYTES), path.name)
