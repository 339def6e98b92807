"""How late the block loop of a rig wakes: alone, and with subscribers and a busy API."""

import threading
from typing import Final

import frictus
from frictus_laboratory.benchmarks.figure import Figure, Target
from frictus_laboratory.benchmarks.kernel import TEXTURE
from frictus_laboratory.benchmarks.load import loaded
from frictus_laboratory.benchmarks.service import RIG, config_of, serving
from frictus_service.daemon.block_checks import KEPT_BLOCKS
from frictus_service.library import SHIPPED, TextureLibrary

SUBSCRIBERS: Final = 16


def timing_of(rig: frictus.Rig, seconds: float) -> tuple[dict[str, float], dict[str, int]]:
    """Render a texture for a while.

    Parameters
    ----------
    rig : Rig
        An open rig of this client.
    seconds : float
        Percentiles are of the last `KEPT_BLOCKS` blocks of it.

    Returns
    -------
    lateness_ms, counts : dict
        p50, p99 and, since the rig started, max; and what the loop counted meanwhile.
    """
    rig.set_scene(TextureLibrary(SHIPPED).get(TEXTURE).texture)
    with rig.arm(lease_ms=2_000):
        before = rig.status().counters
        threading.Event().wait(seconds)
        status = rig.status()
    timing, after = status.timing, status.counters
    lateness_ms = {
        "p50": timing.lateness_p50_ms,
        "p99": timing.lateness_p99_ms,
        "max": timing.lateness_max_ms,
    }
    counted = ("blocks", "deadline_misses", "overruns", "underruns", "blocks_dropped")
    counts = {name: getattr(after, name) - getattr(before, name) for name in counted}
    return lateness_ms, counts


def measure(seconds: float = 6.0, subscribers: int = SUBSCRIBERS) -> list[Figure]:
    """Return the figures `loop_lateness`, `loop_misses` and `load_loss`.

    Parameters
    ----------
    seconds : float
        Alone, and again under load.
    subscribers : int
        How many read everything.
    """
    config = config_of()
    with serving(config), frictus.connect(config.router.endpoint) as client:
        alone_ms, alone = timing_of(client.rig(RIG), seconds)
    config = config_of()
    with (
        serving(config, ("rig", "api")),
        frictus.connect(config.router.endpoint) as client,
        loaded(config, subscribers) as load,
    ):
        loaded_ms, counts = timing_of(client.rig(RIG), seconds)
        tallies, answers = load.tallies(), load.answers()
    received = sum(tally.received for tally in tallies)
    lost = sum(tally.lost for tally in tallies)
    return [
        Figure(
            "loop_lateness",
            "ms",
            loaded_ms,
            {f"alone_{name}": number for name, number in alone_ms.items()},
            loaded_ms["p99"] / max(alone_ms["p99"], 1e-6),
            remark=f"under load: {subscribers} subscribers of all streams and a busy API; "
            f"percentiles of {KEPT_BLOCKS} blocks, max since the rig started; ratio: of p99",
        ),
        Figure(
            "loop_misses",
            "blocks",
            {name: float(count) for name, count in counts.items()},
            {f"alone_{name}": float(count) for name, count in alone.items()},
            remark=f"over {seconds:g} s each; a miss is a block more than a block late",
        ),
        Figure(
            "load_loss",
            "blocks",
            {"received": float(received), "lost": float(lost)},
            ratio=lost / max(received + lost, 1),
            target=Target("ratio", "at most", 1e-4),
            remark=f"of all {subscribers} subscribers together, while the API answered "
            f"{answers.get(200, 0)} requests; ratio: lost over sent",
        ),
    ]
