"""What an export makes stays no longer than it must."""

import asyncio
import os
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

import h11
import pytest
from starlette.types import Message

from frictus_service.api.routes import recordings
from frictus_service.durable import LEFT_S


def test_who_takes_it_too_slowly_holds_no_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recordings, "TAKE_S", 0.0)
    monkeypatch.setattr(recordings, "SLOWEST_BYTES_S", 1e9)
    path = tmp_path / "pilot.h5"
    path.write_bytes(b"trials")
    answer = recordings.ExportResponse(path)
    answer.until_sent = ExitStack()
    answer.until_sent.callback(path.unlink)
    sent: list[Message] = []

    async def receive() -> Message:
        raise AssertionError

    async def send(message: Message) -> None:
        sent.append(message)
        await asyncio.Event().wait()  # it takes no more

    scope = {
        "type": "http",
        "method": "GET",
        "path": "/pilot.h5",
        "headers": [],
        "asgi": {"spec_version": "2.4"},
    }
    asyncio.run(answer(scope, receive, send))
    assert not path.exists()
    assert [message["type"] for message in sent] in ([], ["http.response.start"])


def test_what_a_killed_service_left_is_removed_a_day_later(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    for name, age_s in (
        ("frictus-export-old", LEFT_S + 60.0),
        ("frictus-export-new", 0.0),
        ("of-another-program", LEFT_S + 60.0),
    ):
        folder = tmp_path / name
        folder.mkdir()
        (folder / "pilot.h5").write_bytes(b"trials")
        at_s = time.time() - age_s
        os.utime(folder, (at_s, at_s))
    recordings.remove_left_exports()
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "frictus-export-new",
        "of-another-program",
    ]
    assert (tmp_path / "of-another-program" / "pilot.h5").exists()


def test_a_recording_that_is_shortened_while_it_is_sent_is_no_fault_of_ours(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "pilot.mcap"
    path.write_bytes(b"blocks" * 100_000)
    wire = h11.Connection(h11.SERVER)
    wire.receive_data(b"GET /pilot.mcap HTTP/1.1\r\nHost: here\r\n\r\n")
    wire.next_event()

    async def receive() -> Message:  # it stays connected
        await asyncio.Event().wait()
        raise AssertionError

    async def send(message: Message) -> None:
        if message["type"] == "http.response.start":
            wire.send(h11.Response(status_code=200, headers=message["headers"]))
            os.truncate(path, 1_000)
            return
        wire.send(h11.Data(data=message["body"]))
        if not message["more_body"]:
            wire.send(h11.EndOfMessage())

    scope = {"type": "http", "method": "GET", "headers": [], "extensions": {}}
    asyncio.run(recordings.RecordingResponse(path)(scope, receive, send))
    assert "pilot.mcap was shortened while it was sent" in caplog.text
