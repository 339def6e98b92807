"""A study as a folder for an archive: NWB files, events, a data card and checksums.

The names are those of BIDS and DANDI, ``sub-P1/sub-P1_ses-01.nwb``, so that the folder can be
given to DANDI, OSF or 4TU as it is.
"""

import csv
import hashlib
import importlib.metadata
import itertools
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from frictus_service.durable import new_folder
from frictus_service.errors import Exclusion, StudyError
from frictus_service.study.importers import Study, read_all
from frictus_service.study.nwb import (
    COLUMNS,
    SIGNALS,
    begin_of,
    duration_of,
    label_of,
    onset_of,
    row_of_session,
    write_session,
)
from frictus_service.study.trial import Trial

CARD: Final = "README.md"
SUMS: Final = "SHA256SUMS"
_TIMES: Final = {
    "onset": "when the trial began, s from the begin of the session",
    "duration": "how long it lasted, s",
}


@dataclass(frozen=True, slots=True)
class _Session:
    name: str
    participant: str
    trials: int
    seconds: float


def export_archive(
    study: Study, folder: Path, licence: str | None = None, age: str | None = None
) -> tuple[Exclusion, ...]:
    """Write a study for an archive, one session in memory at a time.

    Parameters
    ----------
    study : Study
        Open.
    folder : Path
        Must not exist; it appears when everything is written.
    licence : str or None
        Under which the data may be used, by its SPDX name, such as ``CC-BY-4.0``; None: the
        card says that none has been given.
    age : str or None
        Of all participants, such as ``P18Y/P65Y``; None: the files and the card lack it, which
        archives mind.

    Returns
    -------
    tuple of Exclusion
        What was left out, and why; the card says so too.

    Raises
    ------
    StudyError
        If the folder exists, pynwb is not installed, the age is none, or two participants
        would have one name.
    """
    excluded: list[Exclusion] = []
    sessions: list[_Session] = []
    with new_folder(folder) as unfinished:
        kept = _usable(study, excluded)
        # In order of participant and session, as a study gives its trials.
        for (participant, number), group in itertools.groupby(kept, key=_session_of):
            label = label_of(participant)
            name = f"sub-{label}/sub-{label}_ses-{number:02d}"
            # Windows and macOS take P1 and p1 for one folder.
            if any(one.name.casefold() == name.casefold() for one in sessions):
                raise StudyError(f"two participants would be called {label!r}: rename one")
            trials = list(group)
            (unfinished / f"sub-{label}").mkdir(exist_ok=True)
            write_session(unfinished / f"{name}.nwb", study, trials, age)
            _write_events(unfinished / f"{name}_events", trials)
            seconds = sum(map(duration_of, trials))
            sessions.append(_Session(name, participant, len(trials), seconds))
        card = data_card(study, sessions, excluded, licence, age)
        (unfinished / CARD).write_text(card, encoding="utf-8", newline="\n")
        _write_sums(unfinished)
    return tuple(excluded)


def data_card(
    study: Study,
    sessions: Sequence[_Session],
    excluded: Sequence[Exclusion],
    licence: str | None,
    age: str | None,
) -> str:
    """Return what a stranger needs to know of the folder, in Markdown."""
    info, people = study.info, {session.participant for session in sessions}
    trials, seconds = sum(s.trials for s in sessions), sum(s.seconds for s in sessions)
    lines = [
        f"# Friction of fingers on the screen of {info.rig}",
        "",
        f"{len(people)} participants, {len(sessions)} sessions, {trials} trials, "
        f"{seconds:.0f} s. A finger slides over a screen whose friction is changed by "
        f"electrovibration: a carrier of {info.carrier_hz:g} Hz, full drive "
        f"{info.screen_peak_v:g} V at the screen.",
        "",
        f"- Licence: {licence or 'none has been given; ask before you use the data'}",
        f"- Written by frictus {importlib.metadata.version('frictus')} from a study whose "
        f"sha256 is {study.sha256}",
        f"- Age of the participants: {age or 'not given; archives ask for it'}",
        "- Participants have pseudonyms; sex and handedness are not in the study.",
        *(f"- {name}: {value}" for name, value in sorted(info.extras.items())),
        "",
        "## Files",
        "",
        "| file | trials | s |",
        "|---|---|---|",
        *(f"| {one.name}.nwb | {one.trials} | {one.seconds:.1f} |" for one in sessions),
        "",
        "Beside each stand its trials as `_events.tsv`, whose columns `_events.json` explains. "
        f"`{SUMS}` is checked by `sha256sum -c {SUMS}`.",
        "",
        "## Signals",
        "",
        "| in the NWB file | unit | what |",
        "|---|---|---|",
        *(f"| {name}_ORDER | {unit} | {what} |" for name, unit, what in SIGNALS.values()),
        "| position_ORDER | meters | Of the finger on the screen: x, y. |",
        "",
        "ORDER is that of the trial. A missing sample is NaN.",
        "",
        "## Left out",
        "",
        *(f"- trial {one.trial}, {one.field}: {one.reason}" for one in excluded),
    ]
    return "\n".join([*lines, *([] if excluded else ["Nothing."])]) + "\n"


def _usable(study: Study, excluded: list[Exclusion]) -> Iterator[Trial]:
    """Yield the trials that can be used; the others are added to `excluded`."""
    for found in read_all(study):
        if isinstance(found, Exclusion):
            excluded.append(found)
        else:
            yield found


def _session_of(trial: Trial) -> tuple[str, int]:
    return trial.info.participant, trial.info.session


def _write_events(stem: Path, trials: Sequence[Trial]) -> None:
    """Write the trials of a session as BIDS has events: a table, and what its columns are."""
    begun = begin_of(trials)
    with stem.with_name(f"{stem.name}.tsv").open("w", encoding="utf-8", newline="") as file:
        table = csv.DictWriter(file, [*_TIMES, *COLUMNS], delimiter="\t", lineterminator="\n")
        table.writeheader()
        for trial in sorted(trials, key=lambda one: onset_of(one, begun)):
            times = {"onset": onset_of(trial, begun), "duration": duration_of(trial)}
            table.writerow(times | row_of_session(trial))
    explained = {name: {"Description": what} for name, what in (_TIMES | COLUMNS).items()}
    text = json.dumps(explained, indent=2) + "\n"
    stem.with_name(f"{stem.name}.json").write_text(text, encoding="utf-8", newline="\n")


def _write_sums(folder: Path) -> None:
    lines = []
    for path in sorted(found for found in folder.rglob("*") if found.is_file()):
        with path.open("rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
        lines.append(f"{digest}  {path.relative_to(folder).as_posix()}\n")
    (folder / SUMS).write_text("".join(lines), encoding="utf-8", newline="\n")
