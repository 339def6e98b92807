"""A recording as a file that viewers plot: every sample, at a time that rises."""

import json
import re
import tempfile
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.records import Channel, Message, Schema
from tests.full_disk import full_after
from tests.rig_status import rig_status
from typer.testing import CliRunner

from frictus.block import Block
from frictus.keys import CHANNELS, STREAMS, TOPICS, Topics
from frictus.messages import MESSAGES, AuxChannel, RigStatus, TimeState
from frictus_service.cli.app import app
from frictus_service.cli.options import Exit
from frictus_service.errors import ExportError
from frictus_service.recording import foxglove
from frictus_service.recording.foxglove import LAYOUT, export_foxglove
from frictus_service.recording.plain_schema import plain_schema
from frictus_service.recording.plot_channels import field_names
from frictus_service.recording.records import GapNote
from frictus_service.recording.writer import RecordingWriter

BLOCKS = 400
"""2 s."""
AUX = AuxChannel(name="Thermo 1", unit="°C")


def status(known: SimpleNamespace) -> RigStatus:
    return rig_status(
        run=known.RUN,
        utc_ns=known.UTC_NS,
        sample_rate_hz=known.RATE_HZ,
        block_samples=known.BLOCK,
        aux=(AUX,),
    )


@pytest.fixture
def recording(tmp_path: Path, known: Any, rng: np.random.Generator) -> Path:
    """Two seconds whose stamps step as a rig's do, and a gap."""
    path = tmp_path / "pilot.mcap"
    said = status(known)
    attachments = {"status.json": said.to_json()}
    with RecordingWriter(path, known.info("pilot"), attachments, lambda: 0.0) as writer:
        writer.state(Topics.STATUS, said.to_json(), known.UTC_NS)
        for sequence in range(BLOCKS):
            if sequence % 20 == 0:
                fit_ns = (
                    known.UTC_NS + 5_000_000 * sequence + int(rng.integers(-28_000, 279_000))
                )
                fit = TimeState(
                    run=known.RUN,
                    sample=sequence * known.BLOCK,
                    utc_ns=fit_ns,
                    ns_per_sample=5e4 * (1.0 + 1e-6 * float(rng.normal())),
                    uncertainty_ns=300_000,
                    skew_ppm=0.0,
                    utc_steps=0,
                )
                writer.state(Topics.TIME, fit.to_json(), fit_ns)
            block = known.block(known.FORCE, sequence)
            step_ns = int(rng.integers(-28_000, 279_000))
            writer.block(moved(block, step_ns))
        gap = GapNote(
            utc_ns=known.UTC_NS + 10**9, stream="force", missing_blocks=1, reason="lost"
        )
        writer.gap(gap)
        writer.end("asked for", known.UTC_NS + 2 * 10**9)
    return path


def moved(block: Block, step_ns: int) -> Block:
    fields = {name: getattr(block, name) for name in Block.__dataclass_fields__}
    return Block(**(fields | {"utc_ns": block.utc_ns + step_ns}))


def messages(path: Path) -> list[tuple[Schema, Channel, Message]]:
    with path.open("rb") as file:
        found = make_reader(file, validate_crcs=True).iter_messages(log_time_order=False)
        return [(schema, channel, message) for schema, channel, message in found if schema]


def test_every_sample_is_a_message_and_times_rise(
    recording: Path, tmp_path: Path, known: Any
) -> None:
    out = tmp_path / "out.mcap"
    done = export_foxglove(recording, out)
    assert done.ending.complete
    found = messages(out)
    assert len(found) == done.messages
    force = [(s, c, m) for s, c, m in found if c.topic == "stream/force"]
    schema, channel, _ = force[0]
    assert (schema.encoding, channel.message_encoding) == ("ros1msg", "ros1")
    assert schema.data == b"float32 x_n\nfloat32 y_n\nfloat32 z_n\n"
    assert channel.metadata == {"unit": "N"}
    values = np.array([np.frombuffer(m.data, "<f4") for _, _, m in force])
    n = BLOCKS * known.BLOCK
    assert np.array_equal(values.T, known.known(known.FORCE, 0, n))
    times_ns = np.array([m.log_time for _, _, m in force])
    assert np.all(np.diff(times_ns) > 0)
    assert np.max(np.abs(times_ns - known.UTC_NS - 50_000 * np.arange(n))) < 400_000


