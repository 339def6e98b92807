"""Gains predicted, and those of other people: `python -m tests.blind.fresh_gain --help`.

A study is discovered in; its gain in nats comes with the interval in which the gain of another
study lies. Then other people do the same design, with the same hidden, and the models of the
first study are scored on them as they are. Seeds are fresh, one line of JSON each. `--drawn`
draws people's coefficients instead of samples: many studies in a minute.
"""

import argparse
import json
import secrets
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from scipy import stats
from tests.blind.campaign import analyse
from tests.blind.cases import REALISTIC, draw_case
from tests.blind.generator import Case, Design, Seeds, make_study
from tests.blind.numbered_lines import go_on, read

DESIGN: Final = Design(participants=8, n_tones=3, n_speeds=2, n_forces=2, tones_per_trial=3)
"""Twelve trials each: small, so that there are many."""
LINES: Final = Path("fresh_gain.jsonl")
EVERY_PAIR: Final = 4
"""Every so many-th hides two causes."""


def case_of(number: int, seed: int) -> Case:
    """Return what a study of the campaign hides; the same for the same number and seed."""
    rng = np.random.default_rng(seed)
    names = sorted(REALISTIC)
    pair = number % EVERY_PAIR == EVERY_PAIR - 1
    case = draw_case("pair", "", rng) if pair else _single(names, number, rng)
    return Case(case.kind, case.hidden, DESIGN)


