"""`frictus bench`: figures of this machine, each beside its bare counterpart."""

import logging
import sys
from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table

from frictus_service.cli.options import wants_lines, write_line

if TYPE_CHECKING:
    from frictus_laboratory.benchmarks.figure import Figure
    from frictus_laboratory.benchmarks.report import BenchReport


def bench(as_json: bool) -> None:
    """Measure, with progress on standard error; then show a table, or one JSON object.

    Parameters
    ----------
    as_json : bool
        JSON lines instead of a table.
    """
    from frictus_laboratory.benchmarks import report

    # Leases are lost here on purpose, and that is what is measured.
    logging.getLogger("frictus").addHandler(logging.NullHandler())
    found = report.measure(lambda line: _tell(f"measuring {line}"))
    if wants_lines(as_json):
        write_line(**found.fields())
    else:
        show(found, Console())


def _tell(line: str) -> None:
    sys.stderr.write(f"{line}\n")
    sys.stderr.flush()


def show(found: "BenchReport", console: Console) -> None:
    """Print the figures as a table, and what they are below it."""
    table = Table(title="frictus bench")
    for heading in ("figure", "unit", "measured", "beside", "ratio", "target", "met"):
        table.add_column(heading)
    for figure in found.figures:
        table.add_row(*row_of(figure))
    console.print(table)
    for figure in found.figures:
        console.print(f"[bold]{figure.name}[/]: {figure.remark}", highlight=False)
    told = ", ".join(f"{name} {what}" for name, what in found.machine.items())
    console.print(f"{told}; {found.seconds:.0f} s")


def row_of(figure: "Figure") -> tuple[str, ...]:
    """Return the cells of a figure: name, unit, measured, beside, ratio, target, met."""
    target = figure.target
    met = {True: "yes", False: "[red]no[/]", None: ""}[figure.met]
    return (
        figure.name,
        figure.unit,
        _listed(figure.value),
        _listed(figure.beside),
        "" if figure.ratio is None else f"{figure.ratio:.3g}",
        "" if target is None else f"{target.of} {target.sense} {target.bound:g}",
        met,
    )


def _listed(numbers: dict[str, float]) -> str:
    return "\n".join(f"{name} {_plain(number)}" for name, number in numbers.items())


def _plain(number: float) -> str:
    return f"{number:,.0f}" if abs(number) >= 1_000.0 else f"{number:.3g}"
