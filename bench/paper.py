"""Simulate the paper's study, analyse it blind, write tables: `python bench/paper.py --help`.

Seeds are fresh each time and written into the document.
"""

import argparse
import os
import secrets
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from frictus_hardware.simulated.config import WithinPersonScatter
from frictus_laboratory.reproduction import paper
from frictus_laboratory.reproduction.coverage import (
    PEOPLE,
    SMALL,
    CoverageCount,
    pooled_coverage,
    run_studies,
    summary,
    tally,
)
from frictus_laboratory.reproduction.paper import markdown
from frictus_laboratory.reproduction.plan import StudyConditions
from frictus_laboratory.reproduction.population import (
    NULL_FORCE_SD,
    NULL_SPEED_SD,
    SLOPE_SD,
    spread_of,
)
from frictus_laboratory.reproduction.reproduce import (
    BAD_SHARE,
    DELAY_S,
    FULL,
    FULL_PARTICIPANTS,
    QUICK,
    QUICK_PARTICIPANTS,
    reproduce,
)

UNITS = {"gain": "N/V", "cutoff": "Hz", "mass": "kg", "damping": "N s/m", "stiffness": "N/m"}
SCATTER = WithinPersonScatter()

INTRODUCTION = """# The paper, reproduced

Made by `uv run python bench/paper.py {command}`; the table alone comes from `frictus paper`
(with `--full`: the paper's size). People are drawn with the paper's values and its spread,
every trial is simulated as raw 20 kHz samples and written to a study file, and the pipeline
sees that file alone.

{design}

"""

COLUMNS = """
*Drawn* is the truth: the mean of the people who were drawn. They are shifted so that it is the
paper's value, as the paper's values are the means of ten people themselves. Effects are those
at the middle of the other factor's range. The verdicts are ours (t across participants) and the
paper's (mixed model with a random intercept alone). A true null is significant in 1 of 20
tests, and the table holds 12. The twin, in steps of 12.5 µs, is itself 0.1 µs late.
"""

PEOPLE_TEXT = f"""
## The people

The paper gives no standard deviations, but -2 log-likelihoods with and without a random
intercept, and from these follow both:

{{spread}}
- Between people the middle value (60 mm/s, 0.4 N) has this spread: normal, the gain lognormal,
  cut at two standard deviations and scaled back. Slopes differ too, by {SLOPE_SD:.0%} of the
  slope, more in whom has more; where the mean slope is zero, single people still lean by
  {NULL_SPEED_SD:.1%} of the value per mm/s and {NULL_FORCE_SD:.0%} per N. The paper fitted no
  random slopes: these are assumed.
- Within a person the paper's residual also holds the errors of its estimator (nearest bin of
  the transform, one sideband, magnitudes alone). Taken as true: {SCATTER.gain_per_trial:.0%} of
  the gain from trial to trial, {SCATTER.cutoff_per_condition:.0%} of the cutoff and
  {SCATTER.skin_per_condition:.0%} of mass, damping and stiffness from condition to condition.
- Mass and stiffness at 20 mm/s follow from "0.82 %" and "1.11 % per mm/s of the value at the
  lowest speed": {1000 * paper.MASS_20_KG:.3g} g and {paper.STIFFNESS_20_N_M:.4g} N/m, which
  makes 444 N/m at 40 mm/s, the paper's example (its example's mass, 1.5 g, does not fit its own
  slope). The damping is the example's. The text gives the mass slope as 3.5e-5 and as 3.23e-5
  kg per mm/s; drawn is the first.

Fingers miss their targets (2.5 % in the mean, speed wanders by 5 %, force by 6 % between 0.1
and 2 Hz), turn round in 50 ms, rub with noise of 5 % of the friction below 100 Hz; the mount is
there, sensors have noise and steps, positions come at 60 Hz in steps of 0.1 mm,
{1e6 * DELAY_S:.0f} µs of delay of the drive are declared nowhere, and {BAD_SHARE:.0%} of the
trials are bad: too fast, too hard, finger lifted, or sensor clipped. The cutoff follows the
speed beyond 20 to 100 mm/s too, where fingers go half of the time at the outer targets.

## Not reproduced

The paper's table of percentage contributions divides F statistics as if they were slopes (its
rows for the cutoff add up to 106 %), so there is nothing in it that data could confirm. Its
2.47 % per mm/s of the cutoff imply 559 Hz at 20 mm/s where its own equation gives 662 Hz. Its
correlation of cutoff and stiffness takes 250 conditions of ten people for 250 people; both
follow the speed, and so they correlate without acting on each other.
"""

