"""Blocks per second through the publishing path, and into a recording, beside bare bytes.

Publishing is set beside bare puts of the same bytes. Both send to one subscriber in another
process through one router, and both wait where the network is full instead of dropping, so that
every block arrives: what is compared is the highest rate without loss.
"""

import os
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

import numpy as np
import zenoh
from zenoh.handlers import Callback

from frictus.block import Block, FingerSensor, Flag
from frictus.keys import STREAMS, RigKeys, Topic, Topics
from frictus.session import open_router, open_session
from frictus_hardware import SimulatedConfig
from frictus_hardware.physics.friction import FrictionLaw
from frictus_laboratory.benchmarks.figure import Figure, Target, interleaved
from frictus_laboratory.benchmarks.processes import Neighbour, Pipe, await_subscriber, neighbour
from frictus_service.daemon.block_loop.block_record import (
    BlockRecord,
    blocks_of,
    finger_of,
    flags_of,
)
from frictus_service.daemon.block_loop.timebase import Timebase, UtcReading
from frictus_service.processes import free_endpoint
from frictus_service.recording.records import RecordingInfo
from frictus_service.recording.writer import SYNC_S, RecordingWriter
from frictus_service.synthesis.chain import make_chain

KEYS: Final = RigKeys("bench", "rig")
TOPICS: Final = (*STREAMS.values(), Topics.FINGER)
BLOCK_SAMPLES: Final = 100
ARRIVE_S: Final = 30.0
"""How long the last block may take before the measurement is given up."""


def count_arrivals(pipe: Pipe, endpoint: str) -> None:
    """Be the subscriber: told how many messages to wait for, answer when they are there."""
    arrived = 0
    wanted = 0
    there = threading.Event()

    def count(_sample: zenoh.Sample) -> None:
        nonlocal arrived
        arrived += 1
        if arrived >= wanted:
            there.set()

    with open_session(endpoint) as session:
        for topic in TOPICS:
            session.declare_subscriber(KEYS.of(topic), Callback(count, indirect=False))
        pipe.send("ready")
        while True:
            wanted = pipe.recv()
            there.clear()
            if arrived < wanted:
                there.wait(ARRIVE_S)
            pipe.send(arrived)


class Wire:
    """Publishers that never drop, and the count of what their subscriber got.

    Parameters
    ----------
    session : zenoh.Session
        Open session.
    subscriber : Neighbour
        Which runs `count_arrivals`.
    """

    def __init__(self, session: zenoh.Session, subscriber: Neighbour) -> None:
        self._subscriber = subscriber
        self._sent = 0
        self.publishers = {topic: _patient(session, topic) for topic in TOPICS}
        for publisher in self.publishers.values():
            await_subscriber(publisher)

    def timed_s(self, send: Callable[[], int]) -> float:
        """Return how long it takes to send, until the last message has arrived.

        Parameters
        ----------
        send : callable
            Returns how many messages it has put.
        """
        begun = time.perf_counter()
        self._sent += send()
        arrived = self._subscriber.ask(self._sent)
        taken = time.perf_counter() - begun
        if arrived != self._sent:
            raise RuntimeError(f"{self._sent} messages sent without dropping, {arrived} came")
        return taken


def _patient(session: zenoh.Session, topic: Topic) -> zenoh.Publisher:
    return session.declare_publisher(
        KEYS.of(topic),
        priority=getattr(zenoh.Priority, topic.qos.priority),
        congestion_control=zenoh.CongestionControl.BLOCK,
        reliability=zenoh.Reliability.RELIABLE,
    )


