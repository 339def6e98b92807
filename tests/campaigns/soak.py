"""A service under its full load for long: `python -m tests.campaigns.soak --help`.

20 kHz, subscribers that read everything, viewers of the dashboard, a texture streamed at 5 Hz,
recordings begun and ended; quiet, or beside processes that keep cores busy. What each window
lost tells what is shed first.
"""

import argparse
import contextlib
import math
import multiprocessing
import tempfile
import threading
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import psutil
from numpy.typing import NDArray
from tests.campaigns.lines import Line, go_on
from tests.campaigns.owner import UPDATE_S, own
from tests.campaigns.service import Said, config_in, serving

import frictus
from frictus.errors import FrictusError
from frictus_hardware import SimulatedConfig
from frictus_hardware.simulated.strokes import SteadyStrokes
from frictus_laboratory.benchmarks.load import Tally, subscribe
from frictus_laboratory.benchmarks.processes import RIG, Neighbour, Pipe, neighbour
from frictus_laboratory.benchmarks.viewers import STREAMS, view
from frictus_service.config import Config
from frictus_service.daemon.processes.supervisor import ALL, Supervisor

PROCESSES: Final = 4
LEASE_MS: Final = 5_000
LARGEST_LOSS: Final = 1e-4
LARGEST_P99_MS: Final = 1.0
COUNTERS: Final = ("deadline_misses", "underruns", "blocks_dropped", "stream_updates", "trips")


@dataclass(frozen=True, slots=True)
class Window:
    """What came of one window of a soak.

    Attributes
    ----------
    end_s : float
        Since the soak began.
    received, lost : int
        Blocks, of all subscribers.
    frames_hz : float
        Of each stream to each viewer; `RATE_HZ` is asked for.
    recorder_lost : int
        Blocks that a recording misses.
    lateness_p99_ms : float
        Of the rig's loop, at the end of the window.
    counted : dict
        Growth of the rig's counters.
    memory_mb, descriptors : dict
        Of each process.
    """

    end_s: float
    received: int
    lost: int
    frames_hz: float
    recorder_lost: int
    lateness_p99_ms: float
    counted: dict[str, int]
    memory_mb: dict[str, float]
    descriptors: dict[str, int]


def burn(pipe: Pipe) -> None:
    """Keep a core busy until the pipe closes."""
    pipe.send("ready")
    while not pipe.poll():
        sum(range(10_000))


def stream(pipe: Pipe, endpoint: str) -> None:
    """Be the owner until the pipe closes."""

    def pause() -> None:
        if pipe.poll(UPDATE_S):
            pipe.recv()

    pipe.send("ready")
    own(endpoint, LEASE_MS, pause)


