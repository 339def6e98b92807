"""A site on one machine, in growing sizes: `python -m tests.campaigns.site --help`.

Each ladder is climbed until something gives; the whole site is run even so.
"""

import contextlib
import dataclasses
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np
import psutil
from tests.campaigns.lines import Line, asked, go_on, read
from tests.campaigns.service import http_status
from tests.campaigns.site_parts import Site, Size, make_tape

import frictus
from frictus.errors import FrictusError
from frictus_laboratory.benchmarks.viewers import RATE_HZ, STREAMS
from frictus_service.config import Config
from frictus_service.errors import ServiceError

SETTLING_S: Final = 5.0
SECONDS: Final = 25
FEWEST_FRAMES: Final = 0.9
"""Of those that viewers ask for."""
OLDEST_FRAME_MS: Final = 250.0
LARGEST_LOSS: Final = 1e-4
LATEST_MS: Final = 5.0
"""A loop that is a block late, p99."""
COUNTERS: Final = ("blocks", "deadline_misses", "underruns", "blocks_dropped", "trips")
WHOLE: Final = Size(12, 12, 100)
LADDERS: Final = {
    "rigs": [Size(rigs, rigs, 2) for rigs in (1, 2, 4, 8, 12)],
    "viewers": [Size(2, 2, viewers) for viewers in (10, 30, 100)],
    "whole": [WHOLE],
    "subscribers": [Size(2, 8, 2, across=False), Size(2, 8, 2), Size(2, 16, 2)],
}


def measured(site: Site, seconds: float) -> Line:
    """Return what the site does for so long, and what gave."""
    wrong = site.published_wrongly()
    site.taken()
    pids, before = site.processes(), site.states()
    tally, recorder_lost = site.tally(), site.recorder_lost()
    used_s, busy_s, began_s = _used_s(pids), _busy_s(), time.monotonic()
    health_s = _health_s(site.front, seconds)
    wall_s = time.monotonic() - began_s
    cores = {
        kind: round((after_s - used_s[kind]) / wall_s, 4)
        for kind, after_s in _used_s(pids).items()
    }
    machine = round((_busy_s() - busy_s) / wall_s, 3)
    taken, now, after = site.taken(), site.tally(), site.states()
    line: Line = {
        "size": dataclasses.asdict(site.size),
        "cores": cores,
        "machine_cores": machine,
        "of_cores": psutil.cpu_count(),
        "frames_hz": round(
            len(taken.ages_ms) / (wall_s * max(site.size.viewers, 1) * len(STREAMS)), 2
        ),
        "frame_age_ms": _percentiles(taken.ages_ms),
        "state_age_ms": _percentiles(taken.state_ages_ms),
        "received": now.received - tally.received,
        "lost": now.lost - tally.lost,
        "recorder_lost": site.recorder_lost() - recorder_lost,
        "lateness_p99_ms": round(max(s.timing.lateness_p99_ms for s in after), 3),
        "counted": _grown(before, after),
        "health_s": round(health_s, 3),
        "silent": 2 * site.size.rigs - len(before) - len(after),
        "ended": site.ended(),
        "seconds": round(wall_s, 1),
    }
    return line | {"gave": gave(line), "failures": [{"what": what} for what in wrong]}


def _health_s(front: Config, seconds: float) -> float:
    """Return the slowest answer of the proxy to a request per second, for so long."""
    pause, until_s, slowest_s = threading.Event(), time.monotonic() + seconds, 0.0
    while time.monotonic() < until_s:
        asked_s = time.monotonic()
        if http_status(front, "/v1/health") != 200:
            return float("inf")
        slowest_s = max(slowest_s, time.monotonic() - asked_s)
        pause.wait(1.0)
    return slowest_s


def gave(line: Line) -> list[str]:
    """Return what gave way, in the order in which parts should: none where the site holds."""
    found = []
    if line["size"]["viewers"] and line["frames_hz"] < FEWEST_FRAMES * RATE_HZ:
        found.append(f"viewers: {line['frames_hz']:.0f} of {RATE_HZ} frames/s")
    if line["frame_age_ms"][1] > OLDEST_FRAME_MS:
        found.append(f"viewers: frames {line['frame_age_ms'][1]:.0f} ms old")
    if line["recorder_lost"]:
        found.append(f"recordings: {line['recorder_lost']} blocks missing")
    if (lost := line["lost"]) > LARGEST_LOSS * (line["received"] + lost):
        found.append(f"subscribers: {lost} of {line['received'] + lost} blocks lost")
    if line["lateness_p99_ms"] > LATEST_MS:
        found.append(f"loops: {line['lateness_p99_ms']:.1f} ms late")
    for counter in ("blocks_dropped", "trips"):
        if count := line["counted"][counter]:
            found.append(f"rigs: {counter} {count}")
    if line["silent"]:
        found.append(f"rigs: {line['silent']} states not answered")
    return [*found, *line["ended"]]