class OneTurn:
    """What the publisher does with a turn, and the bytes that come of it.

    A real turn of a simulated rig; publishing it again and again costs what publishing fresh
    ones does.
    """

    def __init__(self, wire: Wire) -> None:
        self._streams = {stream: wire.publishers[topic] for stream, topic in STREAMS.items()}
        self._finger = wire.publishers[Topics.FINGER]
        config = SimulatedConfig(clock="virtual")
        with config.make() as rig:
            chain = make_chain(rig, FrictionLaw(), config.screen, BLOCK_SAMPLES)
            steps = [chain.step(False) for _ in range(40)]  # until a touch was reported
            self._info = rig.info
            finger = (35.0, 17.0, 60.0, 0.0)
            self._read = (time.monotonic_ns(), time.time_ns(), time.monotonic_ns())
            self._turn = BlockRecord(
                1,
                len(steps),
                steps[-1].exchange,
                steps[-1].in_contact,
                steps[-1].stale,
                steps[-1].normal_force_n,
                True,
                Flag(0),
                Flag(0),
                steps[-1].motion,
                steps[-1].rendered.target_n,
                steps[-1].rendered.drive,
                FingerSensor.TOUCH,
                finger,
                0.03,
                self._read[0],
                UtcReading(*self._read),
            )
        self._timebase = Timebase(self._info.sample_rate_hz)
        self._turns = 0
        self._blocks = self._made_blocks()
        self._frames = [(block.stream, block.pack()) for block in self._blocks]
        self._finger_json = self._made_finger()
        self.bytes = sum(len(frame) for _, frame in self._frames)

    def _made_blocks(self) -> list[Block]:
        turn, timebase = self._turn, self._timebase
        self._turns += 1  # the time fit, unlike the rest, must see time pass
        end = self._turns * BLOCK_SAMPLES
        later_ns = round(end * timebase.nominal_ns)
        before_ns, utc_ns, after_ns = (part + later_ns for part in self._read)
        timebase.observe(end, before_ns, UtcReading(before_ns, utc_ns, after_ns))
        timebase.fit()
        stamp = timebase.stamp(end - BLOCK_SAMPLES)
        flags = flags_of(turn, self._info, placeholder=True)
        return list(blocks_of(turn, stamp, flags, self._info.sample_rate_hz))

    def _made_finger(self) -> bytes:
        stamp = self._timebase.stamp(self._timebase.newest_sample)
        finger = finger_of(self._turn, stamp, self._info)
        return b"" if finger is None else finger.to_json()

    def pack_and_put(self) -> int:
        """Put the turn's blocks as the publisher does; return how many."""
        for block in self._blocks:
            self._streams[block.stream].put(block.pack())
        return len(self._blocks)

    def put(self) -> int:
        """Put the same bytes, bare; return how many."""
        for stream, frame in self._frames:
            self._streams[stream].put(frame)
        return len(self._frames)

    @property
    def n_blocks(self) -> int:
        """Blocks of a turn."""
        return len(self._blocks)

    def publish(self) -> int:
        """Do all that the publisher does with a turn, finger state included."""
        for block in self._made_blocks():
            self._streams[block.stream].put(block.pack())
        self._finger.put(self._made_finger())
        return len(self._blocks) + 1

    def put_all(self) -> int:
        """Put the bytes of `publish`, bare."""
        sent = self.put()
        self._finger.put(self._finger_json)
        return sent + 1


def measure(turns: int = 500, repeats: int = 61) -> list[Figure]:
    """Return the figures `block_throughput` and `publisher_turn`.

    Parameters
    ----------
    turns : int
        Turns in one timing; each makes four blocks.
    repeats : int
        Timings of each contender.
    """
    endpoint = free_endpoint()
    with (
        open_router(endpoint),
        open_session(endpoint) as session,
        neighbour(count_arrivals, endpoint) as subscriber,
    ):
        wire = Wire(session, subscriber)
        turn = OneTurn(wire)

        def timing(send: Callable[[], int]) -> Callable[[], float]:
            return lambda: wire.timed_s(lambda: sum(send() for _ in range(turns)))

        ours_s, bare_s = interleaved(repeats, timing(turn.pack_and_put), timing(turn.put))
        whole_s, all_s = interleaved(repeats, timing(turn.publish), timing(turn.put_all))
    blocks = turns * turn.n_blocks
    megabytes = 1e-6 * turns * turn.bytes / ours_s
    return [
        Figure(
            "block_throughput",
            "blocks/s",
            {"publisher": blocks / ours_s},
            {"zenoh": blocks / bare_s},
            bare_s / ours_s,
            Target("ratio", "at least", 0.9),
            f"pack and put, {BLOCK_SAMPLES} samples a block, {megabytes:.0f} MB/s, "
            "without loss, until the last one has arrived; ratio: of the rates",
        ),
        Figure(
            "publisher_turn",
            "us/turn",
            {"publisher": 1e6 * whole_s / turns},
            {"zenoh": 1e6 * all_s / turns},
            whole_s / all_s,
            remark="all that is done for 5 ms of a rig: conversion, time stamps, four blocks "
            "and the finger state; ratio: time over that of bare puts of the same bytes",
        ),
    ]


