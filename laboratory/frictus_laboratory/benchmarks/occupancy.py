"""How much of a core one simulated rig takes, and what its tracker costs it.

Of the rig, loop, publisher and commands together.
"""

import statistics
import threading
import time
from dataclasses import dataclass
from typing import Final, Self

import frictus
from frictus_hardware import SimulatedConfig
from frictus_laboratory.benchmarks.figure import Figure, Target
from frictus_laboratory.benchmarks.kernel import TEXTURE
from frictus_laboratory.benchmarks.lateness import timing_of
from frictus_laboratory.benchmarks.processes import (
    RIG,
    Neighbour,
    Pipe,
    config_of,
    neighbour,
    serving,
    used_s,
)
from frictus_service.config import Config
from frictus_service.daemon.processes.child_process import PartName
from frictus_service.daemon.rig import run_rig
from frictus_service.library import SHIPPED, TextureLibrary
from frictus_service.security.router import open_secured_router

MOST: Final = 0.1
"""Of a core, armed."""
MOST_OF_TRACKER: Final = 0.05
TURNS: Final = 3


class _Beats:
    """Counts the loop's turns for nobody."""

    value = 0


def be_rig(pipe: Pipe, config: Config) -> None:
    """Be a rig."""
    ready, stop = threading.Event(), threading.Event()
    thread = threading.Thread(target=run_rig, args=(config, _Beats(), ready, stop))
    thread.start()
    try:
        ready.wait()
        pipe.send("ready")
        pipe.recv()
    finally:
        stop.set()
        thread.join()


def share_of(rig: Neighbour, seconds: float) -> float:
    """Return the share of a core that a rig takes over a while."""
    begun_s, before_s = time.monotonic(), used_s(rig.pid)
    threading.Event().wait(seconds)
    return (used_s(rig.pid) - before_s) / (time.monotonic() - begun_s)


def measure(seconds: float = 6.0) -> list[Figure]:
    """Return the figure `rig_cpu`.

    Parameters
    ----------
    seconds : float
        Idle, and again armed with a texture.
    """
    config = config_of(SimulatedConfig())
    with (
        open_secured_router(config),
        neighbour(be_rig, config) as process,
        frictus.connect(config.router.endpoint) as client,
    ):
        rig = client.rig(RIG)
        rig.set_scene(TextureLibrary(SHIPPED).get(TEXTURE).texture)
        idle = share_of(process, seconds)
        with rig.arm(lease_ms=2_000):
            armed = share_of(process, seconds)
    return [
        Figure(
            "rig_cpu",
            "of a core",
            {"idle": idle, "armed": armed},
            target=Target("armed", "at most", MOST),
            remark="processor time over time of a simulated rig's process, explored by a human "
            f"finger; over {seconds:g} s each",
        )
    ]


@dataclass(frozen=True, slots=True)
class Stay:
    """What a rig did for a while, and what a process beside it took.

    Attributes
    ----------
    lateness_ms : dict
        Of the rig's loop.
    cpu : float
        Of that process, in cores.
    wall_s : float
        How long it was watched.
    """

    lateness_ms: dict[str, float]
    cpu: float
    wall_s: float

    @classmethod
    def watch(cls, rig: frictus.Rig, pid: int, seconds: float) -> Self:
        """Render a texture for a while."""
        cpu_s, wall_s = used_s(pid), time.monotonic()
        lateness_ms, _ = timing_of(rig, seconds)
        wall_s = time.monotonic() - wall_s
        return cls(lateness_ms, (used_s(pid) - cpu_s) / wall_s, wall_s)


def measure_tracker(seconds: float = 10.0, turns: int = TURNS) -> list[Figure]:
    """Return the figures `tracker_cpu` and `tracker_lateness`.

    Parameters
    ----------
    seconds : float
        Of each turn; a human finger explores a texture.
    turns : int
        How often a service without tracker and one with it are started, one after the other.
    """
    stays: dict[PartName, list[Stay]] = {"rig": [], "tracker": []}
    for _ in range(turns):
        for beside, of_it in stays.items():
            config = config_of(SimulatedConfig())
            with (
                serving(config, sorted({"rig", beside})) as supervisor,
                frictus.connect(config.router.endpoint) as client,
            ):
                of_it.append(Stay.watch(client.rig(RIG), supervisor.pid_of(beside), seconds))
    alone_ms, beside_ms = (
        {
            name: statistics.median(stay.lateness_ms[name] for stay in of_it)
            for name in ("p50", "p99", "max")
        }
        for of_it in stays.values()
    )
    cpu = {name: statistics.median(stay.cpu for stay in of_it) for name, of_it in stays.items()}
    return [
        Figure(
            "tracker_cpu",
            "of a core",
            {"tracker": cpu["tracker"]},
            {"rig": cpu["rig"]},
            target=Target("tracker", "at most", MOST_OF_TRACKER),
            remark="processor time over time of the tracker's process, and of the rig's "
            "without one, while a human finger explores a texture; medians of "
            f"{turns} times {seconds:g} s",
        ),
        Figure(
            "tracker_lateness",
            "ms",
            beside_ms,
            {f"alone_{name}": number for name, number in alone_ms.items()},
            beside_ms["p99"] / max(alone_ms["p99"], 1e-6),
            remark=f"of the rig's loop with a tracker, beside that without one; medians of "
            f"{turns} services each, in turns; ratio: of p99",
        ),
    ]
