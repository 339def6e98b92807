"""Write the table of a blind campaign: `python bench/blind.py --help`.

The campaign itself is `uv run pytest -n 0 -m blind`, or `python -m tests.blind.campaign`.
"""

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import Any, Final

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))  # so that a script finds the tests

from tests.blind.campaign import Task, case_of, read, tasks
from tests.blind.cases import REALISTIC
from tests.blind.generator import Seeds
from tests.blind.generator.people import Spread
from tests.blind.generator.study import draw_people
from tests.blind.judgement import Rate, rates

ROOT: Final = Path(__file__).parents[1]
SCORES: Final = ROOT / ".pytest_cache" / "d" / "blind" / "scores.jsonl"
OUT: Final = ROOT / "docs" / "blind.md"

INTRODUCTION: Final = """# Hidden effects

Made by `uv run python bench/blind.py` from the lines that `uv run pytest -n 0 -m blind` leaves.
A generator that shares no code with the analysis hides an effect in raw samples at 20 kHz;
twelve people of 60 trials each, 2 s a trial (ten studies: 10 s), seeds fresh and kept with each
line. People differ in gain (35 %), cutoff (15 %), its slope over speed (25 %), in the exponents
of speed and force in their gain (0.04), and in what is hidden in the finger (20 %); contact
changes the gain from trial to trial (10 %) and the cutoff between conditions (5 %); 3 % of the
trials are off by a factor of two, 2 % are half as fast again as asked. Realistic is twice the
smallest size that a prototype found. `lifelike`: 8 to 12 people whose turns are of minimum
jerk, with pauses, and whose gain wanders besides; touch reports are 40 ms late, tones each
person's own, and a fifth of the trials is missing. Their files do not say that the reports are
late, which had causes named that are not there in three of the first 30: a difference between
directions, beside a gain that changes along the stroke, and what depends on speed. The delay is
told by the nail (and, of later code, by friction), and taken off since: made again from their
seeds, all three are exactly the truth. 39 lines of `lifelike` are of fresh seeds and that code.
`faulty`: the same people on a rig with one fault that its file does not tell: touch positions
that are smoothed (50 ms), stamped up to 16 ms late by chance, of a clock that starts up to
20 ms apart in each trial, lacking (15 %, and gaps) or in whole millimetres; forces with 5 % of
each axis in the others, offsets that wander (0.02 and 0.05 N in a trial) or steps of 0.02 N.
Half hide a cause.

People have exponents of speed and force of their own in their gain, zero on the average of all
people, not of the twelve that are drawn. Where such a cause is named that nobody hid, the last
table says what these people have of it.

Lines are of the code of their day. `skin` (mobility; a mode of 150 to 700 Hz), `early`, `noise`
(driven by noise in place of tones) and the two studies of which an analysis had ended in an
error are of later code than the rest, of which 16 that were drawn by chance gave the same
verdict and names when they were made again, and of 18 more by later code still 17; the other
had a false cause confirmed, of which the family alone is named now. Those of `unknown` that
have a count in its row of forms were made again from their seeds later still: a form that
characterises what no catalogue has leaves nothing to flag or to locate. So were the first
three of each of `other_form`, by code to which a part of them had shown a fault (drifts that
level off were confirmed): 30 of 33 have their family named (28 before), and a false cause is
confirmed in two (four). The others of that kind are of fresh seeds and of that code.
"""


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table in markdown."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def of_rate(rate: Rate) -> list[str]:
    """Return the row of a rate."""
    low, high = rate.interval
    asked = "" if rate.least is None else f"at least {100 * rate.least:.0f} %"
    if rate.most is not None:
        most = f"at most {100 * rate.most:.0f} %"
        asked = f"{asked}, {most}" if asked else most
    if rate.chance:
        asked += ", not refuted at 5 %"
    measured = (
        f"{100 * rate.share:.1f} % [{100 * low:.0f}, {100 * high:.0f}]" if rate.of else "-"
    )
    kept = "" if not asked else "yes" if rate.kept else "**no**"
    return [rate.what, f"{rate.hits} of {rate.of}", measured, asked, kept]


