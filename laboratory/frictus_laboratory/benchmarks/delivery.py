"""How old a block is when a subscriber in another process has it, beside a bare put."""

import itertools
import threading
import time
from typing import Final

import zenoh
from zenoh.handlers import Callback

import frictus
from frictus.keys import RigKeys, Topics
from frictus.session import declare_publisher, open_session
from frictus_laboratory.benchmarks.figure import Figure, Target, spread
from frictus_laboratory.benchmarks.neighbour import Pipe, neighbour
from frictus_laboratory.benchmarks.service import QUIET_S, RIG, config_of, serving

BARE: Final = RigKeys("bench", "bare").of(Topics.FORCE)
BLOCK_S: Final = 0.005
FRAME_BYTES: Final = 64 + 3 * 100 * 4
"""As large as a block of force."""
STAMP_BYTES: Final = 8


def receive(pipe: Pipe, endpoint: str) -> None:
    """Be the subscriber: told how many blocks to follow, answer with all ages, in ms."""
    bare_ms: list[float] = []

    def note(sample: zenoh.Sample) -> None:
        sent_ns = int.from_bytes(sample.payload.to_bytes()[:STAMP_BYTES], "little")
        bare_ms.append(1e-6 * (time.time_ns() - sent_ns))

    with frictus.connect(endpoint) as client:
        client.session.declare_subscriber(BARE, Callback(note, indirect=False))
        rig = client.rig(RIG)
        pipe.send("ready")
        while True:
            wanted = pipe.recv()
            with rig.blocks("force", timeout_s=QUIET_S) as feed:
                bare_ms.clear()
                ages_ms = [
                    1e-6 * (time.time_ns() - _end_ns(item))
                    for item in itertools.islice(feed, wanted)
                    if isinstance(item, frictus.Block)
                ]
            pipe.send((ages_ms, bare_ms))


def _end_ns(block: frictus.Block) -> float:
    samples: int = block.data.shape[1]
    return block.utc_ns + 1e9 * samples / block.sample_rate_hz


def measure(blocks: int = 1_200) -> list[Figure]:
    """Return the figure `block_latency`.

    Parameters
    ----------
    blocks : int
        How many blocks to follow, 200 a second.
    """
    config = config_of()
    endpoint = config.router.endpoint
    with (
        serving(config),
        open_session(endpoint) as session,
        neighbour(receive, endpoint) as subscriber,
    ):
        publisher = declare_publisher(session, BARE, Topics.FORCE)
        subscriber.tell(blocks)
        pause = threading.Event()
        due_s = time.monotonic()
        while not subscriber.has_spoken():
            stamp = time.time_ns().to_bytes(STAMP_BYTES, "little")
            publisher.put(stamp + bytes(FRAME_BYTES - STAMP_BYTES))
            due_s = max(due_s + BLOCK_S, time.monotonic())
            pause.wait(due_s - time.monotonic())
        ages_ms, bare_ms = subscriber.heard()
    value, beside = spread(ages_ms), spread(bare_ms)
    return [
        Figure(
            "block_latency",
            "ms",
            value,
            beside,
            value["p50"] / beside["p50"],
            Target("ratio", "at most", 2.0),
            f"{len(ages_ms)} blocks: from a block's last sample to a subscriber in "
            "another process, decoded; beside: bare puts of as many bytes at the same pace and "
            "time, through the same router; ratio: of the medians",
        )
    ]