COVERAGE = f"""
## Coverage

{{studies}} studies of {PEOPLE} freely drawn people, seed {{seed}}: {len(SMALL.tones_hz)}
tones, {len(SMALL.speeds_mm_s)} speeds, {len(SMALL.forces_n)} forces, trials of
{SMALL.seconds:g} s, from raw samples on. The truth is the population's. {{summary}}; people's
own intervals hold their own truth in {{own:.1%}}.

{{table}}
The delay is left out: it is the rig's and one value for all people, comes out to 0.05 µs, and
the twin itself, in steps of 12.5 µs, is 0.1 µs late. `uv run pytest -n 0 -m campaign
tests/laboratory/reproduction/test_coverage.py` asserts what is asked of these figures.
"""


def described(design: StudyConditions, participants: int) -> str:
    """Return one sentence on a design."""
    trials = len(design.tones_hz) * len(design.speeds_mm_s) * len(design.forces_n)
    return (
        f"{participants} participants, each {trials} trials of {design.seconds:g} s: "
        f"{len(design.tones_hz)} tones from 30 Hz to\n2 kHz, {len(design.speeds_mm_s)} speeds, "
        f"{len(design.forces_n)} forces, in random order."
    )


def spread_table() -> str:
    """Return the spread behind the paper's likelihoods."""
    lines = ["| parameter | unit | between people | residual |", "|---|---|---|---|"]
    for name, found in paper.LIKELIHOODS.items():
        spread = spread_of(found)
        lines.append(
            f"| {name} | {UNITS[name]} | {spread.between:.3g} | {spread.residual:.3g} |"
        )
    return "\n".join(lines) + "\n"


def coverage_table(tallies: Sequence[CoverageCount]) -> str:
    """Return coverage, rejection and bias of each quantity."""
    lines = ["| quantity | held | significant | bias, SD |", "|---|---|---|---|"]
    for each in tallies:
        told = f"{each.rejected:.1%}" + (" of nulls" if each.null else "")
        rejected = told if each.tested else ""
        lines.append(
            f"| {each.quantity} | {each.coverage:.1%} | {rejected} | {each.bias:+.2f} |"
        )
    return "\n".join(lines) + "\n"


def tell(line: str) -> None:
    """Write a line of progress."""
    print(line, file=sys.stderr, flush=True)  # noqa: T201 - a script


def main() -> None:
    """Simulate, analyse and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--full", action="store_true", help="the paper's size: 10 GB of disk, meanwhile"
    )
    parser.add_argument("--studies", type=int, default=0, help="small studies, for coverage")
    parser.add_argument("--seed", type=int, default=None, help="fresh if not given")
    parser.add_argument("--out", type=Path, required=True, help="markdown file")
    arguments = parser.parse_args()
    seed = secrets.randbits(32) if arguments.seed is None else arguments.seed
    design, people = (
        (FULL, FULL_PARTICIPANTS) if arguments.full else (QUICK, QUICK_PARTICIPANTS)
    )
    workers = os.cpu_count() or 1
    with tempfile.TemporaryDirectory() as folder:
        found = reproduce(Path(folder) / "study.h5", design, people, seed, workers, tell)
    command = " ".join(sys.argv[1:])
    text = INTRODUCTION.format(command=command, design=described(design, people))
    text += markdown(found.rows) + f"\n{found.account}. Seed {seed}.\n" + COLUMNS
    text += PEOPLE_TEXT.format(spread=spread_table())
    if arguments.studies:
        said = run_studies(seed, arguments.studies, workers, tell)
        tallies = tally(each.population for each in said)
        text += COVERAGE.format(
            studies=arguments.studies,
            seed=seed,
            summary=summary(tallies),
            own=pooled_coverage(tally(each.people for each in said)),
            table=coverage_table(tallies),
        )
    arguments.out.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
