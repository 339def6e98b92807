"""The log: whole rows survive whatever cuts it off; what is no log is refused."""

import signal
import sys
from pathlib import Path
from typing import Any

import pytest

from frictus import ArgumentError, NotLoggedError
from frictus.experiment import read_log, write_events
from frictus.experiment.events import COLUMNS, event_rows, events_table
from frictus.experiment.trial_log import FORMAT, TrialLog

HEADER: dict[str, Any] = {"format": FORMAT, "participant": "p/1", "protocol": {"name": "a-b"}}


def test_a_log_cut_at_any_byte_keeps_its_whole_rows(tmp_path: Path) -> None:
    file = tmp_path / "log.jsonl"
    with TrialLog(file) as log:
        for row in (HEADER, {"trial": 1}, {"trial": 2, "text": "ä\n"}):
            log.append(row)
    content = file.read_bytes()
    for end in range(len(content) + 1):
        file.write_bytes(content[:end])
        whole = content[:end].count(b"\n")
        with TrialLog(file) as log:
            assert len(log.rows) == whole
            log.append(HEADER if whole == 0 else {"trial": 9})
        rows, size = read_log(file)
        assert len(rows) == whole + 1
        assert size == file.stat().st_size


@pytest.mark.parametrize(
    "content",
    [b"{}\n", b"[]\n", b"{\n", b'{"format": "x"}\n', b"\xff\n", b"[" * 100_000 + b"\n"],
)
def test_what_is_no_log_is_refused_and_left_alone(content: bytes, tmp_path: Path) -> None:
    file = tmp_path / "log.jsonl"
    file.write_bytes(content)
    with pytest.raises(ArgumentError, match="log"):
        TrialLog(file)
    assert file.read_bytes() == content


def test_nan_is_not_written(tmp_path: Path) -> None:
    with TrialLog(tmp_path / "log.jsonl") as log, pytest.raises(ValueError, match="JSON"):
        log.append({"x": float("nan")})
    assert not (tmp_path / "log.jsonl").read_bytes()


@pytest.mark.skipif(sys.platform == "win32", reason="Windows keeps a file that is open")
def test_a_log_that_is_taken_away_takes_no_trials(tmp_path: Path) -> None:
    file, elsewhere = tmp_path / "log.jsonl", tmp_path / "elsewhere.jsonl"
    with TrialLog(file) as log:
        log.append(HEADER)
        file.rename(elsewhere)
        with pytest.raises(NotLoggedError, match="deleted, moved or replaced"):
            log.append({"trial": 1})
        file.write_bytes(elsewhere.read_bytes())  # a copy: what is open is the other one
        with pytest.raises(NotLoggedError, match="deleted, moved or replaced"):
            log.append({"trial": 1})
        elsewhere.replace(file)
        log.append({"trial": 1})
    assert read_log(file)[0] == [HEADER, {"trial": 1}]


@pytest.mark.skipif(not hasattr(signal, "SIGXFSZ"), reason="Windows has no limit of file sizes")
def test_a_row_that_the_disk_does_not_take_leaves_the_log_whole(tmp_path: Path) -> None:
    import resource

    file = tmp_path / "log.jsonl"
    unlimited = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    with TrialLog(file) as log:
        log.append(HEADER)
        whole = file.read_bytes()
        try:
            resource.setrlimit(resource.RLIMIT_FSIZE, (len(whole) + 50, unlimited[1]))
            with pytest.raises(OSError, match="took 50 of"):
                log.append({"trial": 1, "text": "x" * 1_000})
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, unlimited)
            signal.signal(signal.SIGXFSZ, handler)
        assert file.read_bytes() == whole
        log.append({"trial": 1})
    assert read_log(file)[0] == [HEADER, {"trial": 1}]


