"""What a recording holds, what other tools see of it, and what a disk may do to it."""

import errno
import json
import os
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader
from tests.full_disk import full_after

from frictus.keys import Topics
from frictus_service.errors import NotWrittenError
from frictus_service.recording.reader import RecordingReader
from frictus_service.recording.records import GapNote
from frictus_service.recording.summary import (
    RecordingSummary,
    length_s,
    shelved,
    summarise,
    unfinished,
)
from frictus_service.recording.writer import FLUSH_S, SYNC_S, RecordingWriter, new_file

GAP = {"utc_ns": 1, "stream": "force", "run": 5, "reason": "lost"}


def summary_of(path: Path) -> RecordingSummary:
    with RecordingReader(path) as reader:
        return summarise(reader)


def opened(path: Path, known: Any) -> RecordingWriter:
    return RecordingWriter(path, known.info(path.stem), {"model.json": b"{}"}, lambda: 0.0)


def test_other_tools_read_it(make_whole: Any, known: Any) -> None:
    whole = make_whole(100)
    with whole.path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        told = reader.get_summary()
        assert told is not None
        assert told.statistics is not None
        channels = {channel.topic: channel for channel in told.channels.values()}
        assert channels["stream/force"].metadata["scale"] == "0.0005"
        assert channels["stream/force"].metadata["unit"] == "N"
        schema = told.schemas[channels["state/touch"].schema_id]
        assert schema.encoding == "jsonschema"
        assert "x_mm" in json.loads(schema.data)["properties"]
        messages = list(reader.iter_messages(topics=["state/touch"]))
        assert len(messages) == 100
        first = json.loads(messages[0][2].data)
        assert first["x_mm"] == 0.0
        (attached,) = reader.iter_attachments()
        assert json.loads(attached.data)["schema"] == "recording/1"


def test_everything_that_does_not_change_is_on_the_disk_before_the_first_sample(
    tmp_path: Path, known: Any
) -> None:
    with opened(tmp_path / "a.mcap", known) as writer, RecordingReader(writer.path) as reader:
        assert reader.info == writer.info
        assert reader.attachments["model.json"] == b"{}"
        assert [type(item).__name__ for item in reader.items()] == ["PresenceNote"]
        assert "not ended" in reader.ending.reason


def test_cadence(tmp_path: Path, known: Any) -> None:
    now_s = 0.0
    path = tmp_path / "a.mcap"
    with RecordingWriter(path, known.info("a"), {}, lambda: now_s) as writer:
        sizes, synced = {path.stat().st_size}, 0
        for sequence in range(400):
            known.hand_over(writer, sequence)
            now_s += 5e-3
            synced += writer.tick()
            sizes.add(path.stat().st_size)
        assert len(sizes) >= 2.0 / (FLUSH_S + 0.01)
        assert synced >= 2.0 / (SYNC_S + 0.01) - 1


def test_gaps_are_data(tmp_path: Path, known: Any) -> None:
    path = tmp_path / "a.mcap"
    gap = GapNote(**GAP, first_missing_sequence=2, missing_blocks=3, missing_samples=300)
    with opened(path, known) as writer:
        for sequence in (0, 1):
            writer.block(known.block(known.FORCE, sequence))
        writer.gap(gap)
        writer.block(known.block(known.FORCE, 5))
        writer.end("asked for", known.UTC_NS)
    summary = summary_of(path)
    assert summary.sound
    assert summary.gaps == (gap,)
    force = summary.streams["force"]
    assert (force.blocks, force.samples) == (3, 300)
    assert (force.gaps, force.lost_blocks, force.lost_samples) == (1, 3, 300)
    assert summary.end is not None
    assert summary.end.streams["force"].lost_blocks == 3


def test_a_hole_that_no_gap_names_is_a_fault(tmp_path: Path, known: Any) -> None:
    path = tmp_path / "a.mcap"
    with opened(path, known) as writer:
        for sequence in (0, 2):
            writer.block(known.block(known.FORCE, sequence))
        writer.end("asked for", known.UTC_NS)
    summary = summary_of(path)
    assert summary.ending.complete
    assert not summary.sound
    assert "block 2 of run 5" in summary.faults[0]


