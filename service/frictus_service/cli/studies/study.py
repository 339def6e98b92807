"""`frictus study` and `export`: what is in a study file, and other programs' formats."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from frictus_service.cli.options import AsJson, Exit, check_out_folder, wants_lines, write_line

if TYPE_CHECKING:
    from rich.console import Console

    from frictus_service.errors import Exclusion
    from frictus_service.recording.segments import TrialDeclaration
    from frictus_service.study.summary import StudyContents


study = typer.Typer(no_args_is_help=True, help="Look into study files.")


@study.command()
def show(
    files: Annotated[
        list[Path],
        typer.Argument(
            metavar="FILE...", help="Study file, folder, or recording with a column map."
        ),
    ],
    check: Annotated[
        bool,
        typer.Option(
            "--check",
            help="Read all data too: damage, copies, missing samples; 6 if a trial is bad.",
        ),
    ] = False,
    friction: Annotated[
        bool,
        typer.Option(
            "--friction",
            help="Show friction coefficient, texture, stick-slip without a drive instead.",
        ),
    ] = False,
    map_file: Annotated[
        Path | None,
        typer.Option("--map", metavar="MAP", help="Column map of recordings, for --friction."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Show who did what in FILE, and which trials cannot be used."""
    if friction:
        from frictus_service.cli.studies.friction import show_friction

        show_friction(files, map_file, as_json)
        return
    for file in files:
        _show_one(file, check, as_json)


def _show_one(file: Path, check: bool, as_json: bool) -> None:
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
    from rich.markup import escape
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
        people.add_row(escape(one.name), *map(str, counts))
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


Format = Literal["h5", "mat", "parquet", "nwb", "replay", "foxglove"]


