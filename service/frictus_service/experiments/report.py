"""What the log of an experiment says so far: its trials, thresholds and curves."""

from pathlib import Path
from typing import Any, Final

import numpy as np

from frictus.experiment import (
    ConditionResult,
    Estimate,
    Protocol,
    PsychometricFit,
    probability,
    read_log,
    results,
)
from frictus.experiment.events import event_rows
from frictus.experiment.psychometrics.psychometric import threshold_of
from frictus.lenient import Exact

CURVE_POINTS: Final = 60
BEYOND: Final = 2.0
"""Factor beyond levels presented and threshold, over which a curve is drawn."""


class IntervalEstimate(Exact):
    """A value and its 95 % interval."""

    value: float
    low: float
    high: float

    @classmethod
    def of(cls, found: Estimate | None) -> "IntervalEstimate | None":
        """Return an estimate as a page reads it.

        Parameters
        ----------
        found : Estimate or None
            The estimate.
        """
        return None if found is None else cls(value=found.value, low=found.low, high=found.high)


class LevelAnswers(Exact):
    """The answers at a level."""

    level: float
    trials: int
    positive: int


class ConditionReport(Exact):
    """What the trials of a condition say so far; what does not apply is null or empty."""

    condition: str
    trials: int
    unit: str
    lines: list[str]
    """All of it in words."""
    threshold: IntervalEstimate | None
    """By the posterior; of adjustments the setting."""
    points: list[LevelAnswers]
    curve: list[tuple[float, float]]
    """Levels and probabilities of the fit."""


class ExperimentReport(Exact):
    """What the log of an experiment says so far."""

    trials: list[dict[str, Any]]
    """Answered ones, the newest first, as the table of events has them."""
    left_out: int
    """Older ones, which are not listed."""
    conditions: list[ConditionReport]


def rows_of(log: Path) -> list[dict[str, Any]]:
    """Return the rows of a log; none where it is not begun.

    Parameters
    ----------
    log : Path
        The file.

    Raises
    ------
    ArgumentError
        If it is no log.
    """
    return read_log(log)[0] if log.is_file() else []


def report(protocol: Protocol, rows: list[dict[str, Any]], most: int) -> ExperimentReport:
    """Return what the log of an experiment says.

    Parameters
    ----------
    protocol : Protocol
        The experiment.
    rows : list of dict
        Of its log.
    most : int
        Trials that are listed, the newest ones; all of them count.

    Raises
    ------
    ArgumentError
        If a row lacks what a trial has.
    """
    answered = event_rows(rows)
    return ExperimentReport(
        trials=answered[: -most - 1 : -1],
        left_out=max(0, len(answered) - most),
        conditions=[_condition(found, rows) for found in results(protocol, rows)],
    )


def _condition(found: ConditionResult, rows: list[dict[str, Any]]) -> ConditionReport:
    counted = [
        (row["level_rendered"], row["positive"])
        for row in rows
        if row.get("phase") == "main"
        and row.get("status") == "answered"
        and row["condition"] == found.condition
        and row.get("positive") is not None
        and row["level_rendered"] > 0.0
    ]
    levels = sorted({level for level, _ in counted})
    points = [
        LevelAnswers(
            level=level,
            trials=sum(each == level for each, _ in counted),
            positive=sum(bool(yes) for each, yes in counted if each == level),
        )
        for level in levels
    ]
    fit = found.fit
    return ConditionReport(
        condition=found.condition,
        trials=found.trials,
        unit=found.unit,
        lines=result_lines(found)[1:],  # the first is the name
        threshold=IntervalEstimate.of(found.setting if fit is None else fit.threshold),
        points=points,
        curve=[] if fit is None else _curve(fit, [*levels, fit.threshold.value]),
    )


def _curve(fit: PsychometricFit, levels: list[float]) -> list[tuple[float, float]]:
    """Return levels around some with the probability that the fit gives them."""
    level = np.geomspace(min(levels) / BEYOND, max(levels) * BEYOND, CURVE_POINTS)
    scale = threshold_of(fit.threshold.value, fit.slope.value)
    p = probability(level, scale, fit.slope.value, fit.guess, fit.lapse)
    return [(float(x), float(y)) for x, y in zip(level, p, strict=True)]


def result_lines(result: ConditionResult) -> list[str]:
    """Return what to say of a condition.

    Parameters
    ----------
    result : ConditionResult
        Of its trials.
    """
    lines = [f"{result.condition}: {result.trials} trials"]
    if result.refused:
        lines.append(f"  {result.refused} not presented: the rig could not render them whole")
    if result.flagged:
        lines.append(
            f"  {result.flagged} with a flag, such as scaled or extrapolated: see the log"
        )
    if result.not_felt:
        lines.append(
            f"  {result.not_felt} not counted: the finger did not touch, or did not move"
        )
    if result.limited:
        lines.append(
            f"  {result.limited} set to the end of what can be set or rendered, more wanted: "
            "the mean is a bound, not the setting"
        )
    if result.catch_right is not None:
        lines.append(
            f"  catch trials: {result.catch_right[0]} of {result.catch_right[1]} right"
        )
    if (fit := result.fit) is not None:
        for name, value, unit in (
            ("threshold", fit.threshold, f" {result.unit}"),
            ("by likelihood", fit.threshold_ml, f" {result.unit}"),
            ("slope", fit.slope, ""),
        ):
            lines.append(
                f"  {name}: {value.value:.3g}{unit} (95 %: {value.low:.3g} to {value.high:.3g})"
            )
        lines.append(f"  lapses {100.0 * fit.lapse:.1f} %")
        if fit.open_ended:
            lines.append("  the trials do not bound the threshold: use other levels, or more")
    estimates = (("exponent", result.exponent, ""), ("setting", result.setting, result.unit))
    for name, found, unit in estimates:
        if found is not None:
            told = f"  {name}: {found.value:.3g} {unit}".rstrip()
            lines.append(f"{told} (95 %: {found.low:.3g} to {found.high:.3g})")
    if result.undetermined:
        lines.append(f"  {result.undetermined}")
    ratings = result.ratings or {}
    lines += [f"  {pair.replace('|', ' and ')}: {mean:.3g}" for pair, mean in ratings.items()]
    return lines
