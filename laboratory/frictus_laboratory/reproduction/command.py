"""`frictus paper`: the paper's study, simulated and analysed blind."""

import os
import secrets
import sys
import tempfile
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

from rich.console import Console
from rich.table import Table

from frictus_laboratory.reproduction.paper import HEADINGS, markdown
from frictus_laboratory.reproduction.reproduce import (
    FULL,
    FULL_PARTICIPANTS,
    QUICK,
    QUICK_PARTICIPANTS,
    Reproduction,
    reproduce,
)
from frictus_service.cli.options import wants_lines, write_line


def paper(
    participants: int | None,
    full: bool,
    seconds: float | None,
    out: Path | None,
    seed: int | None,
    workers: int | None,
    as_json: bool,
) -> None:
    """Simulate, analyse and show, with progress on standard error.

    Parameters
    ----------
    participants : int or None
        None: as the paper has.
    full : bool
        All of the paper's conditions, as long as they were.
    seconds : float or None
        Recorded per trial.
    out : Path or None
        Folder that keeps the study, the identification and the table.
    seed : int or None
        None: a fresh one, which is told.
    workers : int or None
        Processes; 0: none but this one. None: one per processor.
    as_json : bool
        JSON lines instead of a table.
    """
    design = FULL if full else QUICK
    design = design if seconds is None else replace(design, seconds=seconds)
    people = participants or (FULL_PARTICIPANTS if full else QUICK_PARTICIPANTS)
    seed = secrets.randbits(32) if seed is None else seed
    workers = (os.cpu_count() or 1) if workers is None else workers
    _tell(f"seed {seed}")
    with tempfile.TemporaryDirectory() if out is None else nullcontext(out) as folder:
        path = Path(folder) / "study.h5"
        found = reproduce(path, design, people, seed, workers, _tell)
    if out is not None:
        (out / "identification.json").write_bytes(found.identification.to_json())
        (out / "table.md").write_text(markdown(found.rows), encoding="utf-8")
    if wants_lines(as_json):
        write_line(seed=seed, account=found.account, rows=[row.fields() for row in found.rows])
    else:
        _show(found, Console())


def _tell(line: str) -> None:
    sys.stderr.write(f"{line}\n")
    sys.stderr.flush()


def _show(found: Reproduction, console: Console) -> None:
    table = Table(title="frictus paper")
    for heading in HEADINGS:
        table.add_column(heading)
    for row in found.rows:
        table.add_row(*row.cells())
    console.print(table)
    console.print(found.account, highlight=False)
