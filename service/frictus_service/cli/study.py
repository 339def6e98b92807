"""`frictus study`: what is in a study file."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from frictus_service.cli.exits import Exit
from frictus_service.cli.lines import write_line
from frictus_service.cli.options import AsJson, wants_lines

if TYPE_CHECKING:
    from rich.console import Console

    from frictus_service.study.summary import StudyContents

study = typer.Typer(no_args_is_help=True, help="Look into study files.")


@study.command()
def show(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Study file, or a folder.")],
    check: Annotated[
        bool,
        typer.Option(
            "--check",
            help="Read all data too: damage, copies, missing samples; 6 if a trial is bad.",
        ),
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Show who did what in FILE, and which trials cannot be used."""
    from frictus_service.study.importers import open_study
    from frictus_service.study.summary import summarise

    with open_study(file) as opened:
        summary = summarise(opened, size_of(file), check=check)
    if wants_lines(as_json):
        write_line(file=str(file), **summary.fields())
    else:
        from rich.console import Console

        print_summary(file, summary, Console())
    if check and summary.excluded:
        raise typer.Exit(Exit.CHECK_FAILED)


def size_of(path: Path) -> int:
    """Return the bytes of a file, or of all files in a folder."""
    files = (
        [path] if path.is_file() else [found for found in path.rglob("*") if found.is_file()]
    )
    return sum(found.stat().st_size for found in files)


def print_summary(file: Path, summary: "StudyContents", console: "Console") -> None:
    """Print a study as tables: participants, conditions, and what is wrong."""
    from rich.table import Table

    info = summary.info
    console.print(
        f"{file}: {summary.n_trials} trials, {summary.duration_s:.0f} s, "
        f"{summary.size_bytes / 1e6:.1f} MB; rig {info.rig}, carrier {info.carrier_hz:g} Hz, "
        f"screen peak {info.screen_peak_v:g} V, {'with' if info.mount else 'no'} mount",
        markup=False,
        soft_wrap=True,
    )
    for name, value in info.extras.items():
        console.print(f"{name} = {value}", markup=False)
    people = Table("participant", "sessions", "trials", "of these blank", "duration / s")
    for one in summary.participants:
        counts = (one.sessions, one.trials, one.blanks, round(one.duration_s))
        people.add_row(one.name, *map(str, counts))
    console.print(people)
    conditions = Table("condition", "values (trials)")
    for name, values in summary.conditions.items():
        listed = ", ".join(f"{value:g} ({count})" for value, count in values.items())
        conditions.add_row(name, listed)
    console.print(conditions)
    _print_faults(summary, console)


def _print_faults(summary: "StudyContents", console: "Console") -> None:
    for one in summary.excluded:
        told = f"excluded: trial {one.trial}, {one.field}: {one.reason}"
        console.print(told, markup=False, soft_wrap=True)
    if summary.missing is None:
        console.print("missing samples: not looked for; --check reads all data")
        return
    for trial, counts in summary.missing.items():
        told = ", ".join(f"{count} in {name}" for name, count in counts.items())
        console.print(f"missing samples: trial {trial}: {told}", markup=False, soft_wrap=True)
    if not summary.missing:
        console.print("missing samples: none")