def _grown(before: list[frictus.RigStatus], after: list[frictus.RigStatus]) -> dict[str, int]:
    """Return by how much counters grew; those of a rig that was started anew from 0."""
    former = {(state.rig, state.run): state.counters for state in before}
    growth = Counter(dict.fromkeys(COUNTERS, 0))
    for state in after:
        since = former.get((state.rig, state.run))
        for name in COUNTERS:
            growth[name] += getattr(state.counters, name) - getattr(since, name, 0)
    return dict(growth)


def _percentiles(ages_ms: list[float]) -> list[float]:
    """Return median and 99th percentile; infinite where nothing came."""
    if not ages_ms:
        return [float("inf")] * 2
    return [round(age_ms, 1) for age_ms in np.percentile(ages_ms, (50.0, 99.0)).tolist()]


def _used_s(processes: dict[str, list[int]]) -> dict[str, float]:
    """Return the processor time of each kind of part until now; of those that still run."""
    used_s = dict.fromkeys(processes, 0.0)
    for kind, pids in processes.items():
        for pid in pids:
            with contextlib.suppress(psutil.NoSuchProcess):  # `ended` tells
                times = psutil.Process(pid).cpu_times()
                used_s[kind] += times.user + times.system
    return used_s


def _busy_s() -> float:
    """Return for how long the machine's cores have not been idle, together."""
    times = psutil.cpu_times()
    return float(sum(times) - times.idle - getattr(times, "iowait", 0.0))


class Campaign:
    """All steps, which play one recording.

    Parameters
    ----------
    seconds : float
        That each is measured.
    """

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds
        self._undo = contextlib.ExitStack()
        self._tape: Path | None = None

    def run(self, size: Size) -> Line:
        """Return the line of a size."""
        if self._tape is None:
            folder = self._undo.enter_context(tempfile.TemporaryDirectory())
            self._tape = make_tape(Path(folder))
        try:
            with (
                tempfile.TemporaryDirectory() as folder,
                Site(size, self._tape, Path(folder)) as site,
            ):
                threading.Event().wait(SETTLING_S)
                return measured(site, self._seconds)
        except (FrictusError, ServiceError, TimeoutError) as error:
            what = f"{type(error).__name__}: {error}"
            return {
                "size": dataclasses.asdict(size),
                "gave": [what],
                "failures": [{"what": what}],
            }

    def close(self) -> None:
        """Remove the recording."""
        self._undo.close()


def climb(
    path: Path,
    ladder: str,
    wanted: Sequence[str],
    seed: int | None,
    run: Callable[[Size], Line],
) -> Iterator[Line]:
    """Run a ladder's steps that have no line yet, until something gives; yield their lines.

    Parameters
    ----------
    path : Path
        File of lines.
    ladder : str
    wanted : sequence of str
        Names of the steps that are asked for.
    seed : int or None
        For `go_on`.
    run : callable
        Makes the line of a size.
    """
    for size in LADDERS[ladder]:
        name = f"{ladder}/{size.name}"
        if name in wanted:
            yield from go_on(path, [name], seed, partial(_made, run, size))
        done = {line["name"]: line for line in read(path)}.get(name)
        if done is not None and done["gave"]:
            return


def _made(run: Callable[[Size], Line], size: Size, _name: str, _seed: int) -> Line:
    return run(size)


def names() -> list[str]:
    """Return the names of all steps."""
    return [f"{ladder}/{size.name}" for ladder in LADDERS for size in LADDERS[ladder]]


def main() -> None:
    """Climb the ladders."""
    given: list[int] = []

    def steps(seconds: int) -> list[str]:
        given.append(seconds)
        return names()

    path, wanted, seed = asked(__doc__, "seconds", SECONDS, "s that each is measured", steps)
    with contextlib.closing(Campaign(given[0])) as campaign:
        for ladder in LADDERS:
            for line in climb(path, ladder, wanted, seed, campaign.run):
                print(line, flush=True)  # noqa: T201


if __name__ == "__main__":
    main()
