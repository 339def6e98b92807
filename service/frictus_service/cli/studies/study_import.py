"""`frictus study import`: recordings of other programs become a study, by a column map."""

import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from frictus_service.cli.options import AsJson, wants_lines, write_line

if TYPE_CHECKING:
    from frictus_service.data_import.column_map import ColumnMap
    from frictus_service.data_import.formats.columns import Columns
    from frictus_service.data_import.import_recordings import Imported
    from frictus_service.data_import.proposal import Proposal

MAX_ANSWERS = 200
MOST_SHOWN = 10
TOLD_BYTES = 50_000_000
"""A file that takes seconds to read."""
PACE_S = 2.0
"""Between two words on how far it is."""


def import_recordings(
    files: Annotated[
        list[Path],
        typer.Argument(metavar="FILE...", help="MATLAB, HDF5, CSV, TSV, WAV, Parquet, TDMS."),
    ],
    out: Annotated[Path, typer.Argument(metavar="OUT", help="Study file to write.")],
    map_file: Annotated[
        Path | None,
        typer.Option("--map", metavar="MAP", help="Column map of all files; asks nothing."),
    ] = None,
    entries: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="ENTRY=VALUE", help="Of the map, as force_x.unit=mN."),
    ] = None,
    accept: Annotated[
        bool, typer.Option("--yes", help="Accept what is proposed, where nothing is open.")
    ] = False,
    participant: Annotated[
        str | None, typer.Option("--participant", help="Pseudonym.  [default: the map's]")
    ] = None,
    session: Annotated[
        int | None,
        typer.Option(
            "--session", min=0, help="Number of the session.  [default: of the map, or 1]"
        ),
    ] = None,
    mount: Annotated[
        str,
        typer.Option("--mount", metavar="paper|none|FILE", help="Under the screen."),
    ] = "none",
    as_json: AsJson = False,
) -> None:
    """Write recordings FILE... as the study OUT: columns mapped to channels, cut into strokes.

    Without --map, the map beside FILE is used; where there is none, one is proposed from names,
    units and magnitudes, confirmed by you, and saved beside FILE. An entry that is open is
    asked for, never guessed.
    """
    from frictus_service.data_import.import_recordings import import_recordings as write
    from frictus_service.errors import StudyError
    from frictus_service.study.trial import read_mount

    if out.exists():
        raise StudyError(f"{out} exists; choose another name, or delete it first")
    under_screen = read_mount(mount)
    answers = list(entries or [])
    answers += [] if participant is None else [f"participant={_quoted(participant)}"]
    answers += [] if session is None else [f"session={session}"]
    maps = [(file, _map_of(file, map_file, answers, accept)) for file in files]
    done = write(maps, out, under_screen, _Paced())
    _show(out, done, as_json)


def _quoted(text: str) -> str:
    import json

    return json.dumps(text)


def _map_of(file: Path, map_file: Path | None, answers: list[str], accept: bool) -> "ColumnMap":
    """Return the map of a file: given, beside it, or proposed and confirmed."""
    from frictus_service.data_import.column_map import (
        changed,
        has_map,
        load_map,
        map_beside,
        save_map,
    )
    from frictus_service.data_import.formats.read import read_columns
    from frictus_service.data_import.proposal import propose, with_signs
    from frictus_service.data_import.response_table import find_response
    from frictus_service.errors import StudyError

    if file.is_dir():
        raise StudyError(f"{file} is a folder; give its files")
    beside = map_beside(file)
    if map_file is not None or has_map(file):
        return changed(load_map(map_file or beside), answers)
    _refuse_known_layouts(file)
    if (size_bytes := file.stat().st_size) > TOLD_BYTES:
        _tell(f"reading {file}, {1e-6 * size_bytes:.0f} MB")
    columns = read_columns(file)
    if find_response(columns) is not None:
        raise StudyError(
            f"{file} holds a frequency response and no samples: a study cannot hold it; "
            "frictus identify fits gain, cutoff and delay to it"
        )
    proposal = propose(columns, f"{file.resolve().parent.name}/{file.stem}")
    proposal = proposal.answered(changed(proposal.column_map, answers), answers)
    proposal = with_signs(columns, proposal)
    _describe(file, columns, proposal)
    confirmed = (
        _accepted(file, proposal) if accept else _confirmed(file, columns, proposal, answers)
    )
    try:
        save_map(confirmed, beside)
        _tell(f"saved as {beside}")
    except OSError as error:
        _tell(f"{beside} cannot be saved ({error}); keep it elsewhere, and give it with --map")
    return confirmed


