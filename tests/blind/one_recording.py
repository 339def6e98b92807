"""Single recordings, one line of JSON each: `python -m tests.blind.one_recording --help`.

Swipes of two seconds and free explorations of two minutes, with something hidden in them or
nothing, and every tenth with a wrong sign or unit. Seeds are fresh; each stands in its line,
from which `--again SEED` makes the recording once more. What has a line is not made again.
"""

import argparse
import json
import secrets
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from tests.blind.generator.case import Hidden
from tests.blind.generator.recording import Recording, Slip, Source, make_recording
from tests.blind.numbered_lines import go_on, read

SWIPE_S, EXPLORATION_S = 2.0, 120.0
OF_SOURCE: Final[dict[Source, tuple[str, ...]]] = {
    "texture": ("channel_delay", "second_mode", "mount_resonance_shift", "none"),
    "drive": (
        "channel_delay",
        "mount_resonance_shift",
        "charge_leakage",
        "fractional_rolloff",
        "none",
    ),
}
SLIPS: Final[dict[Source, tuple[Slip, ...]]] = {
    "texture": ("force_sign", "skin_sign", "skin_mm_s", "force_mn"),
    "drive": ("force_sign", "skin_sign", "force_mn"),
}
EVERY_SLIPPED: Final = 10
EVERY_LONG: Final = 6
NULLS_FROM, LONG_FROM, SMALL_FROM, EARLY_FROM = 60, 100, 127, 154
"""From these numbers on: swipes that hide nothing; explorations; swipes with little hidden;
swipes with a channel that is early."""
SMALL: Final = 0.25
"""Of the size that others hide."""
PAIRS: Final = tuple((source, name) for source, names in OF_SOURCE.items() for name in names)


def hidden_of(name: str, rng: np.random.Generator, times: float = 1.0) -> Hidden | None:
    """Return what is hidden, at a size drawn anew."""
    sign = float(rng.choice([-1.0, 1.0]))
    size = float(np.exp(rng.uniform()))
    parameters = {
        "channel_delay": {"delay_s": times * 4e-5 * size**2},
        "mount_resonance_shift": {"share": sign * times * 0.012 * size},
        "charge_leakage": {"corner_hz": times * 4.0 * size},
        "fractional_rolloff": {"excess_order": sign * times * 0.1 * size},
        "second_mode": {
            "share": times * 0.12 * size,
            "frequency_hz": float(np.exp(rng.uniform(np.log(120.0), np.log(600.0)))),
            "quality": float(rng.uniform(4.0, 6.5)),
        },
    }
    return None if name == "none" else Hidden(name, parameters[name])


def recording_of(number: int, seed: int) -> tuple[Recording, str]:
    """Return the recording of a number in the campaign, and what it hides by name.

    Parameters
    ----------
    number : int
        Kinds and lengths alternate with it.
    seed : int
        Of everything that is drawn.
    """
    rng = np.random.default_rng(seed)
    if NULLS_FROM <= number < LONG_FROM:
        return Recording("drive" if number % 2 else "texture", SWIPE_S), "none"
    if number >= EARLY_FROM:
        early = hidden_of("channel_delay", rng, times=-1.0)
        return Recording("drive" if number % 2 else "texture", SWIPE_S, early), "channel_delay"
    source, name = PAIRS[number % len(PAIRS)]
    if number >= LONG_FROM:
        seconds = SWIPE_S if number >= SMALL_FROM else EXPLORATION_S
        times = SMALL if number >= SMALL_FROM else 1.0
        return Recording(source, seconds, hidden_of(name, rng, times)), name
    long = number // len(PAIRS) % EVERY_LONG == EVERY_LONG - 1
    slip: Slip = ""
    if number % EVERY_SLIPPED == EVERY_SLIPPED - 1:
        slip = SLIPS[source][int(rng.integers(len(SLIPS[source])))]
    seconds = EXPLORATION_S if long else SWIPE_S
    return Recording(source, seconds, hidden_of(name, rng), slip), name


def run(number: int, seed: int) -> dict[str, Any]:
    """Make a recording, have it analysed, and return its line."""
    from frictus_service.discovery.one_recording.analysis import rank_recording
    from frictus_service.discovery.problem.base_models import ResponseName, base_model

    recording, name = recording_of(number, seed)
    line: dict[str, Any] = {
        "number": number,
        "seed": seed,
        "source": recording.source,
        "seconds": recording.seconds,
        "hidden": name,
        "parameters": recording.hidden.parameters if recording.hidden else {},
        "slip": recording.slip,
    }
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{secrets.token_hex(8)}.h5"
        make_recording(path, recording, seed)
        if recording.slip:
            return line | {"named": _implausible(path)}
        response: ResponseName = "friction" if recording.source == "drive" else "mobility"
        began = time.perf_counter()
        found, notes = rank_recording(path, base_model("paper", response), lambda _: None)
    line["analysis_s"] = round(time.perf_counter() - began, 1)
    if found is None:
        return line | {"error": notes[-1]}
    first = found.models[0]
    return line | {
        "first": list(first.causes),
        "beyond": found.beyond_threshold,
        "margin": found.margin,
        "found": {
            cause: {parameter: [e.value, *(e.ci95 or ())] for parameter, e in each.items()}
            for cause, each in first.parameters.items()
        },
    }


