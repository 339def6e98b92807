"""Cutoffs far from the truth by their own error: `python -m tests.campaigns.wrong_estimates`.

Each batch draws studies of one participant at the level of responses, by a seed of its own,
and counts the cutoffs of conditions that lie more than three of their standard errors from the
truth, and the 95 % intervals that hold it.
"""

import time
from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import numpy as np
from tests.campaigns.lines import Line, asked, go_on, read
from tests.service.identification.observed import Bench, Finger, observations

from frictus_service.identification.documents import Settings
from frictus_service.identification.fit.conditions import ObservationTable
from frictus_service.identification.fit.estimates import Measured, friction_of
from frictus_service.identification.fit.transfer_functions import CUTOFF
from frictus_service.identification.report.results import estimates_of

STUDIES: Final = 25
"""Of a batch."""
FIFTEEN: Final = Bench(speeds=(20.0, 60.0, 100.0), forces=(0.4,), seconds=1.5, noise=0.004)
BENCHES: Final[Mapping[str, Bench]] = {
    "15 tones to 2 kHz": FIFTEEN,
    "15 tones, noise x 0.1": replace(FIFTEEN, noise=0.0004),
    "15 tones, noise x 0.02": replace(FIFTEEN, noise=8e-5),
    "15 tones, noise x 5": replace(FIFTEEN, noise=0.02),
    "15 tones, gains x 3": replace(FIFTEEN, trial_gain=0.3, segment_gain=0.1),
    "5 tones to 1.5 kHz": replace(FIFTEEN, tones_hz=(40.0, 100.0, 250.0, 600.0, 1500.0)),
    "5 tones to 400 Hz": replace(FIFTEEN, tones_hz=(40.0, 80.0, 150.0, 250.0, 400.0)),
}


def run(name: str, seed: int) -> Line:
    """Return the line of a batch.

    Parameters
    ----------
    name : str
        A key of `BENCHES`, a slash and a number.
    seed : int
    """
    bench = BENCHES[name.split("/")[0]]
    counts = np.zeros(4, dtype=np.int64)
    seconds = 0.0
    worst: list[float] = []
    for study in range(STUDIES):
        rng = np.random.default_rng([seed, study])
        finger = _finger(rng)
        table = ObservationTable.of(observations([finger], bench, rng))
        measured = Measured.of(table)
        began = time.process_time()
        fitted = friction_of(table, measured, Settings())
        seconds += time.process_time() - began
        assert fitted is not None
        fit, groups = fitted.fit, fitted.selection.groups
        estimates = estimates_of(fit, fitted.selection.sample.people)
        for group, each, settled in zip(groups, estimates, fit.settled, strict=True):
            truth = finger.cutoff_0_hz + finger.slope * measured.speed_mm_s[group]
            found = each[CUTOFF]
            assert found.standard_error is not None
            assert found.ci95 is not None
            if settled:
                log_error = np.log(found.value / truth) * found.value / found.standard_error
                inside = found.ci95[0] <= truth <= found.ci95[1]
                counts += [1, abs(log_error) > 3.0, inside, 0]
                worst.append(abs(found.value / truth - 1.0))
            else:
                counts[3] += 1
    return {
        "cutoffs": int(counts[0]),
        "beyond": int(counts[1]),
        "covered": int(counts[2]),
        "unsettled": int(counts[3]),
        "median_error": float(np.median(worst)),
        "seconds": seconds,
        "failures": [],
    }


def _finger(rng: np.random.Generator) -> Finger:
    return Finger(
        gain_n=0.5 * float(np.exp(0.3 * rng.standard_normal())),
        cutoff_0_hz=float(rng.uniform(150.0, 600.0)),
        slope=float(rng.uniform(6.0, 20.0)),
        delay_s=1e-4,
    )


def names(batches: int) -> list[str]:
    """Return the names of all batches, benches mixed."""
    return [f"{bench}/{number}" for number in range(batches) for bench in BENCHES]


def table(lines: list[Line]) -> str:
    """Return the table of a campaign, a row per bench."""
    rows = [
        "| bench | cutoffs | median error | beyond 3 s.e. | 95 % intervals that hold | "
        "not settled | per fit |",
        "|---|---|---|---|---|---|---|",
    ]
    for bench in BENCHES:
        own = [line for line in lines if line["name"].split("/")[0] == bench]
        if own:
            total = {key: sum(line[key] for line in own) for key in COUNTED}
            error = float(np.median([line["median_error"] for line in own]))
            rows.append(
                f"| {bench} | {total['cutoffs']} | {error:.2%} | {total['beyond']} | "
                f"{total['covered'] / total['cutoffs']:.1%} | {total['unsettled']} | "
                f"{1e3 * total['seconds'] / (STUDIES * len(own)):.0f} ms |"
            )
    return "\n".join(rows)


COUNTED: Final = ("cutoffs", "beyond", "covered", "unsettled", "seconds")


def main() -> None:
    """Run the campaign, or a part of it, and print the table of all its lines."""
    wanted = asked(__doc__, "batches", 4, "of each bench", names)
    for line in go_on(*wanted, run):
        print(line["name"], line["seed"], line["beyond"], line["cutoffs"], flush=True)  # noqa: T201
    print(table(read(wanted[0])))  # noqa: T201


if __name__ == "__main__":
    main()