def _refuse_known_layouts(file: Path) -> None:
    """Let an importer of the layout say that it is no recording for a map."""
    from frictus_service.errors import StudyError
    from frictus_service.study.importers import importers

    if not file.exists():
        raise FileNotFoundError(f"there is no file {file}")
    for importer in importers():
        if importer.recognises(file):
            with importer.open(file):
                raise StudyError(
                    f"{file} is a {importer.layout}, and every command takes it as it is"
                )


def _describe(file: Path, columns: "Columns", proposal: "Proposal") -> None:
    from frictus_service.data_import.recording import mapped_of
    from frictus_service.data_import.recordings_in_file import groups_of
    from frictus_service.errors import listed

    _tell(f"{file}: {columns.format}, {len(columns.columns)} columns")
    mapped = {each.column for each in proposal.column_map.channels.values()}
    for line in mapped_of(proposal.column_map):
        _tell(f"  {line}")
    parts = groups_of(columns).values() or [columns]
    names = dict.fromkeys(column.name for part in parts for column in part.columns)
    left = [name for name in names if name not in mapped]
    if left:
        _tell(f"  not used: {listed(left, MOST_SHOWN)}")
    for reason in proposal.reasons:
        _tell(f"  {reason}")


def _accepted(file: Path, proposal: "Proposal") -> "ColumnMap":
    from frictus_service.errors import StudyError

    if not proposal.questions:
        return proposal.column_map
    asked = "; ".join(question.sentence for question in proposal.questions)
    raise StudyError(
        f"{file}: open are {len(proposal.questions)}: {asked}. Answer by --set, or by a --map"
    )


def _confirmed(
    file: Path, columns: "Columns", proposal: "Proposal", answers: list[str]
) -> "ColumnMap":
    """Ask until nothing is open and the map is accepted; keep the answers for later files."""
    from frictus_service.data_import.column_map import changed
    from frictus_service.data_import.proposal import with_signs
    from frictus_service.data_import.recording import mapped_of
    from frictus_service.errors import StudyError

    for _ in range(MAX_ANSWERS):
        for question in proposal.questions:
            _tell(f"open: {question.sentence}")
        ends = "" if proposal.questions else ", or Enter to accept"
        try:
            answer = typer.prompt(
                f"ENTRY=VALUE, as force_x.sign=-1{ends}",
                default="",
                show_default=False,
                err=True,
            )
        except typer.Abort:
            _accepted(file, proposal)
            raise StudyError(
                f"{file}: nobody confirmed the map; --yes accepts it, --map gives another"
            ) from None
        if not answer.strip():
            if not proposal.questions:
                return proposal.column_map
            continue
        told = proposal.reasons
        try:
            proposal = proposal.answered(changed(proposal.column_map, [answer]), [answer])
        except StudyError as error:
            _tell(str(error))
            continue
        answers.append(answer)
        proposal = with_signs(columns, proposal)
        for line in (*mapped_of(proposal.column_map), *proposal.reasons[len(told) :]):
            _tell(f"  {line}")
    raise StudyError(f"{file}: {MAX_ANSWERS} answers, and the map is not accepted; use --map")


class _Paced:
    """Tells how far a long import is; of a short one nothing."""

    def __init__(self) -> None:
        self._told_s = time.monotonic()

    def __call__(self, line: str) -> None:
        if time.monotonic() - self._told_s >= PACE_S:
            self._told_s = time.monotonic()
            _tell(line)


def _tell(line: str) -> None:
    from frictus.errors import printable

    sys.stderr.write(f"{printable(line)}\n")
    sys.stderr.flush()


def _show(out: Path, done: "Imported", as_json: bool) -> None:
    if wants_lines(as_json):
        write_line(
            out=str(out),
            trials=done.trials,
            seconds=done.seconds,
            recorded_s=done.recorded_s,
            excluded=[
                {"trial": one.trial, "field": one.field, "reason": one.reason}
                for one in done.excluded
            ],
            notes=list(done.notes),
        )
        return
    sys.stdout.write(
        f"{out}: {done.trials} trials, {done.seconds:.1f} s of {done.recorded_s:.1f} s\n"
    )
    for one in done.excluded[:MOST_SHOWN]:
        sys.stdout.write(f"left out: trial {one.trial}, {one.field}: {one.reason}\n")
    if len(done.excluded) > MOST_SHOWN:
        sys.stdout.write(f"left out: {len(done.excluded) - MOST_SHOWN} more\n")
    for note in done.notes:
        sys.stdout.write(f"- {note}\n")
