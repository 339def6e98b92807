"""How fast a recording is written, beside the same bytes in a bare file, synced as often."""

import os
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

import numpy as np

from frictus.block import Block, Flag
from frictus_laboratory.benchmarks.figure import Figure, interleaved
from frictus_service.recording.records import RecordingInfo
from frictus_service.recording.writer import SYNC_S, RecordingWriter

RATE_HZ: Final = 20_000.0
BLOCK: Final = 100
SECONDS: Final = 20.0
STEPS: Final = {"force": 0.0005, "accel": 0.04}
CHANNELS: Final = {1: 3, 2: 3, 3: 1, 4: 5}
REPEATS: Final = 5


def measure() -> list[Figure]:
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
