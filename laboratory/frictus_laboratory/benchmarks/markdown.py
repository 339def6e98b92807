"""The table of `docs/performance.md`, from a report on standard input.

``frictus bench --json | python -m frictus_laboratory.benchmarks.markdown``
"""

import json
import sys
from typing import Any


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
            _listed(figure["value"]),
            _listed(figure["beside"]),
            "" if figure["ratio"] is None else f"{figure['ratio']:.3g}",
            "" if target is None else f"{target['of']} {target['is']} {target['bound']:g}",
            {True: "yes", False: "**no**", None: ""}[figure["met"]],
        )
        lines.append(f"| {' | '.join(cells)} |")
    machine = ", ".join(f"{name} {what}" for name, what in report["machine"].items())
    remarks = [f"- `{f['name']}`: {f['remark']}." for f in report["figures"]]
    told = f"frictus {report['version']}, {report['seconds']:.0f} s on: {machine}."
    return "\n".join([*lines, "", told, "", *remarks, ""])


def _listed(numbers: dict[str, float]) -> str:
    return "<br>".join(f"{name} {_plain(number)}" for name, number in numbers.items())


def _plain(number: float) -> str:
    return f"{number:,.0f}" if abs(number) >= 1_000.0 else f"{number:.3g}"


if __name__ == "__main__":
    sys.stdout.write(table_of(json.load(sys.stdin)))
