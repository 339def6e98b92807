"""`frictus plan` and `discover`: what a design can show, and what a model gets wrong."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from frictus_service.cli.options import (
    AsJson,
    Exit,
    RandomSeed,
    Response,
    Workers,
    check_out,
    check_out_folder,
    wants_lines,
    write_line,
    write_out,
)
from frictus_service.cli.studies.across import finish, folder_of, studies_of

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from frictus_service.discovery.document import Discovery, OneRecording
    from frictus_service.discovery.plan.documents import Addition, Plan, PlannedEffect

RANKS = 6
"""Models of one recording that are printed."""
NOT_PRINTED = frozenset({"residuals", "levels", "discrepancy"})
"""What `--json` leaves to report.json."""


def plan(
    source: Annotated[
        Path, typer.Argument(metavar="STUDY|DESIGN", help="Study file, or design (.json).")
    ],
    response: Response = "friction",
    base: Annotated[
        str,
        typer.Option(
            "--base",
            metavar="BASE",
            help="What will be criticised: paper, constant-cutoff, or a model file.",
        ),
    ] = "paper",
    want: Annotated[
        list[str] | None,
        typer.Option(
            "--want", metavar="EFFECT=SIZE", help="Size that shall be shown; may be repeated."
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="FILE", help="Write the plan/1 document.")
    ] = None,
    seed: RandomSeed = None,
    cache: Annotated[
        Path | None,
        typer.Option(
            "--cache",
            metavar="DIR",
            help="Of what a study's trials say.  [default: STUDY-discovery/observations]",
        ),
    ] = None,
    workers: Workers = None,
    as_json: AsJson = False,
) -> None:
    """Say which effects STUDY or DESIGN shows, which look alike, and what to add."""
    from frictus_service.discovery.plan.run import plan_file

    check_out(out, source, Path(base))
    found = plan_file(
        source,
        response=response,
        base=base,
        wanted=dict(map(_size, want or [])),
        seed=seed,
        workers=workers,
        cache=cache or source.with_name(f"{source.stem}-discovery") / "observations",
        tell=_tell,
    )
    if out is not None:
        write_out(out, found.to_json())
    if wants_lines(as_json):
        write_line(**found.model_dump(mode="json", by_alias=True))
    else:
        from rich.console import Console

        show_plan(found, Console())


def _size(asked: str) -> tuple[str, float]:
    name, _, size = asked.partition("=")
    try:
        return name, float(size)
    except ValueError as error:
        raise typer.BadParameter(
            f"--want {asked}: accepted: EFFECT=SIZE, such as gain_drift=0.01"
        ) from error


def show_plan(found: "Plan", console: "Console") -> None:
    """Print what is shown and what to add, then all effects, then what looks alike.

    Parameters
    ----------
    found : Plan
        The document of a plan.
    console : Console
        Where it is printed.
    """
    console.print(
        f"{found.participants} participants x {found.trials} trials, "
        f"{duration(found.finger_s)} on the finger in all",
        style="bold",
        markup=False,
    )
    for note in found.notes:
        console.print(f"- {note}", markup=False)
    if found.critical_t is None:
        for line in advice(found):
            console.print(f"add {line}", markup=False)
        return
    seen = sum(effect.shown == "yes" for effect in found.effects)
    same = sum(pair.separable == "no" for pair in found.pairs)
    console.print(
        f"{seen} of {len(found.effects)} effects show as small as wanted; "
        f"{same} pair{'' if same == 1 else 's'} cannot be told apart."
    )
    for line in advice(found):
        console.print(f"add {line}", markup=False)
    console.print(_effects(found))
    if found.pairs:
        console.print(_pairs(found))
    console.print(found.assumptions, style="dim", markup=False)


def advice(found: "Plan") -> list[str]:
    """Return the additions that solve something, cheapest first, each with what it solves."""
    from frictus_service.discovery.catalogue.cause import title

    solves: dict[tuple[float, str], list[str]] = {}
    for effect in found.effects:
        if effect.cheapest is not None:
            solves.setdefault(_bill(effect.cheapest), []).append(f"shows {_name(effect)}")
    for pair in found.pairs:
        if pair.cheapest is not None:
            both = " from ".join(map(title, pair.between))
            solves.setdefault(_bill(pair.cheapest), []).append(f"tells {both}")
    return [f"{what}: {'; '.join(why)}" for (_, what), why in sorted(solves.items())]


def _effects(found: "Plan") -> "Table":
    from rich.table import Table

    table = Table("effect", "shown", "smallest found", "wanted", "needs")
    order = ("no", "larger only", "yes")
    for effect in sorted(found.effects, key=lambda each: order.index(each.shown)):
        help_ = "" if effect.cheapest is None else _bill(effect.cheapest)[1]
        table.add_row(_name(effect), effect.shown, *_sizes(effect), help_ or effect.needs or "")
    return table


def _pairs(found: "Plan") -> "Table":
    from rich.table import Table

    from frictus_service.discovery.catalogue.cause import title

    table = Table("look alike", "cosine", "separable", "needs")
    for pair in found.pairs:
        help_ = pair.separating_experiment if pair.separable == "no" else ""
        if pair.cheapest is not None:
            help_ = f"{_bill(pair.cheapest)[1]}; cosine then {pair.cheapest.reaches:+.2f}"
        both = ", ".join(map(title, pair.between))
        table.add_row(both, f"{pair.cosine:+.2f}", pair.separable, help_)
    return table


def duration(seconds: float) -> str:
    """Return a time for people."""
    if seconds < 120.0:
        return f"{seconds:.0f} s"
    if seconds < 7200.0:
        return f"{seconds / 60.0:.0f} min"
    return f"{seconds / 3600.0:.1f} h"


def _name(effect: "PlannedEffect") -> str:
    from frictus_service.discovery.catalogue.cause import title

    held = [f"{value:g} Hz" for name, value in effect.held.items() if name == "frequency_hz"]
    return ", ".join([title(effect.id), *held])


def _sizes(effect: "PlannedEffect") -> tuple[str, str]:
    from frictus_service.discovery.catalogue.cause import NO_UNIT

    unit = "" if effect.unit == NO_UNIT else f" {effect.unit}"
    found = "-" if effect.detectable is None else f"{effect.detectable:.2g}{unit}"
    return found, f"{effect.wanted:.2g}{unit}"


def _bill(addition: "Addition") -> tuple[float, str]:
    """Return what an addition costs, and the addition with that."""
    what = ", and ".join(addition.additions)
    cost = f"+{duration(addition.finger_s)}" if addition.finger_s else "no more time"
    return addition.finger_s, f"{what} ({cost})"


def discover(
    studies: Annotated[
        list[Path],
        typer.Argument(
            metavar="STUDY...",
            help="Study file; of several, or a folder of them, what holds in all.",
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="DIR",
            help="Where to.  [default: STUDY-discovery, or across-studies]",
        ),
    ] = None,
    response: Response = "friction",
    base: Annotated[
        str,
        typer.Option(
            "--base",
            metavar="BASE",
            help="What is criticised: paper, constant-cutoff, or a model file.",
        ),
    ] = "paper",
    seed: RandomSeed = None,
    cache: Annotated[
        Path | None,
        typer.Option(
            "--cache", metavar="DIR", help="Of what trials say.  [default: OUT/observations]"
        ),
    ] = None,
    workers: Workers = None,
    cluster: Annotated[
        str | None,
        typer.Option("--cluster", metavar="ADDR", help="dask scheduler to work on instead."),
    ] = None,
    draft_cause: Annotated[
        str | None,
        typer.Option(
            "--draft-cause",
            metavar="NAME",
            help="Draft effect and words of what was characterised in OUT/draft.",
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Say what the base model gets wrong in STUDY, name the causes, and extend the model.

    Of several studies, say which causes hold in all of them, and which differ between them.
    """
    from frictus_service.discovery.beyond.draft import check_name
    from frictus_service.discovery.discover import discover_study
    from frictus_service.discovery.document import REPORT
    from frictus_service.discovery.report import page

    if draft_cause is not None:
        check_name(draft_cause)  # before an analysis of minutes
    meant = studies_of(studies)
    if len(meant) > 1:
        if draft_cause is not None:
            raise typer.BadParameter("--draft-cause is of one study; give that one alone")
        from frictus_service.discovery.across_studies.across import discover_across

        folder = out or folder_of(studies)
        check_out_folder(folder, meant[0])
        across = discover_across(
            meant,
            folder,
            response=response,
            base=base,
            seed=seed,
            workers=workers,
            cache=cache,
            cluster=cluster,
            tell=_tell,
        )
        _tell("writing the report")
        finish(across, folder, as_json)
        return
    (study,) = meant
    folder = out or study.with_name(f"{study.stem}-discovery")
    check_out_folder(folder, study)
    found = discover_study(
        study,
        response=response,
        base=base,
        seed=seed,
        workers=workers,
        cache=cache or folder / "observations",
        cluster=cluster,
        tell=_tell,
    )
    _tell("writing the report")
    written = page.write(found, folder)
    if draft_cause is not None and found.characterised:
        written += page.write_draft(found, draft_cause, folder)
    if wants_lines(as_json):
        write_line(**summary(found), files=[str(path) for path in written])
    else:
        from rich.console import Console

        show(found, Console())
        Console().print(f"report: {folder / REPORT}", markup=False, soft_wrap=True)
        if draft_cause is not None and found.characterised:
            draft = f"draft: {folder / page.DRAFT}: read, edit, and copy it into the sources"
            Console().print(draft, markup=False, soft_wrap=True)
    if found.verdict is None and found.one_recording is None:
        _tell("frictus: nothing was tested; the notes say what to measure")
        raise typer.Exit(Exit.USAGE)
    if draft_cause is not None and not found.characterised:
        page.write_draft(found, draft_cause, folder)  # refused once all that was found is told