def test_documents_come_with_their_own_text_and_plain_schemas(
    recording: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out.mcap"
    export_foxglove(recording, out)
    topics = {c.topic: (s, m) for s, c, m in messages(out) if c.message_encoding == "json"}
    assert {"state/status", "state/time", "recording/gaps", "recording/end"} <= topics.keys()
    schema, message = topics["state/status"]
    assert json.loads(schema.data) == plain_schema(RigStatus)
    assert RigStatus.from_json(message.data).aux == (AUX,)


def test_a_part_begins_with_what_holds_then(
    recording: Path, tmp_path: Path, known: Any
) -> None:
    out = tmp_path / "out.mcap"
    export_foxglove(recording, out, 0.5, 1.2)
    found = messages(out)
    force = [m.log_time for _, c, m in found if c.topic == "stream/force"]
    assert abs(len(force) - 0.7 * known.RATE_HZ) <= 2
    begin_ns = min(m.log_time for _, _, m in found)
    assert [m.log_time for _, c, m in found if c.topic == "state/status"] == [begin_ns]
    assert all(begin_ns <= m.log_time < begin_ns + 7 * 10**8 for _, _, m in found)
    with pytest.raises(ExportError, match="no samples in that part"):
        export_foxglove(recording, tmp_path / "none.mcap", 60.0)
    for odd in (-1.0, float("nan"), float("inf")):
        with pytest.raises(ExportError, match="begins and ends at 0 to"):
            export_foxglove(recording, tmp_path / "none.mcap", odd)


@pytest.mark.parametrize(
    "changes",
    [
        {"sample_rate_hz": 1e-300},
        {"first_sample": 2**63},
        {"utc_ns": -1},
        {"utc_ns": 2**63 - 1},
    ],
)
def test_numbers_that_no_rig_counts_are_refused(
    tmp_path: Path, known: Any, changes: dict[str, Any]
) -> None:
    path = tmp_path / "odd.mcap"
    attachments = {"status.json": status(known).to_json()}
    block = known.block(known.FORCE, 0)
    fields = {name: getattr(block, name) for name in Block.__dataclass_fields__}
    with RecordingWriter(path, known.info("odd"), attachments, lambda: 0.0) as writer:
        writer.block(Block(**(fields | changes)))
        writer.end("asked for", known.UTC_NS)
    with pytest.raises(ExportError, match="no rig counts so"):
        export_foxglove(path, tmp_path / "out.mcap")


def test_names_become_fields() -> None:
    assert field_names(["Thermo 1_°C", "thermo_1 c", "1_V", "_"]) == (
        "thermo_1_c",
        "channel_1_thermo_1_c",
        "channel_2_1_v",
        "channel_3",
    )


def test_the_layout_shows_what_there_is() -> None:
    """Each path of a panel is a topic and a field of it."""
    layout = json.loads(LAYOUT.read_text(encoding="utf-8"))
    panels = layout["configById"]
    shown = set(
        re.findall(
            r'"((?:Plot|StateTransitions|RawMessages)![a-z]+)"', json.dumps(layout["layout"])
        )
    )
    assert shown == panels.keys()
    topics = {topic.suffix: topic for topic in TOPICS}
    paths = [path["value"] for panel in panels.values() for path in panel.get("paths", [])]
    assert len(paths) > 10
    for path in paths:
        suffix, *names = path.split(".")
        topic = topics[suffix]
        if topic.message in MESSAGES:
            field = plain_schema(MESSAGES[topic.message])
            for name in names:
                field = field["properties"][name]
            assert field["type"] in ("number", "string")
        else:
            streams = {topic.suffix: number for number, topic in STREAMS.items()}
            assert names[0] in CHANNELS[streams[suffix]]


def test_the_command_says_where_file_and_layout_are(recording: Path) -> None:
    result = CliRunner().invoke(app, ["export", str(recording), "--to", "foxglove", "--json"])
    assert result.exit_code == Exit.OK, result.output
    told = json.loads(result.stdout)
    assert Path(told["out"]) == recording.with_name("pilot_foxglove.mcap")
    assert json.loads(Path(told["layout"]).read_text(encoding="utf-8"))["configById"]
    again = CliRunner().invoke(app, ["export", str(recording), "--to", "foxglove"])
    assert again.exit_code == Exit.USAGE, "nothing is written over"
    Path(told["layout"]).write_text("of the laboratory", encoding="utf-8")
    Path(told["out"]).unlink()
    CliRunner().invoke(app, ["export", str(recording), "--to", "foxglove"])
    assert Path(told["layout"]).read_text(encoding="utf-8") == "of the laboratory"


def test_a_layout_that_a_full_disk_does_not_take_leaves_no_part_of_one(
    recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It stayed, since a layout that is there may have been changed."""
    out = tmp_path / "plots" / "a.mcap"
    export_foxglove(recording, out)
    size = out.stat().st_size
    out.unlink()
    large = tmp_path / "large.json"
    large.write_bytes(bytes(size + 2_000))
    monkeypatch.setattr(foxglove, "LAYOUT", large)
    with full_after(size + 1_000):
        result = CliRunner().invoke(
            app, ["export", str(recording), "--to", "foxglove", "--out", str(out)]
        )
    assert "too large" in result.stderr
    assert list(out.parent.iterdir()) == [out]


def test_what_tables_are_made_from_is_on_the_disk_of_the_tables(
    recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where temporary files are memory, a recording of hours filled that; a kill left it."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "none"))
    out = tmp_path / "tables"
    asked = ("--participant", "P01", "--speed", "50", "--force", "1", "--texture")
    result = CliRunner().invoke(
        app, ["export", str(recording), "--to", "mat", "--out", str(out), *asked]
    )
    assert "holds no trial that can be used" in result.stderr
    assert set(tmp_path.iterdir()) == {recording}
