"""Work for workers to do; imports little, so that they start soon."""

import os
import time
from pathlib import Path


def square(number: int) -> int:
    return number * number


def die_first(marker: Path) -> str:
    """Die as if killed, but the second time."""
    if marker.exists():
        return "done"
    marker.touch()
    os._exit(9)


def die_at_minus_one(number: int) -> int:
    if number < 0:
        os._exit(7)
    return number


def threads(_: int) -> str | None:
    return os.environ.get("OPENBLAS_NUM_THREADS")


def fail(number: int) -> int:
    raise KeyError(f"no {number}")


def work_forever(folder: Path) -> None:
    (folder / f"at-work-{os.getpid()}").touch()
    while True:
        time.sleep(0.01)