RATE_HZ: Final = 20_000.0
BLOCK: Final = 100
SECONDS: Final = 20.0
STEPS: Final = {"force": 0.0005, "accel": 0.04}
CHANNELS: Final = {1: 3, 2: 3, 3: 1, 4: 5}
REPEATS: Final = 5


def measure_recording() -> list[Figure]:
    """Write 20 s of a rig's streams as fast as the disk takes them."""
    rng = np.random.default_rng(0)
    blocks = [_turn(rng, number) for number in range(round(SECONDS * RATE_HZ / BLOCK))]
    with tempfile.TemporaryDirectory() as folder:
        size = _record(Path(folder) / "size.mcap", blocks)
        names = (str(number) for number in range(2 * REPEATS))

        def ours() -> float:
            return _timed(lambda: _record(Path(folder) / f"{next(names)}.mcap", blocks))

        def bare() -> float:
            return _timed(lambda: _write_bare(Path(folder) / next(names), size))

        ours_s, bare_s = interleaved(REPEATS, ours, bare)
    return [
        Figure(
            "recording",
            "MB/s",
            {"written": 1e-6 * size / ours_s},
            {"bare file": 1e-6 * size / bare_s},
            ratio=bare_s / ours_s,
            remark=f"all streams of a rig at 20 kHz, {1e-6 * size / SECONDS:.2f} MB per second "
            f"of recording, {SECONDS / ours_s:.0f} times as fast as they come; both synced to "
            f"the disk every {SYNC_S:g} s of recording; the ratio is of the speeds",
        )
    ]


def _turn(rng: np.random.Generator, number: int) -> list[Block]:
    found = []
    for stream, channels in CHANNELS.items():
        data = rng.normal(0.0, 0.2, (channels, BLOCK))
        step = {1: STEPS["force"], 2: STEPS["accel"]}.get(stream)
        if step is not None:
            data = np.rint(data / step) * step
        at = number * BLOCK
        utc_ns = round(1e9 * at / RATE_HZ)
        found.append(
            Block(
                stream,
                1,
                number,
                at,
                utc_ns,
                0,
                RATE_HZ,
                Flag.SIMULATED,
                data.astype(np.float32),
            )
        )
    return found


def _record(path: Path, turns: list[list[Block]]) -> int:
    now_s = 0.0
    info = RecordingInfo(
        name="bench",
        site="bench",
        rig="bench",
        started_utc_ns=0,
        software="frictus bench",
        converter_steps=STEPS,
    )
    with RecordingWriter(path, info, {}, lambda: now_s) as writer:
        for number, turn in enumerate(turns):
            for block in turn:
                writer.block(block)
            now_s = number * BLOCK / RATE_HZ
            writer.tick()
        writer.end("asked for", 0)
        return writer.bytes_written


def _write_bare(path: Path, size: int) -> int:
    pieces = round(SECONDS / SYNC_S)
    content = os.urandom(size // pieces)
    with path.open("xb") as file:
        for _ in range(pieces):
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
    return size


def _timed(work: Callable[[], object]) -> float:
    begun_s = time.perf_counter()
    work()
    return time.perf_counter() - begun_s
