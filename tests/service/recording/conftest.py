"""A finished recording of known samples, and what a reading of one must satisfy."""

import runpy
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from frictus_service.recording.reader import Ending, RecordingReader, State
from frictus_service.recording.samples import Samples
from frictus_service.recording.writer import RecordingWriter

SCRIPT = Path(__file__).with_name("known.py")
KNOWN = SimpleNamespace(**runpy.run_path(str(SCRIPT), run_name="known"))


@dataclass(frozen=True)
class Read:
    """What a clean reading gave."""

    samples: dict[int, int]
    """By stream, how many from index 0 on."""
    touches: int
    ending: Ending


def read_clean(path: Path) -> Read:
    """Read a recording of known samples; every value must be right, nothing may be skipped."""
    counts = {KNOWN.FORCE: 0, KNOWN.TRUTH: 0}
    touches = 0
    with RecordingReader(path) as reader:
        for item in reader.items():
            if isinstance(item, Samples):
                assert item.run == KNOWN.RUN
                assert item.first_sample == counts[item.stream]
                n = item.data.shape[1]
                expected = KNOWN.known(item.stream, item.first_sample, n)
                assert np.array_equal(item.data, expected)
                counts[item.stream] += n
            elif isinstance(item, State):
                assert item.message == KNOWN.touch(touches)
                touches += 1
        return Read(counts, touches, reader.ending)


@dataclass(frozen=True)
class Whole:
    """A finished recording.

    Attributes
    ----------
    path : Path
    blocks : int
    flushed : list of (bytes, samples)
        What was in the file whenever a chunk was closed.
    """

    path: Path
    blocks: int
    flushed: list[tuple[int, int]]

    @property
    def content(self) -> bytes:
        return self.path.read_bytes()


MakeWhole = Callable[[int], Whole]


@pytest.fixture
def make_whole(tmp_path: Path) -> MakeWhole:
    """Make a finished recording of so many blocks; its clock is what the samples say."""

    def make(blocks: int) -> Whole:
        path = tmp_path / f"whole-{blocks}.mcap"
        now_s = 0.0
        flushed: list[tuple[int, int]] = []
        with RecordingWriter(path, KNOWN.info("whole"), {}, lambda: now_s) as writer:
            for sequence in range(blocks):
                KNOWN.hand_over(writer, sequence)
                now_s = sequence * 5e-3
                before = path.stat().st_size
                writer.tick()
                size = path.stat().st_size
                if size > before:
                    flushed.append((size, writer.totals["truth"].samples))
            writer.end("asked for", KNOWN.UTC_NS)
        return Whole(path, blocks, flushed)

    return make


ReadClean = Callable[[Path], Read]


@pytest.fixture
def read() -> ReadClean:
    """Read a recording of known samples and hold every value to what was written."""
    return read_clean


@pytest.fixture
def known() -> Any:
    """The module of known samples."""
    return KNOWN