def test_events_of_no_trials_are_a_table_all_the_same(tmp_path: Path) -> None:
    table, sidecar = write_events([HEADER], tmp_path / "new")
    assert table.name == "sub-p1_task-ab_events.tsv"
    assert table.read_text() == "\t".join(COLUMNS) + "\n"
    assert sidecar.with_suffix(".tsv") == table
    broken: dict[str, Any] = {"status": "answered", "intervals": [{}]}
    wrong: list[list[dict[str, Any]]] = [[], [{}], [HEADER, broken]]
    for rows in wrong:
        with pytest.raises(ArgumentError):
            write_events(rows, tmp_path)


def test_events_that_cannot_be_written_leave_what_stands_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A table of half the trials is one of the log, too: nobody would miss the others."""
    written = write_events([HEADER], tmp_path)
    before = [path.read_bytes() for path in written]

    def full(self: Path, *_: object, **__: object) -> int:
        self.write_bytes(b"half")
        raise OSError("no room")

    monkeypatch.setattr(Path, "write_text", full)
    with pytest.raises(OSError, match="no room"):
        write_events([HEADER], tmp_path)
    assert [path.read_bytes() for path in written] == before
    assert set(tmp_path.iterdir()) == set(written)


def test_the_way_of_a_trial_is_that_of_all_its_intervals() -> None:
    """Of 40 and 60 mm it was the mean, 50."""

    def interval(path_mm: float | None, speed_mm_s: float = 30.0) -> dict[str, Any]:
        finger = {"speed_mm_s": speed_mm_s, "path_mm": path_mm, "normal_force_n": 0.4}
        return {
            "finger": None if path_mm is None else finger,
            "utc_ns": 0,
            "duration_s": 1.0,
            "first_sample": 0,
            "last_sample": 1,
            "run": 1,
            "applied": {"gain": 1.0},
        }

    unused = "response_s recording trial condition level level_rendered response correct"
    trial: dict[str, Any] = dict.fromkeys(unused.split())
    trial |= {
        "unit": "dB",
        "status": "answered",
        "phase": "main",
        "catch": False,
        "order": [],
        "flags": [],
    }
    (row,) = event_rows([{**trial, "intervals": [interval(40.0), interval(60.0, 50.0)]}])
    assert (row["path_mm"], row["speed_mm_s"]) == (100.0, 40.0)
    named = {**trial, "recording": "=A1", "response": "-3", "intervals": [interval(40.0)]}
    cells = events_table([named]).splitlines()[1].split("\t")
    assert cells[list(COLUMNS).index("recording")] == "'=A1"
    assert cells[list(COLUMNS).index("response")] == "-3"
    (untouched,) = event_rows([{**trial, "intervals": [interval(None)]}])
    assert untouched["path_mm"] is None
    assert untouched["unit"] == "dB"  # of its levels: conditions may differ
    assert set(untouched) == set(COLUMNS)


def test_a_second_session_leaves_the_table_of_the_first(tmp_path: Path) -> None:
    def trial(answer: str) -> dict[str, Any]:
        unused = "response_s recording trial condition level level_rendered correct"
        interval = {
            "finger": None,
            "utc_ns": 0,
            "duration_s": 1.0,
            "first_sample": 0,
            "last_sample": 1,
            "run": 1,
            "applied": {"gain": 1.0},
        }
        return {
            **dict.fromkeys(unused.split()),
            "response": answer,
            "unit": "N",
            "status": "answered",
            "phase": "main",
            "catch": False,
            "order": [],
            "flags": [],
            "intervals": [interval],
        }

    first = [HEADER, trial("1")]
    tables = [
        write_events(rows, tmp_path)[0]
        for rows in (first, [HEADER, trial("2")], [*first, trial("1")], [HEADER, trial("3")])
    ]
    names = ["sub-p1_task-ab" + run for run in ("", "_run-2", "", "_run-3")]
    assert [table.name for table in tables] == [f"{name}_events.tsv" for name in names]
    assert len(tables[0].read_text().splitlines()) == 3
    assert len(list(tmp_path.glob("*.json"))) == 3
