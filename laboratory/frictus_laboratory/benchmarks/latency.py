"""How old a block is when a subscriber has it, and a texture when it is at the DAC.

A texture is timed from `send` to the first changed sample at the DAC. Between updates the rig
plays a stream whose texture is next to nothing: its drive is the bias alone, so that every
sample of the screen voltage is known in advance and the first changed one is seen at once.
"""

import itertools
import queue
import threading
import time
from typing import Final

import numpy as np
import zenoh
from zenoh.handlers import Callback

import frictus
from frictus.keys import RigKeys, Topics
from frictus.session import declare_publisher, open_session
from frictus_hardware.physics.screen import Screen
from frictus_laboratory.benchmarks.figure import Figure, Target, spread
from frictus_laboratory.benchmarks.processes import (
    QUIET_S,
    RIG,
    Pipe,
    await_subscriber,
    config_of,
    neighbour,
    serving,
)
from frictus_service.config import Limits
from frictus_service.demonstration.explorer import changed_samples
from frictus_service.errors import StartError

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


def measure_delivery(blocks: int = 1_200) -> list[Figure]:
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


PEAK_N: Final = 0.05
WAVE: Final = np.cos(2.0 * np.pi * np.arange(64) / 64.0)
PERIOD_S: Final = 0.004
"""250 Hz; over time, not over position, so that the finger does not matter."""
TTL_MS: Final = 5_000
LONGEST_BLOCKS: Final = 200
ECHO: Final = (RigKeys("bench", "there").of(Topics.TEXTURE), RigKeys("bench", "back"))


class Watcher:
    """Follows the screen voltage of a rig that plays a stream.

    Parameters
    ----------
    rig : Rig
        An open rig of this client.
    stream : TextureStream
        Open, on `rig`.
    lead_samples : int
        From a block that was handed over to its playing.
    """

    def __init__(
        self, rig: frictus.Rig, stream: frictus.TextureStream, lead_samples: int
    ) -> None:
        self._stream = stream
        self._lead = lead_samples
        self._screen = Screen(peak_v=rig.status().screen_peak_v)
        if stream.applied is None:
            raise StartError("the rig did not say what it made of the stream")
        self._bias = stream.applied.bias
        self._feed = rig.blocks("voltage", timeout_s=QUIET_S)

    def close(self) -> None:
        """Stop following."""
        self._feed.close()

    def settle(self) -> None:
        """Play next to nothing, and wait until nothing else is played."""
        self._stream.send(1e-6 * WAVE, period_s=PERIOD_S, ttl_ms=TTL_MS)
        for _ in range(LONGEST_BLOCKS):
            if not changed_samples(self._next(), self._screen, self._bias).size:
                return
        raise StartError("the rig plays something else than the stream that was sent")

    def update_ms(self) -> tuple[float, float]:
        """Send an update; return the time to its first block's rendering and to its DAC sample.

        In the first, the block was handed over to the device, whose lead then passes.
        """
        sent_ns = time.time_ns()
        self._stream.send(PEAK_N * WAVE, period_s=PERIOD_S, ttl_ms=TTL_MS)
        for _ in range(LONGEST_BLOCKS):
            block = self._next()
            changed = changed_samples(block, self._screen, self._bias)
            if changed.size:
                sample_ns = 1e9 / block.sample_rate_hz
                at_dac_ms = 1e-6 * (block.utc_ns + changed[0] * sample_ns - sent_ns)
                handed_ms = 1e-6 * (block.utc_ns - self._lead * sample_ns - sent_ns)
                return handed_ms, at_dac_ms
        raise StartError("an update of the stream was never played")

    def _next(self) -> frictus.Block:
        return next(item for item in self._feed if isinstance(item, frictus.Block))


def echo(pipe: Pipe, endpoint: str) -> None:
    """Send back whatever comes, until told to end."""
    there, back = ECHO[0], ECHO[1].of(Topics.TEXTURE)
    arrived: queue.SimpleQueue[bytes | None] = queue.SimpleQueue()
    with open_session(endpoint) as session:
        publisher = declare_publisher(session, back, Topics.TEXTURE)

        def send_back() -> None:
            while (payload := arrived.get()) is not None:
                publisher.put(payload)

        def note(sample: zenoh.Sample) -> None:
            arrived.put(sample.payload.to_bytes())

        session.declare_subscriber(there, Callback(note, indirect=False))
        thread = threading.Thread(target=send_back)
        thread.start()
        try:
            pipe.send("ready")
            pipe.recv()
        finally:
            arrived.put(None)
            thread.join()


class RoundTrip:
    """Puts of an update's bytes, to another process and back.

    Parameters
    ----------
    session : zenoh.Session
        Open session.
    """

    def __init__(self, session: zenoh.Session) -> None:
        self._back: queue.SimpleQueue[bytes] = queue.SimpleQueue()

        def note(sample: zenoh.Sample) -> None:
            self._back.put(sample.payload.to_bytes())

        key = ECHO[1].of(Topics.TEXTURE)
        self._subscriber = session.declare_subscriber(key, Callback(note, indirect=False))
        self._publisher = declare_publisher(session, ECHO[0], Topics.TEXTURE)
        await_subscriber(self._publisher)

    def taken_ms(self) -> float:
        """Return the time of one round trip."""
        begun = time.perf_counter()
        self._publisher.put(bytes(64 + 4 * WAVE.size))
        self._back.get(timeout=QUIET_S)
        return 1e3 * (time.perf_counter() - begun)


def measure_update(updates: int = 80) -> list[Figure]:
    """Return the figures `texture_update` and `texture_update_dac`.

    Parameters
    ----------
    updates : int
        How many are timed; ten a second at least.
    """
    # Late blocks are in the figure; a rig that tripped by them would have none.
    config = config_of(limits=Limits(missed_deadlines=1_000))
    endpoint, rng, pause = (
        config.router.endpoint,
        np.random.default_rng(0),
        threading.Event(),
    )
    handed_ms, dac_ms, trips_ms = [], [], []
    with (
        serving(config),
        neighbour(echo, endpoint),
        frictus.connect(endpoint) as client,
    ):
        rig = client.rig(RIG)
        trip = RoundTrip(client.session)
        status = rig.status()
        lead_samples = round(1e-3 * status.lead_ms * status.sample_rate_hz)
        block_ms = 1e3 * status.block_samples / status.sample_rate_hz
        with rig.arm(lease_ms=2_000), rig.open_stream(PEAK_N) as stream:
            watcher = Watcher(rig, stream, lead_samples)
            for _ in range(updates):
                watcher.settle()
                pause.wait(1e-3 * rng.uniform(0.0, block_ms))
                handed, dac = watcher.update_ms()
                handed_ms.append(handed)
                dac_ms.append(dac)
                trips_ms.append(trip.taken_ms() + block_ms)
            watcher.close()
    beside = spread(trips_ms)
    rendered, played = spread(handed_ms), spread(dac_ms)
    return [
        Figure(
            "texture_update",
            "ms",
            rendered,
            beside,
            rendered["p50"] / beside["p50"],
            remark=f"{updates} updates: from the client's send to the device taking the first "
            f"block that renders it; beside: a bare round trip of as many bytes to another "
            f"process, plus one block of {block_ms:g} ms; ratio: of the medians",
        ),
        Figure(
            "texture_update_dac",
            "ms",
            played,
            {name: number + status.lead_ms for name, number in beside.items()},
            played["p50"] / (beside["p50"] + status.lead_ms),
            remark="the same to the first changed sample at the DAC; beside: the same plus the "
            f"device's lead of {status.lead_ms:g} ms",
        ),
    ]
