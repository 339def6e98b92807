"""`frictus identify` and `mount`: from a study to models, from hammer blows to resonances."""

import json
import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from frictus_service.cli.options import (
    AsJson,
    Workers,
    check_out,
    check_out_folder,
    wants_lines,
    write_line,
    write_out,
)

if TYPE_CHECKING:
    from rich.console import Console

    from frictus_service.data_import.response_table import ResponseTable
    from frictus_service.discovery.ring_down import Resonance
    from frictus_service.identification.documents import EstimatedQuantity, Identification


MOST_SHOWN = 10
"""Excluded trials that are named on the terminal; the report names all."""


def identify(
    study: Annotated[
        Path, typer.Argument(metavar="STUDY", help="Study, folder, or response table.")
    ],
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="DIR", help="Where to.  [default: STUDY-identification]"),
    ] = None,
    workers: Workers = None,
    cluster: Annotated[
        str | None,
        typer.Option("--cluster", metavar="ADDR", help="dask scheduler to work on instead."),
    ] = None,
    no_cache: Annotated[
        bool, typer.Option("--no-cache", help="Neither read nor keep observations.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Identify friction and skin of everyone in STUDY: models, tests, report.

    STUDY may be a table of ready frequency responses too, of friction to drive: gain, cutoff
    and delay are fitted to it, without models or report.
    """
    from frictus_service.data_import.response_table import response_of
    from frictus_service.identification import analysis
    from frictus_service.identification.pipeline.study import OBSERVER, read_study, records_of
    from frictus_service.identification.plausibility.judge import judge_study
    from frictus_service.identification.report import page
    from frictus_service.study.importers import open_study

    if (table := response_of(study)) is not None:
        _identify_table(study, table, as_json)
        return
    folder = out or study.with_name(f"{study.stem}-identification")
    check_out_folder(folder, study)
    with open_study(study) as opened:
        sha256, unreadable = opened.sha256, opened.excluded
        simulated = opened.info.simulated
    readings = read_study(
        study,
        OBSERVER,
        workers=workers,
        cache=None if no_cache else folder / "observations",
        cluster=cluster,
        tell=_tell,
    )
    _tell("fitting")
    observations = [reading.observed for reading in readings]
    found = analysis.identify(
        observations,
        path=str(study),
        sha256=sha256,
        simulated=simulated,
        unreadable=unreadable,
        findings=judge_study(records_of(readings)),
    )
    _tell("writing the report")
    written = page.write(found, observations, folder)
    if wants_lines(as_json):
        write_line(**summary(found), files=[str(path) for path in written])
    else:
        from rich.console import Console

        show(found, folder, Console())


def _identify_table(path: Path, table: "ResponseTable", as_json: bool) -> None:
    from frictus_service.identification.fit.transfer_functions import fit_response

    found = fit_response(table.frequency_hz, table.response, table.coherence)
    notes = [
        "a table has neither trials nor people: the intervals hold for it alone, mount and "
        "hold are taken as removed, and no model is written",
        *table.notes,
    ]
    if found.delay_s.ci95 is not None and found.delay_s.ci95[1] < 0.0:
        notes.append(
            "the delay is below 0, and no response comes before its drive: drive and friction "
            "were not sampled at one time, or the response is not of first order; then gain "
            "and cutoff mean nothing"
        )
    if wants_lines(as_json):
        fitted = {
            name: getattr(found, name).model_dump() for name in ("gain", "cutoff_hz", "delay_s")
        }
        left = {"residual_db": found.residual_db, "residual_deg": found.residual_deg}
        write_line(response=str(path), rows=found.rows, **fitted, **left, notes=notes)
        return
    sys.stdout.write(
        f"{path}: {found.rows} frequencies\n"
        f"gain {_shown(found.gain)} (unit of the table)\n"
        f"cutoff {_shown(found.cutoff_hz)} Hz\n"
        f"delay {_shown(found.delay_s, 1e6)} us\n"
        f"left: {found.residual_db:.2f} dB, {found.residual_deg:.2f} degrees rms\n"
        + "".join(f"- {note}\n" for note in notes)
    )


def summary(found: "Identification") -> dict[str, object]:
    """Return what `--json` prints: the document without conditions and sweeps."""
    whole = found.model_dump(mode="json", by_alias=True)
    return {name: whole[name] for name in whole if name not in ("conditions", "sweeps")}


def show(found: "Identification", folder: Path, console: "Console") -> None:
    """Print the speed laws, what was left out, and what to know of them.

    Parameters
    ----------
    found : Identification
        The document of an identification.
    folder : Path
        Where the report lies.
    console : Console
        Where it is printed.
    """
    from rich.markup import escape
    from rich.table import Table

    from frictus_service.identification.models import why_no_population

    table = Table(title="friction, 95 % intervals", title_justify="left")
    for heading in ("", "n", "gain, N", "cutoff at rest, Hz", "Hz per mm/s", "delay, µs"):
        table.add_column(heading, justify="right" if heading else "left")
    for person in found.participants:
        friction = person.friction
        if friction is None:
            continue
        law = friction.law
        table.add_row(
            escape(person.participant),
            str(person.conditions),
            _shown(friction.gain_n),
            _shown(law.cutoff_0_hz if law else None),
            _shown(law.slope_hz_per_mm_s if law else None),
            _shown(friction.delay_s, 1e6),
        )
    if found.population is not None:
        table.add_section()
        means = {value.name: value.mean for value in found.population.values}
        names = ("gain_n", "cutoff_0_hz", "slope_hz_per_mm_s")
        table.add_row(
            "all",
            str(found.population.n),
            *(_shown(means.get(name)) for name in names),
            _shown(means.get("skew_s"), 1e6),
        )
    console.print(table)
    excluded = found.study.excluded
    console.print(f"{found.study.trials_used} of {found.study.trials} trials used")
    for trial in excluded[:MOST_SHOWN]:
        console.print(f"  {trial.trial} left out: {'; '.join(trial.reasons)}", markup=False)
    if len(excluded) > MOST_SHOWN:
        console.print(f"  and {len(excluded) - MOST_SHOWN} more; the report names all")
    why_not = why_no_population(found)
    for note in [*found.notes, *([why_not] if why_not else [])]:
        console.print(f"- {note}", markup=False)
    console.print(f"report: {folder / 'report.html'}", markup=False, soft_wrap=True)


def _shown(estimate: "EstimatedQuantity | None", factor: float = 1.0) -> str:
    if estimate is None:
        return "-"
    value = f"{factor * estimate.value:.4g}"
    if estimate.ci95 is None:
        return value
    low, high = (factor * end for end in estimate.ci95)
    return f"{value} [{low:.4g}, {high:.4g}]"


def _tell(line: str) -> None:
    sys.stderr.write(f"{line}\n")
    sys.stderr.flush()


def mount(
    recordings: Annotated[
        list[Path],
        typer.Argument(metavar="RECORDING...", help="Samples of blows: .mat or .npy."),
    ],
    band: Annotated[
        tuple[float, float],
        typer.Option("--band", metavar="LOW HIGH", help="Where to look, Hz."),
    ] = (1000.0, 6000.0),
    rate_hz: Annotated[
        float | None,
        typer.Option(
            "--rate", metavar="HZ", min=1.0, help="Sample rate.  [default: the file's]"
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE", help="Write the mount, as --mount reads it."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Tell frequency and damping of a mount's resonances from hammer blows in each RECORDING.

    Several recordings of one mount (days, mountings, places of the hammer) also tell how much
    it changes between them, and where one more would lie; one recording speaks for itself.

    The mount that --out writes is the strongest resonance, with a gain of 1 at rest: blows show
    neither that gain nor how others add up, which stand beside it.
    """
    from frictus_service.discovery.between_recordings import between_recordings
    from frictus_service.discovery.impact_recording import read_impacts
    from frictus_service.discovery.ring_down import estimate_ring_down
    from frictus_service.study.file_state import unchanged

    if len({path.resolve() for path in recordings}) < len(recordings):
        raise typer.BadParameter("a recording is given twice; it would count as two")
    check_out(out, *recordings)
    each = []
    for path in recordings:
        with unchanged(path):
            blows = read_impacts(path, rate_hz)
        each.append(estimate_ring_down(blows.samples, blows.rate_hz, band))
    found = between_recordings(each) if len(each) > 1 else each[0]
    if out is not None:
        _write_mount(out, found)
    if wants_lines(as_json):
        write_line(recordings=len(each), resonances=[asdict(one) for one in found])
    else:
        _show(found)
    _tell(_holds_for(len(each), found, max(map(len, each))))


def _holds_for(count: int, found: "list[Resonance]", most: int) -> str:
    if count == 1:
        return (
            "the intervals hold within this recording: over its blows, and bands with ends a "
            "fifth off. How much the mount changes between recordings it cannot show: give "
            "several (frictus mount A.mat B.mat C.mat)"
        )
    left_out = f"; {most - len(found)} are not in all of them" if most > len(found) else ""
    few = " With two, t has one degree of freedom: a third narrows much." if count == 2 else ""
    what = "1 resonance is" if len(found) == 1 else f"{len(found)} resonances are"
    return f"{what} in all {count} recordings{left_out}.{few}"


def _write_mount(out: Path, found: "list[Resonance]") -> None:
    from frictus_hardware.physics.linear import second_order

    strongest = max(found, key=lambda each: each.level_db)
    lateral = second_order(strongest.frequency_hz, strongest.damping_ratio)
    document = {"lateral": asdict(lateral), "resonances": [asdict(each) for each in found]}
    write_out(out, (json.dumps(document, indent=2) + "\n").encode())
    _tell(
        f"{out}: the mount resonates at {strongest.frequency_hz:.1f} Hz, its gain at rest is 1"
    )


def _show(found: "list[Resonance]") -> None:
    from rich.console import Console
    from rich.table import Table

    several = any(each.another_frequency_hz is not None for each in found)
    table = Table(title="resonances, 95 % intervals", title_justify="left")
    another = ("another recording, Hz",) if several else ()
    for heading in ("Hz", *another, "damping ratio", "peak, dB"):
        table.add_column(heading, justify="right")
    for each in found:
        low, high = each.damping_ratio_ci
        table.add_row(
            f"{each.frequency_hz:.1f} {_span(each.frequency_ci_hz)}",
            *((_span(each.another_frequency_hz),) if each.another_frequency_hz else ()),
            f"{each.damping_ratio:.4f} [{low:.4f}, {high:.4f}]",
            f"{each.level_db:.1f}",
        )
    Console().print(table)


def _span(ends: tuple[float, float]) -> str:
    return f"[{ends[0]:.1f}, {ends[1]:.1f}]"