class Soak:
    """A service with everybody who weighs on it.

    Parameters
    ----------
    subscribers, viewers, beside : int
        How many; `beside` are processes that keep a core busy.
    """

    def __init__(self, subscribers: int, viewers: int, beside: int) -> None:
        self.subscribers, self.viewers, self.beside = subscribers, viewers, beside

    def run(self, seconds: float, window_s: float) -> Line:
        """Soak for so long; return the line."""
        began_s = time.monotonic()
        said = Said()
        with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as stack:
            config = config_in(Path(folder), SimulatedConfig(finger=SteadyStrokes()))
            supervisor = stack.enter_context(serving(config, said))
            following = [
                stack.enter_context(neighbour(subscribe, config.router.endpoint, [RIG] * share))
                for share in _shares(self.subscribers, PROCESSES)
            ]
            pages = [
                stack.enter_context(neighbour(view, config.api.port, [RIG] * share))
                for share in _shares(self.viewers, PROCESSES // 2)
            ]
            stack.enter_context(neighbour(stream, config.router.endpoint))
            client = stack.enter_context(frictus.connect(config.router.endpoint))
            for _ in range(self.beside):
                stack.enter_context(neighbour(burn))
            rig = client.rig(config.rig, config.site)
            windows = list(
                self._windows(rig, supervisor, following, pages, config, seconds, window_s)
            )
        return {
            "subscribers": self.subscribers,
            "viewers": self.viewers,
            "beside": self.beside,
            "windows": [asdict(window) for window in windows],
            "seconds": round(time.monotonic() - began_s, 1),
            "failures": [{"what": line} for line in said.new_ends()]
            + ([] if self.beside else [{"what": what} for what in judged(windows)]),
        }

    def _windows(
        self,
        rig: frictus.Rig,
        supervisor: Supervisor,
        following: list[Neighbour],
        pages: list[Neighbour],
        config: Config,
        seconds: float,
        window_s: float,
    ) -> Iterator[Window]:
        pause = threading.Event()  # never set
        pids: dict[str, int] = {name: supervisor.pid_of(name) for name in ALL}
        pids["supervisor"] = multiprocessing.current_process().pid or 0
        tallied, status = _tallies(following), rig.status()
        for page in pages:
            page.ask("taken")
        began_s = looked_s = time.monotonic()
        number = 0
        while looked_s - began_s < seconds:
            name = f"soak-{number}"
            with contextlib.suppress(FrictusError):
                rig.record(name)
            pause.wait(max(0.0, looked_s + window_s - time.monotonic()))
            recorder_lost = rig.recording().lost_blocks
            with contextlib.suppress(FrictusError):
                rig.end_recording()
            (config.recordings / f"{name}.mcap").unlink(missing_ok=True)
            former_s, looked_s = looked_s, time.monotonic()
            before, tallied = tallied, _tallies(following)
            former, status = status, rig.status()
            frames = sum(len(each.ages_ms) for page in pages for each in page.ask("taken"))
            each = (looked_s - former_s) * max(self.viewers, 1) * len(STREAMS)
            yield Window(
                end_s=round(looked_s - began_s, 1),
                received=tallied.received - before.received,
                lost=tallied.lost - before.lost,
                frames_hz=round(frames / each, 2),
                recorder_lost=recorder_lost,
                lateness_p99_ms=round(status.timing.lateness_p99_ms, 3),
                counted={
                    counter: getattr(status.counters, counter)
                    - getattr(former.counters, counter)
                    for counter in COUNTERS
                },
                memory_mb={
                    part: round(psutil.Process(pid).memory_info().rss / 1e6, 2)
                    for part, pid in pids.items()
                },
                descriptors={part: _descriptors(pid) for part, pid in pids.items()},
            )
            number += 1


def _shares(count: int, processes: int) -> list[int]:
    return [share for n in range(processes) if (share := len(range(n, count, processes)))]


def _tallies(following: list[Neighbour]) -> Tally:
    total = Tally()
    for process in following:
        for tally in process.ask("tally"):
            total.received += tally.received
            total.lost += tally.lost
    return total


def _descriptors(pid: int) -> int:
    process = psutil.Process(pid)
    count = process.num_fds if hasattr(process, "num_fds") else process.num_handles
    return int(count())


def slope(hours: NDArray[np.float64], values: NDArray[np.float64]) -> tuple[float, float]:
    """Return the slope of a straight line per hour, and half its 95 % interval.

    Parameters
    ----------
    hours, values : ndarray, shape (n,)
        At least three.
    """
    centred = hours - hours.mean()
    spread = float(centred @ centred)
    rise = float(centred @ values) / spread
    left = values - values.mean() - rise * centred
    return rise, 1.96 * math.sqrt(float(left @ left) / (len(values) - 2) / spread)


def judged(windows: list[Window]) -> list[str]:
    """Return what a quiet soak must not show; the first window is for settling."""
    settled = windows[1:]
    wrong = []
    received, lost = (sum(getattr(w, name) for w in settled) for name in ("received", "lost"))
    if not received or lost / (received + lost) > LARGEST_LOSS:
        wrong.append(f"subscribers lost {lost} of {received + lost} blocks")
    for counter in ("deadline_misses", "underruns", "blocks_dropped", "trips"):
        if count := sum(window.counted[counter] for window in settled):
            wrong.append(f"{counter}: {count}")
    late = max((window.lateness_p99_ms for window in settled), default=0.0)
    if late > LARGEST_P99_MS:
        wrong.append(f"lateness p99 {late:.2f} ms")
    return wrong


def main() -> None:
    """Soak quietly, or beside others."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("results", type=Path, help="file of lines, which is added to")
    parser.add_argument("--seconds", type=float, default=3_600.0, help="how long (3600)")
    parser.add_argument("--window", type=float, default=60.0, help="s, of a recording (60)")
    parser.add_argument("--subscribers", type=int, default=16)
    parser.add_argument("--viewers", type=int, default=20)
    parser.add_argument("--beside", type=int, default=0, help="processes that burn a core (0)")
    arguments = parser.parse_args()

    def run(_name: str, _seed: int) -> dict[str, Any]:
        soak = Soak(arguments.subscribers, arguments.viewers, arguments.beside)
        return soak.run(arguments.seconds, arguments.window)

    name = f"{arguments.seconds:g} s beside {arguments.beside}"
    for line in go_on(arguments.results, [name], 0, run):
        for window in line.pop("windows"):
            print(window, flush=True)  # noqa: T201
        print(line, flush=True)  # noqa: T201


if __name__ == "__main__":
    main()
