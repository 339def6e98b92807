"""The folder of recordings over REST: what is listed, and what is served of it."""

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fastapi.responses import FileResponse
from fastapi.testclient import TestClient
from mcap.writer import Writer
from tests.service.recording.known import info
from tests.service.recording.test_export import STATUS, UTC_NS, Tape, value

from frictus_service.api.routes.recordings import _notes
from frictus_service.recording import course, summary
from frictus_service.recording.writer import RecordingWriter

Serve = Callable[..., TestClient]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    made = tmp_path / "recordings"
    made.mkdir()
    return made


@pytest.fixture
def api(folder: Path, serve: Serve) -> TestClient:
    return serve(recordings=folder)


def write(folder: Path, name: str, seconds: float | None = 2.5) -> bytes:
    """Write a finished file of that length; None: without any message."""
    path = folder / f"{name}.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start("frictus", "test")
        schema = writer.register_schema("state", "jsonschema", b"{}")
        channel = writer.register_channel("state/status", "json", schema)
        for at_s in () if seconds is None else (10.0, 10.0 + seconds):
            writer.add_message(channel, int(1e9 * at_s), b"{}", int(1e9 * at_s))
        writer.finish()  # type: ignore[no-untyped-call]
    return path.read_bytes()


def test_a_finished_one_is_listed_with_its_length_and_served_whole(
    api: TestClient, folder: Path
) -> None:
    content = write(folder, "pilot.1")
    (listed,) = api.get("/v1/recordings").json()["recordings"]
    assert (listed["name"], listed["bytes"], listed["finished"]) == (
        "pilot.1",
        len(content),
        True,
    )
    assert listed["seconds"] == pytest.approx(2.5)
    answer = api.get("/v1/recordings/pilot.1/recording.mcap")
    assert (answer.status_code, answer.content) == (200, content)
    assert 'filename="pilot.1.mcap"' in answer.headers["content-disposition"]


def test_of_what_is_not_finished_no_length_is_known_and_nothing_is_served(
    api: TestClient, folder: Path
) -> None:
    content = write(folder, "whole")
    (folder / "torn.mcap").write_bytes(content[:-5])
    write(folder, "empty", seconds=None)
    # It ends as a finished one does, and holds nothing that could be read.
    (folder / "noise.mcap").write_bytes(b"\x07" * 200 + content[-8:])
    listed = {one["name"]: one for one in api.get("/v1/recordings").json()["recordings"]}
    assert {name for name, one in listed.items() if one["seconds"] is not None} == {"whole"}
    answer = api.get("/v1/recordings/torn/recording.mcap")
    assert (answer.status_code, answer.json()["code"]) == (409, "recording_conflict")
    assert "frictus recover" in answer.json()["detail"]


def test_a_long_folder_is_listed_in_part(api: TestClient, folder: Path) -> None:
    for number in range(3):
        write(folder, f"r{number}")
    listed = api.get("/v1/recordings", params={"most": 2}).json()
    assert (len(listed["recordings"]), listed["left_out"]) == (2, 1)
    assert api.get("/v1/recordings").json()["left_out"] == 0
    assert api.get("/v1/recordings", params={"most": 0}).status_code == 422


@pytest.mark.parametrize(
    "name", ["..", "....", "%2e%2e", "..%2Fsecret", "%2Fetc%2Fpasswd", "a%00"]
)
def test_nothing_outside_of_the_folder_is_served(
    name: str, api: TestClient, folder: Path
) -> None:
    write(folder.parent, "secret")
    answer = api.get(f"/v1/recordings/{name}/recording.mcap")
    assert answer.status_code in (404, 422)


def test_a_link_that_leads_elsewhere_is_no_recording(api: TestClient, folder: Path) -> None:
    write(folder.parent, "secret")
    try:
        (folder / "linked.mcap").symlink_to(folder.parent / "secret.mcap")
    except OSError:
        pytest.skip("this system makes no links")
    answer = api.get("/v1/recordings/linked/recording.mcap")
    assert (answer.status_code, answer.json()["code"]) == (404, "no_recording")


@pytest.fixture
def taped(folder: Path) -> Path:
    """A recording of 3 s of a rig, in which nobody was guided."""
    path = folder / "taped.mcap"
    status = STATUS.model_copy(update={"touch_latency_s": 0.03})
    attached = {"status.json": status.to_json()}
    with RecordingWriter(path, info("taped"), attached, lambda: 0.0) as writer:
        tape = Tape(writer)
        tape.play(1.0)
        tape.lose(20)
        tape.play(1.9)
        writer.end("asked for", UTC_NS)
    return path


def test_how_one_went_is_told_in_columns(api: TestClient, taped: Path) -> None:
    answer = api.get("/v1/recordings/taped/course")
    assert answer.status_code == 200, answer.text
    told = answer.json()
    assert told["ending"].startswith("complete")
    signals = {one["name"]: one for one in told["signals"]}
    force = signals["normal_force"]
    assert force["unit"] == "N"
    assert len(force["low"]) == len(force["high"]) > 100
    assert None in force["low"]
    assert {None} == set(signals["speed"]["low"])
    assert "force are missing" in told["events"][0]["what"]


