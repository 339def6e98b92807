"""Lines of JSON of a campaign whose studies have numbers: what has a line is not made again."""

import json
import secrets
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

Line = dict[str, Any]


def read(path: Path) -> list[Line]:
    """Return the lines of a campaign; none where it has not begun."""
    if not path.exists():
        return []
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]


def go_on(
    path: Path, numbers: Sequence[int], run: Callable[[int, int], Line]
) -> Iterator[Line]:
    """Make and analyse what has no line yet; yield each line as it is written.

    Parameters
    ----------
    path : Path
        One line per study is added.
    numbers : sequence of int
    run : callable
        Returns the line of a number and a fresh seed.
    """
    done = {line["number"] for line in read(path)}
    for number in numbers:
        if number not in done:
            seed = secrets.randbits(31)
            try:
                line = run(number, seed)
            except Exception as error:
                error.add_note(f"study {number}, of seed {seed}")
                raise
            with path.open("a", encoding="utf-8") as file:
                file.write(json.dumps(line) + "\n")
            yield line
