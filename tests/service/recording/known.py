"""Samples that are a function of their index, and a process that records them until killed.

Run as a script it writes to standard output, line by line, how many samples it has handed to
the writer, and how many the disk keeps in how many bytes.
"""

import os
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from frictus.block import Block, Flag
from frictus.keys import Topics
from frictus.messages import TouchState
from frictus_service.recording.records import RecordingInfo
from frictus_service.recording.writer import RecordingWriter

RATE_HZ = 20_000.0
BLOCK = 100
STEP_N = 0.0005
BEAT_BLOCKS = 4
UTC_NS = 1_795_000_000_000_000_000
RUN = 5
FORCE, TRUTH = 1, 4


def known(stream: int, first: int, n: int) -> NDArray[np.float32]:
    """What stands at these indices: counts of a converter, or what no converter gives."""
    index = np.arange(first, first + n, dtype=np.int64)
    channel = np.arange(3 if stream == FORCE else 5, dtype=np.int64)[:, np.newaxis]
    counts: NDArray[Any] = (index * 7_919 + channel * 104_729) % 60_001 - 30_000
    if stream == FORCE:
        counts = counts * STEP_N
    else:
        counts = np.sin(counts + 0.1)
    values: NDArray[np.float32] = counts.astype(np.float32)
    return values


def block(stream: int, sequence: int) -> Block:
    """Block number `sequence` of an unbroken stream."""
    first = sequence * BLOCK
    return Block(
        stream,
        RUN,
        sequence,
        first,
        UTC_NS + sequence * 5_000_000,
        1_000,
        RATE_HZ,
        Flag.SIMULATED,
        known(stream, first, BLOCK),
    )


def touch(sequence: int) -> TouchState:
    """The touch report that goes with a block."""
    return TouchState(
        run=RUN,
        sample=float(sequence * BLOCK),
        x_mm=0.01 * sequence,
        y_mm=20.0,
        in_contact=True,
        source="simulated",
    )


def info(name: str) -> RecordingInfo:
    """What the recording says of itself."""
    return RecordingInfo(
        name=name,
        site="lab",
        rig="rig1",
        started_utc_ns=UTC_NS,
        software="frictus test",
        converter_steps={"force": STEP_N},
    )


def hand_over(writer: RecordingWriter, sequence: int) -> None:
    """Write what belongs to a block: its touch report, and both streams."""
    at_ns = UTC_NS + sequence * 5_000_000
    writer.state(Topics.TOUCH, touch(sequence).to_json(), at_ns)
    for stream in (FORCE, TRUTH):
        writer.block(block(stream, sequence))


def run(path: Path) -> None:
    """Record in real time until killed."""
    with RecordingWriter(
        path, info(path.stem), {"model.json": b"{}"}, time.monotonic
    ) as writer:
        os.write(1, f"synced 0 {writer.bytes_written}\n".encode())
        sequence = 0
        while True:
            for _ in range(BEAT_BLOCKS):
                hand_over(writer, sequence)
                sequence += 1
            synced = writer.tick()
            told = f"handed {sequence * BLOCK}\n"
            if synced:
                told += f"synced {writer.totals['truth'].samples} {writer.bytes_written}\n"
            os.write(1, told.encode())
            time.sleep(BEAT_BLOCKS * BLOCK / RATE_HZ)


if __name__ == "__main__":
    run(Path(sys.argv[1]))
