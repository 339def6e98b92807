"""Changes of a model are written down whole, also by a disk that was full meanwhile."""

import json
import os
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from tests.rig_status import rig_status

from frictus.messages import LawValues, ModelChange, ModelState
from frictus_service.calibration.coordinates import Prior
from frictus_service.synthesis.compensability import placeholder_model
from frictus_service.tracking.audit import ModelChangeLog
from frictus_service.tracking.live import LiveTracker

MODEL = placeholder_model()
LAW = LawValues(gain_n=0.4, cutoff_20_hz=600.0, cutoff_100_hz=1_600.0)


def add(log: ModelChangeLog, reason: str) -> None:
    change = ModelChange(
        utc_ns=1, etag_before="m0", etag_after="m1", before=LAW, after=LAW, reason=reason
    )
    log.add(rig_status(), change, MODEL, MODEL)


def reasons(path: Path) -> list[str]:
    return [json.loads(line)["reason"] for line in path.read_text().splitlines()]


@pytest.mark.parametrize("torn", [b'{"site":', b'{"site": "' + b"x" * 50_000])
def test_a_line_that_a_crash_tore_spoils_no_other(tmp_path: Path, torn: bytes) -> None:
    path = tmp_path / "audit" / "changes.jsonl"
    log = ModelChangeLog(path)
    add(log, "first")
    with path.open("ab") as file:
        file.write(torn)
    add(log, "second")
    add(log, "third")
    assert reasons(path) == ["first", "second", "third"]


def test_of_what_the_disk_refuses_nothing_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "changes.jsonl"
    log = ModelChangeLog(path)
    add(log, "first")

    def refuse(_: int) -> None:
        raise OSError("no room")

    with monkeypatch.context() as full:
        full.setattr(os, "fsync", refuse)
        with pytest.raises(OSError, match="no room"):
            add(log, "second")
    assert reasons(path) == ["first"]
    add(log, "third")
    assert reasons(path) == ["first", "third"]


def test_a_disk_that_takes_it_again_gets_what_it_refused(tmp_path: Path) -> None:
    path = tmp_path / "folder" / "changes.jsonl"
    path.parent.write_text("in the way")
    feed = SimpleNamespace(drain=list, close=lambda: None)
    rig: Any = SimpleNamespace(name="rig1", status=rig_status, watch=lambda topic: feed)
    told: list[Any] = []
    with LiveTracker(rig, None, Prior.weak(), told.append, ModelChangeLog(path)) as live:
        live._note(ModelState(etag="m0", model=MODEL))
        live._note(ModelState(etag="m1", model=MODEL, adapted_from="m0", reason="because"))
        live._conclude()
        assert "cannot be written down" in told[-1].held_back
        path.parent.unlink()
        live._conclude()
    assert "cannot be written down" not in told[-1].held_back
    assert reasons(path) == ["because"]
