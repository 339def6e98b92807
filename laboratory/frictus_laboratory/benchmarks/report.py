"""`frictus bench`: all figures, one after the other, each beside its bare counterpart.

The table of `docs/performance.md` is made from a report on standard input:
``frictus bench --json | python -m frictus_laboratory.benchmarks.report``
"""

import json
import logging
import os
import platform
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any

from rich.console import Console
from rich.table import Table

from frictus_laboratory.benchmarks import (
    discovery,
    identification,
    kernel,
    kills,
    latency,
    lateness,
    occupancy,
    start,
    throughput,
    viewers,
)
from frictus_laboratory.benchmarks.figure import SCHEMA, Figure
from frictus_service.cli.options import wants_lines, write_line


@dataclass(frozen=True, slots=True)
class BenchReport:
    """What `frictus bench` found.

    Attributes
    ----------
    figures : list of Figure
        Rows of the report.
    machine : dict
        What the figures hang on, the load average at beginning and end included.
    seconds : float
        How long it took.
    """

    figures: list[Figure]
    machine: dict[str, Any]
    seconds: float

    def fields(self) -> dict[str, Any]:
        """Return the report as plain data, for JSON."""
        return {
            "schema": SCHEMA,
            "version": version("frictus"),
            "seconds": round(self.seconds, 1),
            "machine": self.machine,
            "figures": [figure.fields() for figure in self.figures],
        }


MEASUREMENTS: dict[str, Callable[[], list[Figure]]] = {
    "kernel": kernel.measure,
    "throughput": throughput.measure,
    "block latency": latency.measure_delivery,
    "texture update": latency.measure_update,
    "start": start.measure,
    "rig on a core": occupancy.measure,
    "tracker beside a rig": occupancy.measure_tracker,
    "loop lateness": lateness.measure,
    "busy processes beside": lateness.measure_contention,
    "viewers": viewers.measure,
    "kills": kills.measure,
    "identification": identification.measure,
    "discovery": discovery.measure,
    "recording": throughput.measure_recording,
}


def measure_all(say: Callable[[str], None]) -> BenchReport:
    """Measure everything.

    Parameters
    ----------
    say : callable
        Told what is being measured.
    """
    machine = _machine()
    begun_s = time.monotonic()
    figures = []
    for number, (name, measurement) in enumerate(MEASUREMENTS.items(), 1):
        say(f"{number} of {len(MEASUREMENTS)}: {name}")
        figures += measurement()
    machine["load_average_after"] = _load_average()
    return BenchReport(figures, machine, time.monotonic() - begun_s)


def _machine() -> dict[str, Any]:
    return {
        "system": f"{platform.system()} {platform.machine()}",
        "cpus": os.cpu_count(),
        "python": platform.python_version(),
        "numba": version("numba"),
        "zenoh": version("eclipse-zenoh"),
        "load_average_before": _load_average(),
    }


def _load_average() -> float | None:
    """Return how many processes wanted a CPU over the last minute, where the system tells."""
    return round(os.getloadavg()[0], 2) if hasattr(os, "getloadavg") else None


def bench(as_json: bool) -> None:
    """Measure, with progress on standard error; then show a table, or one JSON object.

    Parameters
    ----------
    as_json : bool
        JSON lines instead of a table.
    """
    # Leases are lost here on purpose, and that is what is measured.
    logging.getLogger("frictus").addHandler(logging.NullHandler())
    found = measure_all(lambda line: _tell(f"measuring {line}"))
    if wants_lines(as_json):
        write_line(**found.fields())
    else:
        show(found, Console())


def _tell(line: str) -> None:
    sys.stderr.write(f"{line}\n")
    sys.stderr.flush()


def show(found: BenchReport, console: Console) -> None:
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


def row_of(figure: Figure) -> tuple[str, ...]:
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


def table_of(report: dict[str, Any]) -> str:
    """Return the figures of a report, as `Report.fields` gives them, as Markdown."""
    lines = [
        "| figure | unit | measured | beside | ratio | target | met |",
        "|---|---|---|---|---|---|---|",
    ]
    for figure in report["figures"]:
        target = figure["target"]
        cells = (
            f"`{figure['name']}`",
            figure["unit"],
            _cell(figure["value"]),
            _cell(figure["beside"]),
            "" if figure["ratio"] is None else f"{figure['ratio']:.3g}",
            "" if target is None else f"{target['of']} {target['is']} {target['bound']:g}",
            {True: "yes", False: "**no**", None: ""}[figure["met"]],
        )
        lines.append(f"| {' | '.join(cells)} |")
    machine = ", ".join(f"{name} {what}" for name, what in report["machine"].items())
    remarks = [f"- `{f['name']}`: {f['remark']}." for f in report["figures"]]
    told = f"frictus {report['version']}, {report['seconds']:.0f} s on: {machine}."
    return "\n".join([*lines, "", told, "", *remarks, ""])


def _cell(numbers: dict[str, float]) -> str:
    return "<br>".join(f"{name} {_plain(number)}" for name, number in numbers.items())


if __name__ == "__main__":
    sys.stdout.write(table_of(json.load(sys.stdin)))
