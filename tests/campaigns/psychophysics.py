"""Do intervals of thresholds hold the truth? `python -m tests.campaigns.psychophysics --help`.

Simulated observers with thresholds, slopes and lapse rates of their own answer whole
experiments; the table counts how many intervals of 95 % hold what each observer really has.
No rig: what the rig renders is what was asked for.
"""

import argparse
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from tests.campaigns.reliability import table, with_section

from frictus import Component, Spectrum
from frictus.experiment import (
    Amplitude,
    ConstantPlan,
    Design,
    Estimate,
    LevelRange,
    Protocol,
    QuestPlusPlan,
    SameDifferent,
    ScheduledTrial,
    SimulatedObserver,
    StaircasePlan,
    TwoAlternatives,
    YesNo,
    load_protocol,
    probability,
    results,
)
from frictus.experiment.procedures.schedule import Schedule
from frictus.experiment.psychometrics.psychometric import threshold_of
from frictus.experiment.psychometrics.results import geometric_mean, power_law_exponent
from frictus.experiment.tasks import is_positive

OUT: Final = Path(__file__).parents[2] / "docs" / "experiment.md"
HEADING: Final = "Do the intervals hold?"
RIDGES: Final = Amplitude(
    texture=Spectrum(components=[Component(amplitude_n=1.0, cycles_per_mm=0.5)])
)
TASKS: Final = {
    "2afc": TwoAlternatives(),
    "yes-no": YesNo(),
    "same-different": SameDifferent(),
}
PLANS: Final = {
    "2afc": (
        QuestPlusPlan(levels=LevelRange(low=0.002, high=0.2), trials=60),
        StaircasePlan(start=0.1, low=0.002, high=0.2, down=3, reversals=16),
        ConstantPlan(levels=[0.004, 0.0074, 0.014, 0.025, 0.047, 0.086, 0.16], repeats=15),
    ),
    "yes-no": (
        QuestPlusPlan(levels=LevelRange(low=0.002, high=0.2, count=21), trials=60),
        StaircasePlan(start=0.1, low=0.002, high=0.2, down=1, reversals=16),
        ConstantPlan(levels=[0.004, 0.0074, 0.014, 0.025, 0.047, 0.086, 0.16], repeats=15),
    ),
}
PLANS["same-different"] = PLANS["yes-no"]
CATCH: Final = {"2afc": 20, "yes-no": 4, "same-different": 2}
Answer = Callable[[ScheduledTrial], str]


def answered(protocol: Protocol, answer: Answer, seed: int) -> list[dict[str, Any]]:
    """Return the rows of an experiment without a rig, as far as results read them."""
    schedule = Schedule(protocol, seed)
    rows: list[dict[str, Any]] = []
    while (trial := schedule.next()) is not None:
        response = answer(trial)
        positive = is_positive(protocol.task, trial.order, response)
        level = trial.level if "test" in trial.order else 0.0
        schedule.record(trial, level, positive)
        rows.append(
            {
                "phase": trial.phase,
                "condition": trial.condition,
                "catch": trial.catch,
                "status": "answered",
                "flags": [],
                "level": trial.level,
                "level_rendered": level,
                "response": response,
                "correct": response == trial.correct,
                "positive": positive,
            }
        )
    return rows


def weibull(kind: str, rng: np.random.Generator) -> tuple[float, Answer]:
    """Return the half level of an observer drawn anew, and how it answers."""
    half = float(10.0 ** rng.uniform(-2.1, -1.2))
    slope = float(2.5 * 2.0 ** rng.normal(0.0, 1.0))
    guess = 0.5 if kind == "2afc" else float(rng.uniform(0.02, 0.25))
    lapse = float(rng.uniform(0.0, 0.05))
    threshold = float(threshold_of(half, slope))

    def answer(trial: ScheduledTrial) -> str:
        level = trial.level if "test" in trial.order else 0.0
        positive = rng.random() < probability(level, threshold, slope, guess, lapse)
        if kind == "2afc":
            right = str(trial.correct)
            return right if positive else {"1": "2", "2": "1"}[right]
        return {"yes-no": "ny", "same-different": "sd"}[kind][int(positive)]

    return half, answer


@dataclass(frozen=True, slots=True)
class Coverage:
    """How the intervals of one procedure fared.

    Attributes
    ----------
    procedure, task : str
    trials : float
        Median.
    held, held_ml : float
        Share of posterior or only intervals, and of likelihood intervals, that hold the truth.
    width : float
        Median ratio of the ends of the first interval.
    open_ended : float
        Share of experiments whose trials do not bound the threshold.
    """

    procedure: str
    task: str
    trials: float
    held: float
    held_ml: float | None
    width: float
    open_ended: float | None


def choices(kind: str, plan: Any, observers: int, seed: int) -> Coverage:
    """Return the coverage of one procedure in one task of choices."""
    protocol = Protocol(
        name="coverage",
        task=TASKS[kind],
        procedure=plan,
        conditions={"ridges": RIDGES},
        design=Design(catch_every=CATCH[kind]),
    )
    fits, truths = [], []
    for number in range(observers):
        rng = np.random.default_rng([seed, number])
        truth, answer = weibull(kind, rng)
        fit = results(protocol, answered(protocol, answer, int(rng.integers(2**31))))[0].fit
        assert fit is not None
        fits.append(fit)
        truths.append(truth)
    return _coverage(plan.kind, kind, fits, truths)


