"""Trials as a BIDS table of events with its sidecar.

Brain Imaging Data Structure 1.10, "Task events": tab-separated, first columns `onset` and
`duration` in seconds, `n/a` where a value is missing, every column described in JSON.
"""

import json
import os
import secrets
from itertools import chain, count
from pathlib import Path
from typing import Any, Final

from frictus.errors import ArgumentError
from frictus.experiment.procedures.schedule import NOT_FELT
from frictus.files import inert_cell

COLUMNS: Final[dict[str, dict[str, Any]]] = {
    "onset": {
        "Description": "Begin of the first interval since that of the first trial",
        "Units": "s",
    },
    "duration": {"Description": "To the end of the last interval", "Units": "s"},
    "trial_type": {
        "Description": "What the trial is for",
        "Levels": {
            "practice": "practice, not counted",
            "catch": "catch trial",
            "main": "trial of the procedure",
            "not felt": "without contact or motion of the finger: not counted, presented again",
        },
    },
    "response_time": {"Description": "From the end of the last interval", "Units": "s"},
    "sample": {"Description": "Device sample of the onset, as recordings count; per `run`"},
    "last_sample": {"Description": "Device sample of the end"},
    "run": {"Description": "Run of the rig; samples begin again with each"},
    "recording": {"Description": "Name of the recording made meanwhile"},
    "trial": {"Description": "Number of the trial"},
    "condition": {"Description": "Name of the condition"},
    "order": {"Description": "What each interval presented"},
    "level": {"Description": "Level asked for; 0 where no test was presented"},
    "level_rendered": {"Description": "Level as rendered; 0 where no test was presented"},
    "unit": {"Description": "Of both levels: N, dB, or the number of a pair of textures"},
    "gain": {"Description": "Least gain applied to an interval; below 1 it was scaled"},
    "response": {"Description": "Answer"},
    "correct": {"Description": "1 where it was right, 0 where it was wrong"},
    "flags": {"Description": "What an analysis must know of the trial"},
    "speed_mm_s": {"Description": "Mean speed of the finger in contact", "Units": "mm/s"},
    "path_mm": {"Description": "Way of the finger in contact, all intervals", "Units": "mm"},
    "normal_force_n": {"Description": "Mean normal force in contact", "Units": "N"},
}


def event_rows(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the answered trials of a log as rows of the table; None where a value is missing.

    Parameters
    ----------
    rows : list of dict
        Of a log.

    Raises
    ------
    ArgumentError
        If a row lacks what a trial has.
    """
    kept = ("answered", NOT_FELT)
    trials = [row for row in rows if row.get("status") in kept and row.get("intervals")]
    try:
        start_ns = trials[0]["intervals"][0]["utc_ns"] if trials else 0
        return [_event(row, start_ns) for row in trials]
    except (LookupError, TypeError, ValueError, OverflowError) as error:
        raise ArgumentError(f"a row of the log is no trial: {error!r}") from error


def _event(row: dict[str, Any], start_ns: int) -> dict[str, Any]:
    intervals = row["intervals"]
    first, last = intervals[0], intervals[-1]
    fingers = [each["finger"] for each in intervals if each["finger"] is not None]
    onset_s = 1e-9 * (first["utc_ns"] - start_ns)
    end_s = 1e-9 * (last["utc_ns"] - start_ns) + last["duration_s"]
    path_mm = sum(float(finger["path_mm"]) for finger in fingers)

    def mean(name: str) -> float | None:
        values = [float(finger[name]) for finger in fingers]
        return round(sum(values) / len(values), 4) if values else None

    kind = "practice" if row["phase"] == "practice" else "catch" if row["catch"] else "main"
    return {
        "onset": round(onset_s, 6),
        "duration": round(end_s - onset_s, 6),
        "trial_type": NOT_FELT if row["status"] == NOT_FELT else kind,
        "response_time": row["response_s"],
        "sample": first["first_sample"],
        "last_sample": last["last_sample"],
        "run": first["run"],
        "recording": row["recording"],
        "trial": row["trial"],
        "condition": row["condition"],
        "order": "+".join(row["order"]),
        "level": row["level"],
        "level_rendered": row["level_rendered"],
        "unit": row["unit"],
        "gain": min(each["applied"]["gain"] for each in intervals),
        "response": row["response"],
        "correct": None if row["correct"] is None else int(row["correct"]),
        "flags": "+".join(row["flags"]) or None,
        "speed_mm_s": mean("speed_mm_s"),
        "path_mm": round(path_mm, 4) if fingers else None,
        "normal_force_n": mean("normal_force_n"),
    }


def events_table(rows: list[dict[str, Any]]) -> str:
    """Return the answered trials of a log as tab-separated text, columns named first.

    Parameters
    ----------
    rows : list of dict
        Of a log.

    Raises
    ------
    ArgumentError
        If a row lacks what a trial has.
    """
    lines = ["\t".join(COLUMNS)]
    lines += ["\t".join(_cell(row[name]) for name in COLUMNS) for row in event_rows(rows)]
    return "\n".join(lines) + "\n"


def write_events(rows: list[dict[str, Any]], folder: str | Path) -> tuple[Path, Path]:
    """Write ``sub-P_task-NAME_events.tsv`` and its JSON sidecar.

    A table that begins this one is replaced: fewer trials of the same log. One of another log
    is kept, and this one is called ``sub-P_task-NAME_run-2_events.tsv``, or by the next number.

    Parameters
    ----------
    rows : list of dict
        Of a log, its header first.
    folder : str or Path
        Is made where it does not exist.

    Returns
    -------
    table, sidecar : Path
        The files.

    Raises
    ------
    ArgumentError
        If the rows are not of a log.
    """
    if not rows or not isinstance(protocol := rows[0].get("protocol"), dict):
        raise ArgumentError("these rows have no header of a log")
    # BIDS labels are letters and digits; both end in a name of a file.
    labels = [
        "".join(letter for letter in str(value)[:60] if letter.isascii() and letter.isalnum())
        for value in (rows[0].get("participant"), protocol.get("name"))
    ]
    content = events_table(rows)
    path = Path(folder)
    path.mkdir(parents=True, exist_ok=True)
    table = _own_table(path, f"sub-{labels[0]}_task-{labels[1]}", content)
    sidecar = table.with_suffix(".json")
    described = {**COLUMNS, "StimulusPresentation": {"SoftwareName": "frictus"}}
    _write_whole(sidecar, json.dumps(described, indent=2) + "\n")
    _write_whole(table, content)
    return table, sidecar


def _write_whole(path: Path, text: str) -> None:
    """Write a file over what stands there; whoever is killed meanwhile leaves that."""
    beside = path.with_name(f".{path.name[:48]}.{secrets.token_hex(4)}.tmp")
    try:
        beside.write_text(text, encoding="utf-8", newline="\n")
        os.replace(beside, path)
    except BaseException:
        beside.unlink(missing_ok=True)
        raise


def _own_table(folder: Path, stem: str, content: str) -> Path:
    """Return the first file that is not there, or that these trials begin with."""
    tables = chain([f"{stem}_events.tsv"], (f"{stem}_run-{n}_events.tsv" for n in count(2)))
    return next(
        table
        for table in map(folder.joinpath, tables)
        if not table.exists() or content.encode().startswith(table.read_bytes())
    )


def _cell(value: Any) -> str:
    """Return a cell; a tab or a line end in a text would break the table."""
    return "n/a" if value is None else inert_cell(" ".join(str(value).split()))