def _implausible(path: Path) -> list[str]:
    """Return the codes of what stops a recording before any fit; or why it is not even read."""
    from frictus_service.discovery.evidence.trial_evidence import evidence_of
    from frictus_service.errors import TrialError
    from frictus_service.identification.plausibility.judge import judge_trial
    from frictus_service.study.importers import open_study

    with open_study(path) as study:
        (info,) = study.trials
        try:
            trial = study.read(info.id)
        except TrialError as error:
            return [str(error).partition(": ")[2] or str(error)]
        found = judge_trial(trial, study.info, evidence_of(trial, study.info).observed)
    return [each.code for each in found if each.severity == "stop"]


def right(line: dict[str, Any]) -> bool:
    """Return whether what was hidden ranks first, beyond the threshold; nothing for nothing."""
    if line["hidden"] == "none":
        return not line.get("beyond", False)
    return bool(line.get("beyond")) and line.get("first") == [line["hidden"]]


def covered(line: dict[str, Any]) -> bool | None:
    """Return whether the first parameter's interval holds the truth; None where not named."""
    if line["hidden"] == "none" or not right(line):
        return None
    name, truth = next(iter(line["parameters"].items()))
    _, low, high = line["found"][line["hidden"]][name]
    return bool(low <= truth <= high)


def rates(lines: Sequence[dict[str, Any]]) -> dict[str, tuple[int, int]]:
    """Return hits and of how many: causes, recordings that hide none, wrong signs and units."""
    whole = [line for line in lines if not line["slip"] and line["number"] < SMALL_FROM]
    hiding = [right(line) for line in whole if line["hidden"] != "none"]
    nulls = [right(line) for line in whole if line["hidden"] == "none"]
    stopped = [bool(line["named"]) for line in lines if line["slip"]]
    return {
        "cause": (sum(hiding), len(hiding)),
        "none": (sum(nulls), len(nulls)),
        "slip": (sum(stopped), len(stopped)),
    }


def table(lines: Sequence[dict[str, Any]]) -> str:
    """Return the rates of a campaign as a table for the docs."""
    whole = [line for line in lines if not line["slip"] and line["number"] < SMALL_FROM]
    rows = ["| recordings | right first | of them in the interval |", "|---|---|---|"]
    lengths = {SWIPE_S: "swipe, 2 s", EXPLORATION_S: "exploration, 2 min"}
    for seconds, length in lengths.items():
        for source, name in PAIRS:
            own = [
                line
                for line in whole
                if (line["seconds"], line["source"], line["hidden"]) == (seconds, source, name)
            ]
            if own:
                rows.append(_row(f"{length}, {source}: {name.replace('_', ' ')}", own))
    rows += [
        _row("**all with a cause**", [each for each in whole if each["hidden"] != "none"]),
        _row("**all without one**", [each for each in whole if each["hidden"] == "none"]),
    ]
    small = [each for each in lines if SMALL_FROM <= each["number"] < EARLY_FROM]
    little = [each for each in small if each["hidden"] != "none"]
    if little:
        rows.append(_row(f"swipes with a cause of {SMALL:g} of that size", little))
    early = [each for each in lines if each["number"] >= EARLY_FROM]
    if early:
        rows.append(_row("swipes with a channel that is early", early))
    stopped, of = rates(lines)["slip"]
    rows.append(f"| wrong sign or unit: refused before any fit | {stopped} of {of} | |")
    seeds = " ".join(f"{line['number']}:{line['seed']}" for line in lines)
    rows += ["", f"Numbers and seeds: {seeds}"]
    return "\n".join(rows)


def _row(what: str, lines: Sequence[dict[str, Any]]) -> str:
    held = [each for each in map(covered, lines) if each is not None]
    intervals = f"{sum(held)} of {len(held)}" if held else ""
    return f"| {what} | {sum(map(right, lines))} of {len(lines)} | {intervals} |"


def main() -> None:
    """Run the campaign, or go on with it; print a line each, then the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("lines", type=Path, help="file of lines, which is added to")
    parser.add_argument("--first", type=int, default=60, help="so many recordings")
    parser.add_argument("--from", dest="begin", type=int, default=0, help="from this number on")
    parser.add_argument("--again", type=int, help="this seed's recording, of number --from")
    arguments = parser.parse_args()
    if arguments.again is not None:
        print(json.dumps(run(arguments.begin, arguments.again), indent=1))  # noqa: T201
        return
    for line in go_on(arguments.lines, range(arguments.begin, arguments.first), run):
        good = bool(line["named"]) if line["slip"] else right(line)
        print(json.dumps(line), "right" if good else "WRONG", flush=True)  # noqa: T201
    print(table(read(arguments.lines)))  # noqa: T201


if __name__ == "__main__":
    main()