def summary(found: "Discovery") -> dict[str, object]:
    """Return what `--json` prints: the document without the figures' points."""
    whole = found.model_dump(mode="json", by_alias=True)
    return {name: whole[name] for name in whole if name not in NOT_PRINTED}


def show(found: "Discovery", console: "Console") -> None:
    """Print the verdict, the causes, and what to know of them.

    Parameters
    ----------
    found : Discovery
        The document of a discovery.
    console : Console
        Where it is printed.
    """
    from rich.table import Table

    from frictus_service.discovery.catalogue.cause import title
    from frictus_service.discovery.report.findings import (
        folds_sentence,
        gain_sentence,
        place_of,
        shown,
        verdict_sentence,
    )

    console.print(verdict_sentence(found), markup=False, style="bold")
    if found.one_recording is not None:
        console.print(folds_sentence(found.one_recording), markup=False)
        console.print(_ranked(found.one_recording))
    if found.causes:
        table = Table("cause", "parameter", "95 % interval", "p", title_justify="left")
        for cause in found.causes:
            for name, estimate in cause.parameters.items():
                table.add_row(title(cause.id), name, shown(estimate), f"{cause.p_value:.3g}")
            if not cause.parameters:
                shape = "of another shape than the catalogue's: not in the extended model"
                table.add_row(title(cause.id), "", shape, f"{cause.p_value:.3g}")
        console.print(table)
    for pair in found.cannot_tell:
        first, second = map(title, pair.between)
        console.print(f"{first} or {second}? {pair.separating_experiment}", markup=False)
    for form in found.characterised:
        console.print(f"characterised: {form.statement}", markup=False)
    for left in found.unexplained:
        console.print(f"unexplained: {place_of(left)}, p {left.p_value:.3g}", markup=False)
    if found.gain is not None:
        console.print(gain_sentence(found.gain), markup=False)
    untested = [test.id for test in found.tests if test.not_tested]
    if untested and found.one_recording is None:
        console.print(f"not tested: {', '.join(map(title, untested))}; the report says why")
    for note in found.notes:
        console.print(f"- {note}", markup=False)


def _ranked(one: "OneRecording") -> "Table":
    from rich.table import Table

    from frictus_service.discovery.one_recording.phrasing import taken_away
    from frictus_service.discovery.report.findings import model_named

    table = Table("this recording only", "of held-out misfit it takes away", "AIC")
    for model in one.models[:RANKS]:
        table.add_row(model_named(model), taken_away(model), f"{model.aic:+.3g}")
    return table


def _tell(line: str) -> None:
    sys.stderr.write(f"{line}\n")
    sys.stderr.flush()
