"""Files that no recorder wrote, though their checksums are right, are refused or end early."""

import os
import struct
import zlib
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

from frictus_service.errors import RecordingError
from frictus_service.recording.reader import RecordingReader
from frictus_service.recording.records import HEAD
from frictus_service.recording.summary import summarise
from frictus_service.recording.tape import export_tape


def forged(content: bytes, rng: np.random.Generator) -> bytes:
    """Change a record within a chunk, and make its checksum right again."""
    at, chunks = len(MCAP0_MAGIC), []
    while at < len(content) - len(MCAP0_MAGIC):
        opcode, length = HEAD.unpack_from(content, at)
        at += HEAD.size
        chunks += [slice(at, at + length)] if opcode == Opcode.CHUNK else []
        at += length
    chunk = chunks[rng.integers(len(chunks))]
    times, inner = content[chunk][:16], bytearray(content[chunk][40:])
    if rng.random() < 0.5:
        inner[rng.integers(min(len(inner), 300))] ^= 0xFF
    else:
        del inner[rng.integers(len(inner)) :]
    sizes = struct.pack("<QIIQ", len(inner), zlib.crc32(inner), 0, len(inner))
    record = times + sizes + inner
    before = content[: chunk.start - HEAD.size]
    return before + HEAD.pack(Opcode.CHUNK, len(record)) + record + content[chunk.stop :]


def test_damage_behind_right_checksums_ends_the_reading(
    tmp_path: Path, make_whole: Any, rng: np.random.Generator
) -> None:
    content, path = make_whole(100).content, tmp_path / "forged.mcap"
    for _ in range(100):
        path.write_bytes(forged(content, rng))
        with RecordingReader(path) as reader:
            assert not summarise(reader).ending.complete
    name = b"recording.json"
    body = struct.pack("<QQI", 0, 0, 1_000) + name
    body += struct.pack("<I", zlib.crc32(body))
    first = content.index(name) - 20 - HEAD.size
    path.write_bytes(content[:first] + HEAD.pack(Opcode.ATTACHMENT, len(body)) + body)
    with pytest.raises(RecordingError, match="attachment cannot be read"):
        RecordingReader(path)


def test_a_recording_that_does_not_say_what_its_rig_is_becomes_no_tape(
    tmp_path: Path, make_whole: Any
) -> None:
    with pytest.raises(RecordingError, match=r"no status\.json"):
        export_tape(make_whole(10).path, tmp_path / "out.h5")


def test_of_a_study_it_is_said_what_checks_it(tmp_path: Path) -> None:
    path = tmp_path / "study.h5"
    h5py.File(path, "w").close()
    with pytest.raises(RecordingError, match="study show --check"):
        RecordingReader(path)


def test_a_file_that_is_shortened_while_it_is_read_ends_there(
    tmp_path: Path, make_whole: Any, rng: np.random.Generator
) -> None:
    """Where it ended within the head of a record, `export` ended as unexpected."""
    content, path = make_whole(100).content, tmp_path / "shortened.mcap"
    for size in rng.integers(len(content) // 2, len(content) - 100, 100):
        path.write_bytes(content)
        with RecordingReader(path) as reader:
            os.truncate(path, size)
            ending = summarise(reader).ending
        assert not ending.complete
        assert "shortened while it was read" in ending.reason
