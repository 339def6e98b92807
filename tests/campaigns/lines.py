"""Lines of JSON that a campaign leaves, one per batch, so that it goes on where it was stopped.

A batch that has a line without failures is not made again; one with failures is, with the seed
of its first time, until whatever it found is mended.
"""

import argparse
import json
import os
import platform
import secrets
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

Line = dict[str, Any]


def read(path: Path) -> list[Line]:
    """Return the lines of a campaign, the last of each name; none where it has not begun."""
    if not path.exists():
        return []
    lines = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
    return list({line["name"]: line for line in lines}.values())


def asked(
    doc: str | None, option: str, default: int, what: str, names: Callable[[int], list[str]]
) -> tuple[Path, list[str], int | None]:
    """Return what the command line of a campaign asks `go_on` for: file, batches and seed.

    Parameters
    ----------
    doc : str or None
        Of the campaign's module.
    option : str
        How many of what may be chosen, as `cases`.
    default : int
    what : str
        In words.
    names : callable
        Returns the names of all batches for so many.
    """
    parser = argparse.ArgumentParser(description=doc)
    parser.add_argument("results", type=Path, help="file of lines, which is added to")
    parser.add_argument(f"--{option}", type=int, default=default, help=f"{what} ({default})")
    parser.add_argument("--seed", type=int, help="of the first batch; drawn where not given")
    parser.add_argument("--only", default="", help="batches whose names begin so")
    given = parser.parse_args()
    wanted = [n for n in names(getattr(given, option)) if n.startswith(given.only)]
    return given.results, wanted, given.seed


def go_on(
    path: Path, names: list[str], seed: int | None, run: Callable[[str, int], Line]
) -> Iterator[Line]:
    """Run the batches that have no clean line yet; yield each line as it is written.

    Parameters
    ----------
    path : Path
        One line per batch is added.
    names : list of str
        Of all batches.
    seed : int or None
        Of the first batch, one more for each further one; None draws one for each.
    run : callable
        Makes the line of a batch from its name and its seed.
    """
    before = {line["name"]: line for line in read(path)}
    path.parent.mkdir(parents=True, exist_ok=True)
    for place, name in enumerate(names):
        former = before.get(name)
        if former is not None and not former["failures"]:
            continue
        drawn = secrets.randbits(31) if seed is None else seed + place
        of_batch = drawn if former is None else former["seed"]
        loaded = load()
        line = {"name": name, "seed": of_batch, **run(name, of_batch)}
        line["load"] = [loaded, load()]
        line["machine"] = f"{platform.system()}, {os.cpu_count()} cores"
        with path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(line) + "\n")
        yield line


def load() -> float | None:
    """Return how many processes wanted to run over the last minute; None on Windows."""
    return round(os.getloadavg()[0], 2) if hasattr(os, "getloadavg") else None


def run_all(path: Path, names: list[str], run: Callable[[str, int], Line]) -> list[str]:
    """Run what has no clean line yet; return what failed, in words, one entry a failure."""
    for _ in go_on(path, names, None, run):
        pass
    return [
        f"{line['name']} seed {line['seed']}: {failure['what']}"
        for line in read(path)
        if line["name"] in names
        for failure in line["failures"]
    ]