def _single(names: Sequence[str], number: int, rng: np.random.Generator) -> Case:
    at = (number - number // EVERY_PAIR) % len(names)
    return draw_case("single", names[at], rng)


def run(number: int, seed: int) -> dict[str, Any]:
    """Make a study, have it analysed, score its models on other people, return the line."""
    case = case_of(number, seed)
    line: dict[str, Any] = {
        "number": number,
        "seed": seed,
        "hidden": [each.name for each in case.hidden],
    }
    with tempfile.TemporaryDirectory() as folder:
        first, fresh = (Path(folder) / f"{secrets.token_hex(8)}.h5" for _ in range(2))
        make_study(first, case, Seeds(seed, seed + 1))
        report = analyse(first, "paper")
        gain = report["gain"]
        line |= {"named": [cause["id"] for cause in report["causes"]]}
        if gain is None:
            return line | {"predicted": None}
        make_study(fresh, case, Seeds(seed, seed + 2, others=seed + 3))
        return line | _scored(first, fresh, report)


def _scored(first: Path, fresh: Path, report: dict[str, Any]) -> dict[str, Any]:
    """Return the gain that a report predicts, and that of people whom it has not seen."""
    from frictus_service.discovery.inference.joint_gain import joint_gain
    from frictus_service.discovery.inference.linearisation import linearise
    from frictus_service.discovery.inference.predictive_density import UnitCoefficients

    problem = _problem_of(first)
    chosen = [
        k
        for cause in report["causes"]
        if cause["gain"] is not None
        for k, candidate in enumerate(problem.candidates)
        if candidate.effect == cause["id"]
        and all(cause["parameters"][name]["value"] == held for name, held in candidate.held)
    ]
    of_first, of_fresh = (
        linearise(each, chosen, chosen, ()).units for each in (problem, _problem_of(fresh))
    )
    places = range(len(chosen))
    nats = UnitCoefficients.of(of_first, places).of_fresh(UnitCoefficients.of(of_fresh, places))
    gain = report["gain"]
    return {
        "predicted": predicted(gain),
        "fresh": float(nats.mean() * len(of_first)),
        "units": [len(of_first), nats.size],
        "one_scatter": float(joint_gain(of_first, places).sum()),
        "residual_db": gain["residual_db"],
    }


def _problem_of(path: Path) -> Any:
    from frictus_service.discovery.evidence.evidence_rows import subjects_of
    from frictus_service.discovery.evidence.observation_table import (
        comparable,
        rows_of,
        units_of,
        used,
    )
    from frictus_service.discovery.evidence.trial_evidence import study_evidence
    from frictus_service.discovery.problem.base_models import base_model, simulator_of
    from frictus_service.discovery.problem.candidates import candidates_of
    from frictus_service.discovery.problem.problem import DiscoveryProblem
    from frictus_service.study.importers import open_study

    with open_study(path) as study:
        mount = study.info.mount
    base = base_model("paper", "friction")
    evidence = study_evidence(path, workers=0, cache=path.parent / "observations")
    trials = comparable(used(evidence), "friction")
    units = units_of(trials, "friction")
    rows = rows_of(trials, units, "friction")
    return DiscoveryProblem(
        simulator_of(base, mount),
        mount,
        "friction",
        tuple(subjects_of(rows, len(units.names))),
        tuple(candidates_of("friction")),
        (),
        base.validity.speed_mm_s,
    )


WITH_INTERVAL: Final = 3
"""Numbers of a prediction, both ends; where too few know of a cause there is the gain alone."""


def predicted(gain: dict[str, Any]) -> list[float]:
    """Return the gain that a report predicts, and the ends of its interval if it has one."""
    return [gain["heldout_loglik"], *(gain["ci95"] or ())]


def within(line: dict[str, Any]) -> bool:
    """Return whether the gain of other people lies in the interval that was predicted."""
    _, low, high = line["predicted"]
    return bool(low <= line["fresh"] <= high)


def table(lines: Sequence[dict[str, Any]]) -> str:
    """Return what a campaign measured as a table for the docs."""
    told = [line for line in lines if line["predicted"] is not None]
    n = len(told)
    if not n:
        return f"{len(lines)} studies, none of them with a gain."
    bounded = [line for line in told if len(line["predicted"]) == WITH_INTERVAL]
    kept, of = sum(map(within, bounded)), len(bounded)
    share = "-"
    if of:
        low, high = stats.binomtest(kept, of).proportion_ci(method="exact")
        share = f"{kept} of {of}, {100 * kept / of:.1f} % [{100 * low:.0f}, {100 * high:.0f}]"
    nats, once = (np.array([line[key] for line in told]) for key in ("fresh", "one_scatter"))
    predicted = np.array([line["predicted"][0] for line in told])
    rows = [
        "| | |",
        "|---|---|",
        f"| studies; of them with a gain; with its interval | {len(lines)}; {n}; {of} |",
        f"| gain of other people within the interval predicted | {share} |",
        f"| gain of other people above zero | {int((nats > 0.0).sum())} of {n} |",
        f"| predicted gain of 8 people, median (range) | {_spread(predicted)} nats |",
        f"| gain of 8 other people, median (range) | {_spread(nats)} nats |",
        f"| by one scatter for both models, median (range) | {_spread(once)} nats |",
    ]
    seeds = " ".join(f"{line['number']}:{line['seed']}" for line in lines)
    return "\n".join([*rows, "", f"Numbers and seeds: {seeds}"])


DRAWN: Final = (
    ("8 people, alike but for noise", 8, 20.0, 0.0, 1.0, 0.0, 1),
    ("8 people, alike but for noise that differs", 8, 20.0, 0.0, 1.0, 0.5, 1),
    ("8 people who differ", 8, 5.0, 1.0, 0.3, 0.5, 1),
    ("12 people who differ, a small effect", 12, 3.0, 1.0, 0.1, 0.5, 1),
    ("12 people who differ, three causes", 12, 5.0, 1.0, 0.1, 0.0, 3),
    ("6 people, alike but for noise that differs", 6, 20.0, 0.0, 1.0, 0.3, 1),
)
"""People; effect; scatter of people, of noise, of its logarithm between people; causes."""


def drawn_table(studies: int, rng: np.random.Generator) -> str:
    """Return how often the gain of other people, drawn, lies in its interval.

    Parameters
    ----------
    studies : int
        Of each kind in `DRAWN`.
    rng : numpy.random.Generator
    """
    rows, every = ["| coefficients drawn | within |", "|---|---|"], 0
    for what, n, mean, differing, noise, spread, k in DRAWN:
        kept = 0
        for _ in range(studies):
            first, fresh = (
                _people(n, mean, differing, noise, spread, k, rng) for _ in range(2)
            )
            low, high = first.interval_of_another(n, rng)
            kept += bool(low <= first.of_fresh(fresh).sum() <= high)
        every += kept
        rows.append(f"| {what} | {kept} of {studies} |")
    return "\n".join([*rows, f"| **all** | {every} of {studies * len(DRAWN)} |"])


def _people(
    n: int,
    mean: float,
    differing: float,
    noise: float,
    spread: float,
    k: int,
    rng: np.random.Generator,
) -> Any:
    from frictus_service.discovery.inference.predictive_density import UnitCoefficients

    own = noise * np.exp(spread * rng.standard_normal(n) - spread**2)
    value = mean + differing * rng.standard_normal((n, k))
    value += own[:, np.newaxis] * rng.standard_normal((n, k))
    return UnitCoefficients(value, np.square(own)[:, np.newaxis, np.newaxis] * np.eye(k))


def _spread(values: np.ndarray) -> str:
    return f"{np.median(values):.3g} ({values.min():.3g} to {values.max():.3g})"


def main() -> None:
    """Run the campaign, or go on with it; print a line each, then the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "lines", type=Path, nargs="?", help="file of lines, which is added to", default=LINES
    )
    parser.add_argument("--first", type=int, default=60, help="so many studies")
    parser.add_argument("--from", dest="begin", type=int, default=0, help="from this number on")
    parser.add_argument("--again", type=int, help="this seed's study, of number --from")
    parser.add_argument("--drawn", type=int, help="so many of each kind, coefficients drawn")
    arguments = parser.parse_args()
    if arguments.drawn is not None:
        seed = secrets.randbits(31)
        table_of = drawn_table(arguments.drawn, np.random.default_rng(seed))
        print(f"{table_of}\n\nSeed {seed}")  # noqa: T201
        return
    if arguments.again is not None:
        print(json.dumps(run(arguments.begin, arguments.again), indent=1))  # noqa: T201
        return
    for line in go_on(arguments.lines, range(arguments.begin, arguments.first), run):
        print(json.dumps(line), flush=True)  # noqa: T201
    print(table(read(arguments.lines)))  # noqa: T201


if __name__ == "__main__":
    main()