def export(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Recording, or a study.")],
    to: Annotated[
        Format,
        typer.Option("--to", help="Study; MATLAB; Parquet; for an archive; a rig; to plot."),
    ] = "h5",
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="PATH", help="File, or folder for mat, parquet and nwb."),
    ] = None,
    participant: Annotated[
        str | None, typer.Option("--participant", help="Pseudonym.  [default: the recording's]")
    ] = None,
    session: Annotated[
        int, typer.Option("--session", min=0, help="Number of the session.")
    ] = 1,
    speed: Annotated[
        float | None, typer.Option("--speed", min=0.0, help="Asked for, mm/s.")
    ] = None,
    force: Annotated[
        float | None, typer.Option("--force", min=0.0, help="Asked for, N.")
    ] = None,
    tone: Annotated[
        list[float] | None,
        typer.Option("--tone", min=0.0, help="Hz, as often as there are; 0: nothing played."),
    ] = None,
    texture: Annotated[
        bool, typer.Option("--texture", help="A texture was played, or noise: no tones.")
    ] = False,
    begin: Annotated[
        float | None, typer.Option("--from", min=0.0, help="Begin there, s.")
    ] = None,
    end: Annotated[float | None, typer.Option("--until", min=0.0, help="End there, s.")] = None,
    mount: Annotated[
        str, typer.Option("--mount", metavar="paper|none|FILE", help="Under the screen.")
    ] = "paper",
    touch_latency: Annotated[
        float | None,
        typer.Option("--touch-latency", min=0.0, help="s, where an old recording has none."),
    ] = None,
    licence: Annotated[
        str | None,
        typer.Option("--licence", metavar="SPDX", help="Of the data, for nwb: CC-BY-4.0."),
    ] = None,
    age: Annotated[
        str | None,
        typer.Option("--age", metavar="P18Y/P65Y", help="Of all participants, for nwb."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Write FILE as a study, MATLAB files, Parquet tables, for an archive, a rig, or plots.

    Guided trials of a recording become trials; a recording in which nobody was guided is one
    trial, of which --participant, --speed, --force and --tone or --texture have to be said.
    """
    from frictus_service.recording.segments import TrialDeclaration

    if (licence, age) != (None, None) and to != "nwb":
        raise typer.BadParameter("--licence and --age go with --to nwb")
    card = {"licence": licence, "age": age}
    path = out or _beside(file, to)
    check_out_folder(path.parent, file)
    if to == "replay":
        _taped(file, path, begin, end, touch_latency, as_json)
        return
    if to == "foxglove":
        _plottable(file, path, begin, end, as_json)
        return
    if texture and tone:
        raise typer.BadParameter("--tone and --texture: one of them was played")
    tones = None if tone is None else tuple(hz for hz in tone if hz > 0.0)
    declared = TrialDeclaration(participant, session, speed, force, tones, begin, end, texture)
    if file.suffix != ".mcap":
        trials, excluded = _converted(file, to, path, card)
        told = ""
    else:
        trials, excluded, told = _recorded(file, to, path, declared, mount, card)
    _tell(path, trials, excluded, told, as_json)


def _beside(file: Path, to: Format) -> Path:
    endings = {"h5": ".h5", "replay": ".npz", "foxglove": "_foxglove.mcap"}
    return file.with_name(f"{file.stem}{endings.get(to, f'_{to}')}")


def _recorded(
    file: Path,
    to: Format,
    path: Path,
    declared: "TrialDeclaration",
    mount: str,
    card: dict[str, str | None],
) -> tuple[int, "tuple[Exclusion, ...]", str]:
    """Export a recording; return how many trials, what was left out, and how it ends."""
    from frictus_service.durable import scratch_beside
    from frictus_service.recording.export import export_study
    from frictus_service.study.trial import read_mount

    if to == "h5":
        done = export_study(file, path, declared, read_mount(mount))
        return len(done.trials), done.excluded, str(done.ending)
    with scratch_beside(path) as folder:
        study = folder / "study.h5"
        done = export_study(file, study, declared, read_mount(mount))
        trials, more = _converted(study, to, path, card)
    return trials, (*done.excluded, *more), str(done.ending)


def _taped(
    file: Path,
    path: Path,
    begin: float | None,
    end: float | None,
    touch_latency_s: float | None,
    as_json: bool,
) -> None:
    """Export a recording to be played as a rig, and tell what came of it."""
    from frictus_service.recording.tape import export_tape

    done = export_tape(file, path, begin, end, touch_latency_s)
    if wants_lines(as_json):
        write_line(
            out=str(path),
            seconds=done.seconds,
            missing_samples=done.missing,
            ending=str(done.ending),
        )
        return
    sys.stdout.write(f"{path}: {done.seconds:.2f} s, {done.missing} samples missing\n")
    sys.stdout.write(f"the recording {done.ending}\n")


def _plottable(
    file: Path, path: Path, begin: float | None, end: float | None, as_json: bool
) -> None:
    """Export a recording for Foxglove or Lichtblick, with a layout beside it."""
    from frictus_service.durable import replace_file
    from frictus_service.recording.foxglove import LAYOUT, export_foxglove

    done = export_foxglove(file, path, begin, end)
    layout = path.with_name("frictus_layout.json")
    if not layout.exists():  # that of an earlier export may have been changed since
        replace_file(layout, LAYOUT.read_bytes())
    if wants_lines(as_json):
        write_line(
            out=str(path),
            layout=str(layout),
            messages=done.messages,
            ending=str(done.ending),
        )
        return
    sys.stdout.write(f"{path}: {done.messages} messages; layout to import: {layout}\n")
    sys.stdout.write(f"the recording {done.ending}\n")


def _converted(
    file: Path, to: Format, path: Path, card: dict[str, str | None]
) -> tuple[int, "tuple[Exclusion, ...]"]:
    """Export a study; return how many trials, and what was left out."""
    from frictus_service.study.archive import export_archive
    from frictus_service.study.export import export_matlab, export_parquet
    from frictus_service.study.importers import open_study

    if to == "h5":
        raise typer.BadParameter(f"{file} is a study already: --to mat, parquet or nwb")
    with open_study(file) as study:
        if to == "nwb":
            excluded = export_archive(study, path, **card)
        else:
            excluded = (export_matlab if to == "mat" else export_parquet)(study, path)
        left_out = {one.trial for one in excluded}
        return sum(info.id not in left_out for info in study.trials), excluded


def _tell(
    path: Path, trials: int, excluded: "tuple[Exclusion, ...]", ending: str, as_json: bool
) -> None:
    if wants_lines(as_json):
        left_out = [
            {"trial": one.trial, "field": one.field, "reason": one.reason} for one in excluded
        ]
        write_line(out=str(path), trials=trials, excluded=left_out, ending=ending)
        return
    sys.stdout.write(f"{path}: {trials} trials\n")
    for one in excluded:
        sys.stdout.write(f"left out: trial {one.trial}, {one.field}: {one.reason}\n")
    if ending:
        sys.stdout.write(f"the recording {ending}\n")
