"""How long `frictus serve` takes to the first block that a subscriber receives.

It is waited for by a subscriber that is there before, with the router in this process. The
first start finds neither compiled functions nor Python's bytecode, the others find both.
"""

import os
import re
import statistics
import subprocess
import sys
import tempfile
import threading
from pathlib import Path
from typing import IO, Final

import zenoh
from zenoh.handlers import Callback

from frictus.keys import Topics
from frictus.session import open_session
from frictus_laboratory.benchmarks.figure import Figure, Target
from frictus_laboratory.benchmarks.processes import config_of
from frictus_service.config import Config
from frictus_service.daemon.processes.child_process import PATIENCE_S, StartProgress
from frictus_service.errors import StartError
from frictus_service.security.router import open_secured_router

COLD_S: Final = 25.0
WARM_S: Final = 3.0
REPEATS: Final = 3
SERVE: Final = "from frictus_service.cli import main; main()"
_STEP: Final = re.compile(r"rig, [\d.]+ s: (?!compiling )(.*)")


class _Start:
    """A service that starts: what it says, when its rig's steps began, and its first block.

    Parameters
    ----------
    folder : Path
        To run in; holds the configuration.
    environment : dict
        Of the process that is started.
    """

    def __init__(self, folder: Path, environment: dict[str, str]) -> None:
        self._progress = StartProgress()
        self._moved = threading.Condition()
        self._said: list[str] = []
        self.steps_s: dict[str, float] = {}
        self.first_block_s: float | None = None
        self._process = subprocess.Popen(
            [sys.executable, "-c", SERVE, "serve"],
            stderr=subprocess.PIPE,
            text=True,
            env=environment,
            cwd=folder,
        )
        assert self._process.stderr is not None
        self._reader = threading.Thread(target=self._read, args=(self._process.stderr,))
        self._reader.start()

    def on_block(self, _sample: zenoh.Sample) -> None:
        """Take note of a block."""
        with self._moved:
            self.first_block_s = self.first_block_s or self._progress.move()
            self._moved.notify()

    def _read(self, lines: IO[str]) -> None:
        with lines:
            for line in lines:
                with self._moved:
                    after_s = self._progress.move()
                    self._said.append(line)
                    if step := step_of(line):
                        self.steps_s[step] = after_s
                    self._moved.notify()

    def await_block(self) -> float:
        """Return after how many seconds the first block came.

        Raises
        ------
        StartError
            If the service ends before, or nothing moves.
        """
        with self._moved:
            while self.first_block_s is None:
                left_s = self._progress.left_s(PATIENCE_S)
                if left_s <= 0.0 or self._process.poll() is not None:
                    break
                self._moved.wait(min(left_s, 1.0))
            else:
                return self.first_block_s
        self.close()  # until then it may have more to say
        raise StartError(f"`frictus serve` does not start: {''.join(self._said)}")

    def close(self) -> None:
        """End the service."""
        self._process.terminate()
        self._process.wait()
        self._reader.join()


def step_of(line: str) -> str | None:
    """Return the step of the rig's start that a line of the service tells of, if any."""
    told = _STEP.match(line)
    return told and told[1].partition(" (")[0]


def first_block_s(config: Config, folder: Path, kept: Path) -> tuple[float, dict[str, float]]:
    """Start the service; return when its first block came and when each step began, s.

    Parameters
    ----------
    config : Config
        Its router must be open.
    folder : Path
        To run in.
    kept : Path
        Where compiled functions and bytecode are kept.

    Raises
    ------
    StartError
        If it does not start.
    """
    text = (
        f'rig = "{config.rig}"\n[router]\nendpoint = "{config.router.endpoint}"\nhost = false\n'
        f"[api]\nport = {config.api.port}\n"
    )
    (folder / "frictus.toml").write_text(text, encoding="utf-8")
    environment = {n: v for n, v in os.environ.items() if n != "PYTHONDONTWRITEBYTECODE"}
    environment |= {
        "NUMBA_CACHE_DIR": str(kept / "compiled"),
        "PYTHONPYCACHEPREFIX": str(kept / "bytecode"),
    }
    start = _Start(folder, environment)
    try:
        with open_session(config.router.endpoint) as session:
            session.declare_subscriber(
                config.keys.of(Topics.FORCE), Callback(start.on_block, indirect=False)
            )
            return start.await_block(), start.steps_s
    finally:
        start.close()


def measure(repeats: int = REPEATS) -> list[Figure]:
    """Return the figures `start_cold` and `start_warm`.

    Parameters
    ----------
    repeats : int
        Of the warm start, whose median is given.
    """
    config = config_of()
    with tempfile.TemporaryDirectory() as place, open_secured_router(config):
        folder, kept = Path(place), Path(place) / "kept"

        def timed() -> dict[str, float]:
            block_s, steps_s = first_block_s(config, folder, kept)
            return steps_s | {"first block": block_s}

        cold = timed()
        warm = [timed() for _ in range(repeats)]
    median = {name: statistics.median(each[name] for each in warm) for name in warm[0]}
    return [
        _figure(
            "start_cold", cold, COLD_S, "with neither compiled functions nor bytecode kept"
        ),
        _figure("start_warm", median, WARM_S, f"both kept; medians of {repeats}"),
    ]


def _figure(name: str, values: dict[str, float], bound_s: float, how: str) -> Figure:
    return Figure(
        name,
        "s",
        values,
        target=Target("first block", "at most", bound_s),
        remark=f"from the call of `frictus serve` to each step of its rig's start, and to the "
        f"first block at a subscriber; {how}",
    )
