"""Many studies, one line of JSON each: `python -m tests.blind.campaign --help`.

A study that has a score in the file is not made again, so that a campaign goes on where it was
stopped; `python -m tests.blind.generator` makes the same study again from its seed.
"""

import argparse
import json
import multiprocessing
import os
import secrets
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from tests.blind.cases import KINDS, draw_case
from tests.blind.generator import Case, Seeds, make_study
from tests.blind.scoring import score

from frictus_service.discovery.problem.base_models import ResponseName

REPEATS: Final = {
    "null": 200,
    "single": 10,
    "below": 1,
    "pair": 40,
    "unknown": 10,
    "other_form": 5,
    "cannot_tell": 5,
    "paper": 4,
    "mount_moved": 3,
    "noise": 10,
    "skin": 20,
    "early": 10,
    "lifelike": 4,
    "faulty": 4,
}
"""Of each name of a kind."""

LONG_S: Final = 10.0
LONG: Final = {"null": (50, 100, 150), "single": (9,), "unknown": (9,)}
"""Numbers of the studies with long trials; of `single` and `unknown`, the first few names."""
LONG_NAMES: Final = {"null": 1, "single": 4, "unknown": 3}
THREE_TONES: Final = {"null": 6, "single": 5, "pair": 8}
"""Every so many-th study plays three tones at once."""


@dataclass(frozen=True, slots=True)
class Task:
    """One study of a campaign.

    Attributes
    ----------
    kind, which : str
    number : int
        Among those of the same kind and name.
    seconds : float
    tones_per_trial : int
    fresh : bool
        Whether the extended model is tried on further data of the same people.
    by_command : bool
        Whether it is analysed through the command line.
    """

    kind: str
    which: str
    number: int
    seconds: float = 2.0
    tones_per_trial: int = 1
    fresh: bool = False
    by_command: bool = False

    @property
    def name(self) -> str:
        """As it stands in the file."""
        return f"{self.kind}/{self.which}/{self.number}"


def tasks() -> list[Task]:
    """Return all studies of a campaign, kinds mixed, so that a part of it says something."""
    every = [
        (number / REPEATS[kind], _task(kind, which, place, number))
        for kind, (names, _) in KINDS.items()
        for place, which in enumerate(names)
        for number in range(REPEATS[kind])
    ]
    return [task for _, task in sorted(every, key=lambda each: each[0])]


def _task(kind: str, which: str, place: int, number: int) -> Task:
    is_long = number in LONG.get(kind, ()) and place < LONG_NAMES[kind]
    every = THREE_TONES.get(kind)
    three = every is not None and number % every == every - 1 and not is_long
    return Task(
        kind,
        which,
        number,
        seconds=LONG_S if is_long else 2.0,
        tones_per_trial=3 if three else 1,
        fresh=kind == "single" and number in (0, 1),
        by_command=kind == "null" and number in (0, 1),
    )


def case_of(task: Task, seed: int) -> Case:
    """Return the case of a task; the same for the same seed."""
    case = draw_case(task.kind, task.which, np.random.default_rng(seed), task.seconds)
    return replace(case, design=replace(case.design, tones_per_trial=task.tones_per_trial))


def run(task: Task, seed: int) -> dict[str, Any]:
    """Make a study, have it analysed, and return its line.

    Whatever goes wrong is in the line: the campaign goes on, and its judgement fails.
    """
    line: dict[str, Any] = {"name": task.name, "seed": seed, "task": asdict(task)}
    try:
        with tempfile.TemporaryDirectory() as folder:
            line |= _scored(task, seed, Path(folder))
    except Exception as error:
        line["error"] = f"{type(error).__name__}: {error}"
    return line


def _scored(task: Task, seed: int, folder: Path) -> dict[str, Any]:
    case = case_of(task, seed)
    began = time.perf_counter()
    path = folder / f"{secrets.token_hex(8)}.h5"
    told = make_study(path, case, Seeds(seed, seed + 1))
    made = time.perf_counter()
    base = "constant-cutoff" if task.kind == "paper" else "paper"
    response: ResponseName = "mobility" if task.kind == "skin" else "friction"
    report = _by_command(path, base) if task.by_command else analyse(path, base, response)
    analysed = time.perf_counter()
    path.unlink()
    line = {
        "case": asdict(case),
        "score": score(report, case, told["tones_hz"]).as_json(),
        "making_s": made - began,
        "analysis_s": analysed - made,
    }
    if task.fresh:
        line["fresh"] = _on_fresh_data(case, seed, report, folder)
    return line