def test_one_is_exported_to_be_played_as_a_rig(
    api: TestClient, taped: Path, tmp_path: Path
) -> None:
    answer = api.get("/v1/recordings/taped/export/replay")
    assert answer.status_code == 200, answer.text
    assert 'filename="taped.npz"' in answer.headers["content-disposition"]
    assert "samples that are missing: 200" in answer.headers["frictus-notes"]
    (tmp_path / "got.npz").write_bytes(answer.content)
    with np.load(tmp_path / "got.npz") as tape:
        np.testing.assert_allclose(
            tape["force"][:200] * tape["force_step_n"], value(1, 0, 200).T, atol=1e-6
        )
    assert sorted(path.name for path in taped.parent.iterdir()) == ["taped.mcap"]


@pytest.mark.parametrize("part", ["", "bytes=abc", "bytes=999999999-", "bytes=0-99"])
def test_of_an_export_nothing_stays_and_its_place_is_free(
    part: str, api: TestClient, taped: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    exports = api.app.state.limits.exports  # type: ignore[attr-defined]
    seen, call = [], FileResponse.__call__

    async def sent(self: FileResponse, *given: Any) -> None:
        seen.append(exports._taken.total())
        await call(self, *given)

    monkeypatch.setattr(FileResponse, "__call__", sent)
    answer = api.get("/v1/recordings/taped/export/replay", headers={"Range": part})
    assert answer.status_code in (200, 206, 416)
    assert list(tmp_path.glob("frictus-export-*")) == []
    assert (seen, exports._taken.total()) == ([1], 0)


@pytest.mark.parametrize(
    "part", ["", "abc", "bytes=abc", "lines=1-2", "bytes=9-1", "bytes=99999999-"]
)
@pytest.mark.parametrize(
    "path",
    [
        "/v1/recordings/taped/recording.mcap",
        "/dashboard/",
        "/v1/recordings/taped/export/replay",
    ],
)
def test_a_range_that_a_file_does_not_have_is_a_problem(
    api: TestClient, taped: Path, path: str, part: str
) -> None:
    answer = api.get(path, headers={"Range": part})
    assert answer.status_code == 416
    assert answer.headers["content-type"] == "application/problem+json"
    told = answer.json()
    assert (told["code"], told["instance"]) == ("bad_range", path)
    assert "bytes=FIRST-LAST" in told["detail"]


def test_notes_are_one_line_that_a_header_can_hold() -> None:
    told = _notes({"ending": "torn\r\nSet-Cookie: a\0b\x1b[2J é"})
    assert told == "torn Set-Cookie: a b [2J ?"


def test_what_cannot_become_a_study_is_told_in_the_words_of_the_command(
    api: TestClient, taped: Path
) -> None:
    answer = api.get("/v1/recordings/taped/export/study")
    assert (answer.status_code, answer.json()["code"]) == (422, "bad_request")
    assert "--speed" in answer.json()["detail"]
    assert str(taped.parent) not in answer.json()["detail"]
    assert api.get("/v1/recordings/taped/export/mp3").status_code == 422


@pytest.mark.parametrize("form", ["course", "export/study", "export/replay"])
def test_what_is_not_there_or_not_finished_has_no_other_form(
    form: str, api: TestClient, folder: Path
) -> None:
    content = write(folder, "whole")
    (folder / "torn.mcap").write_bytes(content[:-5])
    (folder / "noise.mcap").write_bytes(b"\x07" * 200 + content[-8:])
    for name, accepted in (
        ("nothing", {(404, "no_recording")}),
        ("torn", {(409, "recording_conflict")}),
        ("noise", {(409, "recording_conflict"), (422, "bad_request")}),
        ("whole", {(409, "recording_conflict"), (422, "bad_request")}),  # of another program
    ):
        answer = api.get(f"/v1/recordings/{name}/{form}")
        assert (answer.status_code, answer.json()["code"]) in accepted
        assert str(folder) not in answer.json()["detail"]


@pytest.mark.parametrize("asked", ["is_finished", "shelf_entry", "course_of"])
def test_one_that_is_deleted_while_it_is_looked_at_is_not_there(
    asked: str, api: TestClient, taped: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    module = course if asked == "course_of" else summary
    ask = getattr(module, asked)

    def deleted_before(path: Path, *more: Any) -> Any:
        taped.unlink()
        return ask(path, *more)

    monkeypatch.setattr(module, asked, deleted_before)
    answer = api.get("/v1/recordings/taped/course")
    assert (answer.status_code, answer.json()["code"]) == (404, "no_recording")
    assert "deleted or moved while" in answer.json()["detail"]
    assert str(taped.parent) not in answer.json()["detail"]
