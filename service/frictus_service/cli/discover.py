"""`frictus discover`: what a model gets wrong in a study, why, and the model extended by it."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from frictus_service.cli.lines import write_line
from frictus_service.cli.options import AsJson, RandomSeed, Response, Workers, wants_lines

if TYPE_CHECKING:
    from rich.console import Console

    from frictus_service.discovery.document import Discovery

NOT_PRINTED = frozenset({"residuals", "levels"})
"""What `--json` leaves to report.json."""


def discover(
    study: Annotated[Path, typer.Argument(metavar="STUDY", help="Study file, or a folder.")],
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="DIR", help="Where to.  [default: STUDY-discovery]"),
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
    as_json: AsJson = False,
) -> None:
    """Say what the base model gets wrong in STUDY, name the causes, and extend the model."""
    from frictus_service.discovery.report import files
    from frictus_service.discovery.run import discover_study

    folder = out or study.with_name(f"{study.stem}-discovery")
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
    written = files.write(found, folder)
    if wants_lines(as_json):
        write_line(**summary(found), files=[str(path) for path in written])
    else:
        from rich.console import Console

        show(found, Console())
        Console().print(f"report: {folder / files.REPORT}", markup=False, soft_wrap=True)


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
    from frictus_service.discovery.report.phrasing import (
        gain_sentence,
        place_of,
        shown,
        verdict_sentence,
    )

    console.print(verdict_sentence(found), markup=False, style="bold")
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
    for left in found.unexplained:
        console.print(f"unexplained: {place_of(left)}, p {left.p_value:.3g}", markup=False)
    if found.gain is not None:
        console.print(gain_sentence(found.gain), markup=False)
    untested = [test.id for test in found.tests if test.not_tested]
    if untested:
        console.print(f"not tested: {', '.join(map(title, untested))}; the report says why")
    for note in found.notes:
        console.print(f"- {note}", markup=False)


def _tell(line: str) -> None:
    sys.stderr.write(f"{line}\n")
    sys.stderr.flush()