def analyse(path: Path, base: str, response: ResponseName = "friction") -> dict[str, Any]:
    """Return the report of a study, analysed in this process.

    Parameters
    ----------
    path : Path
    base : str
        As `frictus discover --base` takes it.
    response : {'friction', 'mobility'}
    """
    from frictus_service.discovery.discover import discover_study

    found = discover_study(
        path,
        response=response,
        base=base,
        seed=secrets.randbits(31),
        cache=path.parent / "observations",
        workers=0,
    )
    report: dict[str, Any] = json.loads(found.to_json())
    return report


def _by_command(path: Path, base: str) -> dict[str, Any]:
    out = path.with_suffix("")
    asked = ["--out", str(out), "--response", "friction", "--base", base]
    main = "from frictus_service.cli import main; main()"
    command = [sys.executable, "-c", main, "discover", str(path), *asked]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise RuntimeError(f"frictus discover ended with {done.returncode}: {done.stderr}")
    report: dict[str, Any] = json.loads((out / "report.json").read_bytes())
    return report


def _on_fresh_data(
    case: Case, seed: int, report: dict[str, Any], folder: Path
) -> dict[str, float]:
    """Return how far base and extended model are off, on trials that neither has seen.

    Means over all conditions of the squared misfit in standard errors, each person's own gain
    and cutoff fitted: 1 where nothing is wrong.
    """
    path = folder / f"{secrets.token_hex(8)}.h5"
    make_study(path, case, Seeds(seed, seed + 2))
    model = folder / "extended.json"
    model.write_text(json.dumps(report["extended_model"]))
    base, extended = (analyse(path, before) for before in ("paper", str(model)))
    path.unlink()
    return {"base": misfit(base), "extended": misfit(extended)}


def misfit(report: dict[str, Any]) -> float:
    """Return how far a study is from the base model of its report; see `_on_fresh_data`."""
    of_response = [
        (each[f"before_{unit}"] / each[f"error_{unit}"]) ** 2
        for each in report["residuals"]
        for unit in ("db", "deg")
        if each[f"error_{unit}"] > 0.0
    ]
    of_levels = [
        ((each["measured"] - each["before"]) / each["standard_error"]) ** 2
        for each in report["levels"]
        if each["standard_error"] > 0.0
    ]
    return float(np.mean([*of_response, *of_levels]))


def read(path: Path) -> list[dict[str, Any]]:
    """Return the lines of a campaign, the last of each name; none where it has not begun."""
    if not path.exists():
        return []
    lines = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
    return list({line["name"]: line for line in lines}.values())


def go_on(path: Path, wanted: list[Task], workers: int = 2) -> Iterator[dict[str, Any]]:
    """Make and analyse what has no score yet; yield each line as it is written.

    Parameters
    ----------
    path : Path
        One line per study is added.
    wanted : list of Task
    workers : int
        Processes.
    """
    done = {line["name"] for line in read(path) if "score" in line}
    left = [task for task in wanted if task.name not in done]
    # Each process has a core of its own: libraries need no threads besides.
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    pool = ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn"))
    try:
        running = [pool.submit(run, task, secrets.randbits(31)) for task in left]
        for finished in as_completed(running):
            line = finished.result()
            with path.open("a", encoding="utf-8") as file:
                file.write(json.dumps(line) + "\n")
            yield line
    finally:
        pool.shutdown(cancel_futures=True)


def main() -> None:
    """Run a campaign, or a part of it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scores", type=Path, help="file of lines, which is added to")
    parser.add_argument("--only", help="names that begin so, as single/channel_delay")
    parser.add_argument("--first", type=int, help="not more than so many")
    parser.add_argument("--workers", type=int, default=2)
    arguments = parser.parse_args()
    wanted = [task for task in tasks() if task.name.startswith(arguments.only or "")]
    for line in go_on(arguments.scores, wanted[: arguments.first], arguments.workers):
        brief = line["score"] if "score" in line else line["error"]
        print(line["name"], line["seed"], json.dumps(brief), flush=True)  # noqa: T201


if __name__ == "__main__":
    main()