def _coverage(procedure: str, task: str, fits: list[Any], truths: list[float]) -> Coverage:
    both = list(zip(fits, truths, strict=True))
    return Coverage(
        procedure,
        task,
        float(np.median([fit.trials for fit in fits])),
        float(np.mean([fit.threshold.holds(truth) for fit, truth in both])),
        float(np.mean([fit.threshold_ml.holds(truth) for fit, truth in both])),
        float(np.median([fit.threshold.high / fit.threshold.low for fit in fits])),
        float(np.mean([fit.open_ended for fit in fits])),
    )


def literature(observers: int, seed: int) -> tuple[Coverage, float]:
    """Return the coverage of 1.21 dB by the ready protocol, and the median threshold, dB."""
    protocol = load_protocol("amplitude-difference")
    reference_n = 0.06 / np.sqrt(2.0)
    observer = SimulatedObserver(floor_n=1e-4)
    fits = []
    for number in range(observers):
        rng = np.random.default_rng([seed, number])

        def answer(trial: ScheduledTrial, rng: np.random.Generator = rng) -> str:
            raised_n = reference_n * 10.0 ** (trial.level / 20.0)
            felt_n = [raised_n if each == "test" else reference_n for each in trial.order]
            return observer.answer(protocol.task, felt_n, rng)

        fit = results(protocol, answered(protocol, answer, int(rng.integers(2**31))))[0].fit
        assert fit is not None
        fits.append(fit)
    name = "staircase (amplitude-difference.toml)"
    coverage = _coverage(name, "2afc", fits, [observer.jnd_db] * observers)
    return coverage, float(np.median([fit.threshold.value for fit in fits]))


def settings(observers: int, seed: int, count: int = 10) -> Coverage:
    """Return the coverage of the geometric mean of levels set by adjustment."""
    found: list[tuple[Estimate, float]] = []
    for number in range(observers):
        rng = np.random.default_rng([seed, number])
        equal, scatter = rng.uniform(-2.0, -1.0), rng.uniform(0.02, 0.15)
        levels = 10.0 ** rng.normal(equal, scatter, count)
        found.append((geometric_mean(levels), float(10.0**equal)))
    return _estimated("settings", "adjustment", count, found)


def exponents(observers: int, seed: int, count: int = 40) -> Coverage:
    """Return the coverage of the exponent of magnitudes."""
    found: list[tuple[Estimate, float]] = []
    levels = np.repeat(np.geomspace(0.01, 0.1, 8), count // 8)
    for number in range(observers):
        rng = np.random.default_rng([seed, number])
        exponent, scatter = rng.uniform(0.3, 1.2), rng.uniform(0.05, 0.3)
        numbers = 10.0 ** (exponent * np.log10(levels) + rng.normal(2.0, scatter, levels.size))
        numbers *= 10.0 ** rng.normal(0.0, 0.5)
        found.append((power_law_exponent(levels, numbers), float(exponent)))
    return _estimated("constant", "magnitude", count, found)


def _estimated(
    procedure: str, task: str, trials: int, found: list[tuple[Estimate, float]]
) -> Coverage:
    held = float(np.mean([estimate.holds(truth) for estimate, truth in found]))
    ratios = [estimate.high / estimate.low for estimate, _ in found if estimate.low > 0.0]
    return Coverage(procedure, task, trials, held, None, float(np.median(ratios)), None)


def campaign(observers: int, seed: int) -> Iterator[Coverage]:
    """Return the coverage of every procedure, one after the other."""
    for kind, plans in PLANS.items():
        for plan in plans:
            yield choices(kind, plan, observers, seed)
    yield settings(observers, seed)
    yield exponents(observers, seed)


def section(
    lines: list[Coverage], jnd_db: float, observers: int, seed: int, seconds: float
) -> str:
    """Return the section of the document."""

    def share(value: float | None) -> str:
        return "" if value is None else f"{value:.3f}"

    rows = [
        [
            line.procedure,
            line.task,
            f"{line.trials:.0f}",
            share(line.held),
            share(line.held_ml),
            f"{line.width:.2f}",
            share(line.open_ended),
        ]
        for line in lines
    ]
    head = [
        "procedure",
        "task",
        "trials",
        "interval holds",
        "by likelihood",
        "its width (ratio)",
        "not bounded",
    ]
    return (
        f"Share of {observers} simulated observers whose interval of 95 % holds their own "
        "threshold (adjustment: point of equality; magnitude: exponent). Thresholds, slopes, "
        "guess and lapse rates are drawn for each; trials and widths are medians. The last "
        "line is the ready protocol with observers whose difference threshold is the 1.21 dB "
        f"of the literature: their median threshold came back as {jnd_db:.2f} dB.\n\n"
        f"{table(head, rows)}\n\n"
        f"Made in {seconds:.0f} s by `uv run python -m tests.campaigns.psychophysics "
        f"--observers {observers} --seed {seed}`."
    )


def main() -> None:
    """Write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--observers", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    begun_s = time.monotonic()
    lines = []
    for line in campaign(given.observers, given.seed):
        print(line, flush=True)  # noqa: T201
        lines.append(line)
    jnd, jnd_db = literature(given.observers, given.seed)
    lines.append(jnd)
    print(jnd, jnd_db)  # noqa: T201
    seconds = time.monotonic() - begun_s
    body = section(lines, jnd_db, given.observers, given.seed, seconds)
    text = with_section(OUT.read_text(encoding="utf-8"), HEADING, body)
    OUT.write_text(text, encoding="utf-8", newline="\n")


if __name__ == "__main__":
    main()
