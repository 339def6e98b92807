"""`frictus recover`: a finished file from a torn recording."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from frictus_service.cli.lines import write_line
from frictus_service.cli.options import AsJson, wants_lines


def recover(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Torn recording; is kept.")],
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE", help="[default: FILE with .recovered.mcap]"),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Write all that can be trusted of FILE as a finished recording, and say what is lost."""
    from frictus_service.recording.recover import recover as run

    path = out or file.with_suffix(".recovered.mcap")
    summary = run(file, path)
    if wants_lines(as_json):
        write_line(out=str(path), **summary.fields())
    else:
        sys.stdout.write(f"{path}: {summary.ending.clean_s:.2f} s\n{file} {summary.ending}\n")
