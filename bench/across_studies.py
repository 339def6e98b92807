"""Measure discovery across studies beside one: `python bench/across_studies.py --help`.

Studies are made once, with the blind generator, and kept in a folder; each run reads all of
them anew. Writes time and peak memory of one study, of all with local workers, and of all with
a dask scheduler and workers in processes of their own.
"""

import argparse
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

import psutil

sys.path.insert(0, str(Path(__file__).parents[1]))  # so that a script finds the tests

from tests.blind.generator.case import Case, Design, Hidden
from tests.blind.generator.study import Seeds, make_study
from tests.service.discovery.across_studies.cluster import cluster

from frictus_service.discovery.across_studies.across import discover_across
from frictus_service.discovery.across_studies.document import AcrossStudies
from frictus_service.discovery.discover import discover_study
from frictus_service.discovery.report import page

PEOPLE = 10
TRIALS = {60: (5, 4, 3), 30: (5, 3, 2), 12: (3, 2, 2), 6: (3, 2, 1)}
"""Of each person: tones, speeds and forces of the design."""
DELAY_S = 20e-6
"""Of every third instrument; all have the same asymmetry, a finger's."""
EVERY_S = 0.1


@dataclass
class Peak:
    """Largest memory of any process, and of all together; MiB, and the seconds it took."""

    one: float = 0.0
    together: float = 0.0
    seconds: float = 0.0


@contextmanager
def measured() -> Iterator[Peak]:
    """Measure this process and its children."""
    found, ended = Peak(), threading.Event()

    def watch() -> None:
        while not ended.wait(EVERY_S):
            sizes = [size / 2**20 for size in resident()]
            found.one = max(found.one, *sizes)
            found.together = max(found.together, sum(sizes))

    watcher = threading.Thread(target=watch)
    watcher.start()
    began = time.perf_counter()
    try:
        yield found
    finally:
        found.seconds = time.perf_counter() - began
        ended.set()
        watcher.join()


def resident() -> list[int]:
    """Return the resident size of this process and of its children, bytes."""
    here = psutil.Process()
    sizes = []
    for process in [here, *here.children(recursive=True)]:
        try:
            sizes.append(process.memory_info().rss)
        except psutil.NoSuchProcess:
            continue
    return sizes


def make(place: Path, number: int, each: int) -> None:
    """Make one study, unless it is there."""
    if place.exists():
        return
    n_tones, n_speeds, n_forces = TRIALS[each]
    hidden = (
        Hidden("direction_asymmetry", {"share": 0.06}),
        Hidden("channel_delay", {"delay_s": DELAY_S * (number % 3 == 0)}),
    )
    design = Design(PEOPLE, n_tones, n_speeds, n_forces)
    make_study(place, Case("across", hidden, design), Seeds(1000 + number, 2000 + number))


def said(found: AcrossStudies) -> str:
    """Return the answer, and how many studies it rests on."""
    return f"{found.sentence} ({len(found.studies)} used, {len(found.left_out)} left out)"


def write(text: str) -> None:
    """Write a line, at once: a run takes minutes."""
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


def line(what: str, peak: Peak) -> None:
    """Write a row of the table."""
    write(f"| {what} | {peak.seconds:.0f} s | {peak.one:.0f} | {peak.together:.0f} |")


def main() -> None:
    """Make studies, and measure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--studies", type=int, default=20)
    parser.add_argument(
        "--trials", type=int, default=60, choices=TRIALS, help=f"of each of {PEOPLE} people"
    )
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--folder", type=Path, required=True, help="where studies are kept")
    asked = parser.parse_args()
    folder = asked.folder / f"{asked.trials}-each"
    folder.mkdir(parents=True, exist_ok=True)
    paths = [folder / f"laboratory{number:02}.h5" for number in range(asked.studies)]
    spawn = get_context("spawn")
    with ProcessPoolExecutor(asked.workers, spawn) as makers:
        each = [asked.trials] * len(paths)
        list(makers.map(make, paths, range(len(paths)), each))
    total = sum(path.stat().st_size for path in paths) / 2**20
    write(f"{asked.studies} studies of {PEOPLE * asked.trials} trials, {total:.0f} MiB\n")
    write("| | time | largest process, MiB | all processes, MiB |\n| --- | --- | --- | --- |")
    with tempfile.TemporaryDirectory() as scratch, measured() as peak:
        out = Path(scratch)
        page.write(discover_study(paths[0], workers=0, cache=out / "o", seed=1), out)
    line("one study, one process", peak)
    with tempfile.TemporaryDirectory() as scratch, measured() as peak:
        found = discover_across(paths, Path(scratch), workers=asked.workers, seed=1)
    line(f"{asked.studies} studies, {asked.workers} local workers", peak)
    with (
        cluster(asked.workers) as address,
        tempfile.TemporaryDirectory() as scratch,
        measured() as peak,
    ):
        again = discover_across(paths, Path(scratch), cluster=address, seed=1)
    line(f"{asked.studies} studies, dask scheduler and {asked.workers} workers", peak)
    write(f"\n{said(found)}")
    if found.causes != again.causes:
        raise SystemExit("the cluster found something else")


if __name__ == "__main__":
    main()
