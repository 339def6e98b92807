"""Compiled code, its indices checked, over all numbers: `python -m tests.campaigns.compiled`.

Each batch draws anew, by a seed of its own, for every property of compiled code in the tests.
"""

import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Final

from tests.campaigns.lines import Line, asked, go_on

ROOT: Final = Path(__file__).parents[2]
TOLD: Final = 40
"""Lines of a failed run that are kept."""
_TEST = re.compile(r"^(tests/\S+?)::(\w+)\S*:$")
_EXAMPLES = re.compile(r"(\d+) passing, \d+ failing")


def run(cache: Path, seed: int) -> Line:
    """Return the line of a batch.

    Parameters
    ----------
    cache : Path
        Of code that is compiled with its indices checked.
    seed : int
    """
    began_s = time.monotonic()
    options = ["-q", "-n", "0", "-m", "compiled and hypothesis", "-p", "no:cacheprovider"]
    options += ["--timeout=0"]
    options += ["--hypothesis-profile=campaign", "--hypothesis-show-statistics"]
    options += ["--tb=short", f"--hypothesis-seed={seed}"]
    done = subprocess.run(
        [sys.executable, "-m", "pytest", *options, "tests/hardware", "tests/service"],
        cwd=ROOT,
        env=os.environ | {"NUMBA_BOUNDSCHECK": "1", "NUMBA_CACHE_DIR": str(cache)},
        capture_output=True,
        text=True,
        check=False,
    )
    lines = done.stdout.splitlines()
    told = [line for line in lines if line.startswith(("E ", "FAILED", "Failing test case"))]
    failures = [{"what": "\n".join(told[:TOLD])}] if done.returncode else []
    return {
        "examples": examples_in(lines),
        "seconds": round(time.monotonic() - began_s, 1),
        "failures": failures,
    }


def examples_in(lines: list[str]) -> dict[str, int]:
    """Return how many examples passed of each property, by hypothesis's statistics."""
    found: dict[str, int] = {}
    name = ""
    for line in lines:
        if test := _TEST.match(line):
            name = f"{test[1]}::{test[2]}"
        elif counted := _EXAMPLES.search(line):
            found[name] = found.get(name, 0) + int(counted[1])
    return found


def names(batches: int) -> list[str]:
    """Return the names of all batches."""
    return [f"compiled/{number}" for number in range(batches)]


def main() -> None:
    """Run the campaign, or a part of it."""
    wanted = asked(__doc__, "batches", 20, "how many", names)
    with tempfile.TemporaryDirectory() as cache:
        for line in go_on(*wanted, lambda _name, seed: run(Path(cache), seed)):
            told = sum(line["examples"].values())
            print(line["name"], line["seed"], told, *line["failures"], flush=True)  # noqa: T201


if __name__ == "__main__":
    main()