def test_name_taken(make_whole: Any, known: Any) -> None:
    whole = make_whole(3)
    before = whole.content
    with pytest.raises(NotWrittenError, match="already"):
        opened(whole.path, known)
    assert whole.content == before


def test_a_folder_that_cannot_be_made(tmp_path: Path, known: Any) -> None:
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(NotWrittenError, match="folder"):
        opened(tmp_path / "file" / "a.mcap", known)


def test_a_full_disk_says_so_and_keeps_what_was_synced(
    tmp_path: Path, known: Any, read: Any
) -> None:
    path = tmp_path / "a.mcap"
    with opened(path, known) as writer:
        for sequence in range(200):
            known.hand_over(writer, sequence)
        writer.sync()
        kept, synced = writer.bytes_written, writer.totals["truth"].samples
        with full_after(kept + 10_000):
            for sequence in range(200, 400):
                known.hand_over(writer, sequence)
            with pytest.raises(NotWrittenError, match=r"a\.mcap cannot be written"):
                writer.sync()
            writer.close()
    found = read(path)
    assert found.ending.clean_bytes >= kept
    assert found.samples[known.TRUTH] >= synced


def test_a_disk_that_is_full_at_once_leaves_no_file(tmp_path: Path, known: Any) -> None:
    with full_after(100), pytest.raises(NotWrittenError) as refused:
        opened(tmp_path / "a.mcap", known)
    assert str(refused.value).count("cannot be written") == 1
    assert not list(tmp_path.iterdir())


def test_shelf(tmp_path: Path, make_whole: Any) -> None:
    assert shelved(tmp_path / "absent") == []
    whole = make_whole(20)
    assert unfinished(tmp_path) is None
    torn = tmp_path / "torn.mcap"
    torn.write_bytes(whole.content[:-1])
    os.utime(torn, (2e9, 2e9))
    assert unfinished(tmp_path) == torn
    assert [one.finished for one in shelved(tmp_path)] == [False, True]


def test_its_length_counts_from_its_beginning_not_from_what_held_before(
    tmp_path: Path, known: Any
) -> None:
    path = tmp_path / "a.mcap"
    with opened(path, known) as writer:
        day_ns = 86_400 * 10**9
        writer.state(Topics.TOUCH, known.touch(0).to_json(), known.UTC_NS - day_ns)
        writer.end("asked for", writer.info.started_utc_ns + 2 * 10**9)
    (found,) = shelved(tmp_path)
    assert length_s(found) == pytest.approx(2.0)


def test_its_length_is_not_that_of_a_clock_that_was_set(tmp_path: Path, known: Any) -> None:
    with opened(tmp_path / "a.mcap", known) as writer:
        writer.end("asked for", writer.info.started_utc_ns + 3_600 * 10**9, 6.5)
    (found,) = shelved(tmp_path)
    assert length_s(found) == 6.5


def test_what_is_made_of_a_recording_bears_its_name_when_it_is_whole(tmp_path: Path) -> None:
    path = tmp_path / "made.npz"

    def interrupted() -> None:
        with new_file(path) as file:
            file.write(b"a part")
            file.flush()
            assert not path.exists()
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(NotWrittenError, match=r"made\.npz cannot be written: No space"):
        with new_file(path) as file:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    with new_file(path) as file:
        file.write(b"whole")
    assert [each.read_bytes() for each in tmp_path.iterdir()] == [b"whole"]
    with pytest.raises(NotWrittenError, match="already"), new_file(path):
        raise AssertionError
    with pytest.raises(NotWrittenError, match="already"), new_file(tmp_path / "b") as file:
        (tmp_path / "b").write_bytes(b"of somebody")
    assert (tmp_path / "b").read_bytes() == b"of somebody"
