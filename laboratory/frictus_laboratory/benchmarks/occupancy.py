"""How much of a core one simulated rig takes: loop, publisher and commands together."""

import threading
import time
from typing import Final

import frictus
from frictus_hardware import SimulatedConfig
from frictus_laboratory.benchmarks.figure import Figure, Target
from frictus_laboratory.benchmarks.kernel import TEXTURE
from frictus_laboratory.benchmarks.processes import RIG, Neighbour, Pipe, config_of, neighbour
from frictus_service.config import Config
from frictus_service.daemon.rig import run_rig
from frictus_service.library import SHIPPED, TextureLibrary
from frictus_service.security.router import open_secured_router

MOST: Final = 0.1
"""Of a core, armed."""


class _Beats:
    """Counts the loop's turns for nobody."""

    value = 0


def be_rig(pipe: Pipe, config: Config) -> None:
    """Be a rig; asked for it, answer with the processor time of this process, s."""
    ready, stop = threading.Event(), threading.Event()
    thread = threading.Thread(target=run_rig, args=(config, _Beats(), ready, stop))
    thread.start()
    try:
        ready.wait()
        pipe.send("ready")
        while True:
            pipe.recv()
            pipe.send(time.process_time())
    finally:
        stop.set()
        thread.join()


def share_of(rig: Neighbour, seconds: float) -> float:
    """Return the share of a core that a rig takes over a while."""
    begun_s, used_s = time.monotonic(), rig.ask("used")
    threading.Event().wait(seconds)
    return float((rig.ask("used") - used_s) / (time.monotonic() - begun_s))


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
