"""How late the block loop wakes: alone, with subscribers and a busy API, beside busy processes.

Beside processes that compute without pause, also what is lost, and where. A block passes three
queues that drop rather than wait: the hand-over from the loop to the publisher, Zenoh's on the
way (the rig's and the router's), and the reader's own. Each tells of itself: the rig counts the
first, and a gap in the reader's stream names the other two.
"""

import contextlib
import os
import threading
import time
from typing import Final

import frictus
from frictus_laboratory.benchmarks.figure import Figure, Target, spread
from frictus_laboratory.benchmarks.kernel import TEXTURE
from frictus_laboratory.benchmarks.latency import BLOCK_S
from frictus_laboratory.benchmarks.load import STREAMS, Tally, loaded
from frictus_laboratory.benchmarks.processes import RIG, Pipe, config_of, neighbour, serving
from frictus_service.daemon.block_loop.block_checks import KEPT_BLOCKS
from frictus_service.daemon.preparation import budget_for, raise_priority
from frictus_service.library import SHIPPED, TextureLibrary
from frictus_service.processes import LOOP_PRIORITY

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


NICENESS: Final = 5
LARGEST_LOSS: Final = 1e-4
LARGEST_LATENESS_MS: Final = 1.0


def compute(pipe: Pipe) -> None:
    """Compute without pause, at a lower priority where the system has one."""
    if hasattr(os, "nice"):
        os.nice(NICENESS)
    pipe.send("ready")
    over = threading.Event()
    threading.Thread(target=_await_end, args=(pipe, over), daemon=True).start()
    total = 0
    while not over.is_set():
        total += sum(range(10_000))


def sleep_block_by_block(pipe: Pipe) -> None:
    """Sleep as a loop that does nothing else would; asked for it, tell all latenesses, ms.

    What it is late by, the machine is late by: no program on it can be less late.
    """
    raise_priority(LOOP_PRIORITY, budget_for(0.0))
    pipe.send("ready")
    late_ms: list[float] = []
    due_s = time.monotonic()
    while not pipe.poll():
        due_s += BLOCK_S
        while (left_s := due_s - time.monotonic()) > 0.0:
            time.sleep(left_s)
        late_ms.append(-1e3 * left_s)
    pipe.send(late_ms)


def _await_end(pipe: Pipe, over: threading.Event) -> None:
    with contextlib.suppress(EOFError, OSError):
        pipe.recv()
    over.set()


def measure_beside(busy: int, seconds: float = 6.0) -> list[Figure]:
    """Return the figures `busy_<n>_loss` and `busy_<n>_lateness`.

    Parameters
    ----------
    busy : int
        Processes that compute without pause meanwhile.
    seconds : float
        How long it is measured.
    """
    config = config_of()
    with (
        serving(config, ("rig", "api")),
        frictus.connect(config.router.endpoint) as client,
        loaded(config, SUBSCRIBERS) as load,
        contextlib.ExitStack() as stack,
    ):
        for _ in range(busy):
            stack.enter_context(neighbour(compute))
        bare = stack.enter_context(neighbour(sleep_block_by_block))
        before = load.tallies()
        lateness_ms, counts = timing_of(client.rig(RIG), seconds)
        tallies = load.tallies()
        bare_ms = spread(bare.ask("over"), worst=True)
    lost = _missing(tallies) - _missing(before)
    received = sum(tally.received for tally in tallies) - sum(
        tally.received for tally in before
    )
    places = {
        "handed_over": float(counts["blocks_dropped"] * len(STREAMS) * SUBSCRIBERS),
        "on_the_way": float(_missing(tallies, "lost") - _missing(before, "lost")),
        "by_the_reader": float(_missing(tallies, "overflow") - _missing(before, "overflow")),
    }
    beside = f"beside {busy} busy process{'es' * (busy > 1)} at nice {NICENESS}"
    return [
        Figure(
            f"busy_{busy}_loss",
            "blocks",
            {"received": float(received), "lost": float(lost)},
            places,
            lost / max(received + lost, 1),
            Target("ratio", "at most", LARGEST_LOSS),
            f"of {SUBSCRIBERS} subscribers {beside}; on the right by the queue that dropped "
            "them; ratio: lost over sent",
        ),
        Figure(
            f"busy_{busy}_lateness",
            "ms",
            lateness_ms,
            bare_ms,
            target=Target("p99", "at most", LARGEST_LATENESS_MS),
            remark=f"of the loop {beside}; {counts['underruns']} underruns, "
            f"{counts['deadline_misses']} blocks more than a block late; on the right: of a "
            "thread of the same priority that only sleeps, block by block",
        ),
    ]


def _missing(tallies: list[Tally], reason: str | None = None) -> int:
    if reason is None:
        return sum(tally.lost for tally in tallies)
    return sum(tally.gaps.get(reason, 0) for tally in tallies)


def measure_contention() -> list[Figure]:
    """Return the figures beside one and beside two busy processes."""
    return [*measure_beside(1), *measure_beside(2)]