def estimates(lines: Sequence[Mapping[str, Any]]) -> list[list[str]]:
    """Return a row per cause: how far its size was off, and which others were named."""
    rows = []
    for name in REALISTIC:
        own = [x for x in lines if x["task"]["kind"] == "single" and x["task"]["which"] == name]
        found = [x["score"]["estimates"].get(name) for x in own]
        ratios = [value[1] / value[0] for value in found if value is not None]
        held = [x["score"]["covered"][name] for x in own if name in x["score"]["covered"]]
        others = sorted({other for x in own for other in x["score"]["false"]})
        parameter, size = next(iter(REALISTIC[name].items()))
        rows.append(
            [
                name,
                f"{parameter} {size:g}",
                f"{median(ratios):.2f}" if ratios else "-",
                f"{sum(held)} of {len(held)}",
                ", ".join(others),
            ]
        )
    return rows


def fresh(lines: Sequence[Mapping[str, Any]]) -> list[list[str]]:
    """Return a row per cause: misfit of base and extended model on further data."""
    rows = []
    for name in REALISTIC:
        own = [x["fresh"] for x in lines if "fresh" in x and x["task"]["which"] == name]
        if own:
            base, extended = (median(x[model] for x in own) for model in ("base", "extended"))
            rows.append([name, str(len(own)), f"{base:.2f}", f"{extended:.2f}"])
    return rows


OWN_EXPONENTS: Final = {
    "speed_dependent_gain": "speed_exponent",
    "force_dependent_gain": "force_exponent",
}


def of_these_people(line: Mapping[str, Any], cause: str) -> str:
    """Return what the people of a study have of a cause that nobody hid, drawn about zero."""
    if cause not in OWN_EXPONENTS:
        return ""
    given = line["task"] | {"fresh": False, "by_command": False}
    case, seed = case_of(Task(**given), line["seed"]), line["seed"]
    _, people = draw_people(case, Seeds(seed, seed + 1), Spread())
    own = np.array([getattr(person, OWN_EXPONENTS[cause]) for person in people])
    ratio = own.mean() / (own.std(ddof=1) / np.sqrt(own.size))
    return f", of these people {own.mean():.3f}, {abs(ratio):.1f} standard errors"


def wrong(lines: Sequence[Mapping[str, Any]]) -> list[list[str]]:
    """Return a row per study that was not what it should be: enough to make it again."""
    rows = []
    for line in lines:
        if "error" in line:
            rows.append([line["name"], str(line["seed"]), line["error"]])
            continue
        score = line["score"]
        missed = [name for name, how in score["found"].items() if not how]
        said = [f"missed {name}" for name in missed]
        said += [
            f"named {name} ({how}{of_these_people(line, name)})"
            for name, how in score["false"].items()
        ]
        said += [f"could not tell {' from '.join(pair)}" for pair in score["false_pairs"]]
        if score["located"] is False:
            said.append("not located")
        if said and line["task"]["kind"] != "below":
            rows.append([line["name"], str(line["seed"]), "; ".join(said)])
    return rows


def document(lines: Sequence[Mapping[str, Any]]) -> str:
    """Return the whole document."""
    scored = [line for line in lines if "score" in line]
    usual = [line for line in scored if line["task"]["seconds"] == 2.0]
    text = f"{INTRODUCTION}\n{len(lines)} of {len(tasks())} studies; "
    text += f"median {median(line['making_s'] for line in usual):.0f} s to make one and "
    text += f"{median(line['analysis_s'] for line in usual):.0f} s to analyse it, "
    text += "in one of two processes that ran at once.\n\n## What was measured\n\n"
    text += table(
        ["", "count", "share, 95 %", "asked", "kept"], list(map(of_rate, rates(lines)))
    )
    text += "\n\n## Sizes of single causes\n\n"
    header = ["cause", "realistic size", "estimate / truth, median", "in 95 %", "named besides"]
    text += table(header, estimates(scored))
    text += "\n\n## Fresh data of the same people\n\nMean squared misfit, in standard errors; "
    text += "own gain and cutoff fitted in both.\n\n"
    text += table(["cause", "studies", "base model", "extended model"], fresh(scored))
    text += "\n\n## Studies with an error\n\n"
    return text + table(["study", "seed", "what"], wrong(lines)) + "\n"


def main() -> None:
    """Write the document."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scores", type=Path, default=SCORES, help="lines of a campaign")
    parser.add_argument("--out", type=Path, default=OUT)
    arguments = parser.parse_args()
    lines = read(arguments.scores)
    if not lines:
        raise SystemExit(
            f"{arguments.scores} has no lines; run `uv run pytest -n 0 -m blind` first"
        )
    arguments.out.write_text(document(lines), encoding="utf-8")


if __name__ == "__main__":
    main()
