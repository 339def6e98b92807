"""Write into docs/sizing.md what a site takes: `python -m tests.campaigns.sizing --help`.

Processor time is fitted, never negative, to what was delivered, so that sizes in which
something gave count too; what a larger site takes is extrapolated from it, and said to be.
"""

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from scipy.optimize import nnls
from tests.campaigns.lines import Line, read
from tests.campaigns.reliability import circumstances, table, with_section
from tests.campaigns.site import WHOLE
from tests.campaigns.site_parts import Size

from frictus_laboratory.benchmarks.viewers import RATE_HZ

OUT: Final = Path(__file__).parents[2] / "docs" / "sizing.md"
UNITS: Final[Mapping[str, tuple[str, ...]]] = {
    "rig": ("rig",),
    "rig's supervisor": ("rig",),
    "recorder": ("rig",),
    "routers": ("rig", "subscriber", "viewer"),
    "APIs": ("site", "watched rig", "viewer"),
    "APIs' supervisors": ("site",),
    "nginx": ("viewer",),
    "PostgreSQL": ("site",),
}
"""What the processor time of each kind of part grows with; readers' own is not the site's."""


@dataclass(frozen=True, slots=True)
class Cost:
    """What one kind of part takes.

    Attributes
    ----------
    kind : str
    cores : dict
        Per unit.
    largest_error : float
        Of the fit, in cores.
    told_apart : bool
        Whether the sizes that ran tell its units apart; their sum is known even so.
    """

    kind: str
    cores: dict[str, float]
    largest_error: float
    told_apart: bool

    def of(self, size: Size) -> float:
        """Return what it takes in a site of this size, cores."""
        counts = counted(size)
        return sum(cores * counts[unit] for unit, cores in self.cores.items())


def counted(size: Size, delivered: float = 1.0) -> dict[str, float]:
    """Return how many of each unit a site of a size has.

    Parameters
    ----------
    size : Size
    delivered : float
        Share of their frames that viewers got; so many viewers count.
    """
    return {
        "site": 1.0,
        "rig": float(size.rigs),
        "subscriber": float(size.subscribers),
        "viewer": delivered * size.viewers,
        "watched rig": float(min(size.rigs, size.viewers)),
    }


def fitted(lines: Sequence[Line]) -> list[Cost]:
    """Return what each kind of part takes, of the sizes in which every part ran to the end.

    Raises
    ------
    ValueError
        If there is none.
    """
    ran = [line for line in lines if "cores" in line and not (line["silent"] or line["ended"])]
    if not ran:
        raise ValueError("no size ran to its end: run the campaign with less beside it")
    counts = [counted(Size(**line["size"]), line["frames_hz"] / RATE_HZ) for line in ran]
    costs = []
    for kind, units in UNITS.items():
        known = np.array([[count[unit] for unit in units] for count in counts])
        used = np.array([line["cores"][kind] for line in ran])
        cores, _ = nnls(known, used)
        error = float(np.abs(known @ cores - used).max())
        apart = int(np.linalg.matrix_rank(known)) == len(units)
        costs.append(Cost(kind, dict(zip(units, cores.tolist(), strict=True)), error, apart))
    return costs


def measured_section(lines: Sequence[Line]) -> str:
    """Return the section of what was measured."""
    rows = []
    for line in lines:
        size = Size(**line["size"])
        if "cores" not in line:
            rows.append([size.name, *["-"] * 8, line["gave"][0]])
            continue
        site = sum(line["cores"][kind] for kind in UNITS)
        rows.append(
            [
                size.name,
                f"{site:.2f}",
                f"{sum(line['cores'].values()) - site:.2f}",
                f"{line['machine_cores']:.2f}",
                f"{line['lost']} of {line['received'] + line['lost']}",
                str(line["recorder_lost"]),
                f"{line['frames_hz']:.0f}",
                *(
                    ", ".join(f"{age_ms:.0f}" for age_ms in line[ages])
                    for ages in ("frame_age_ms", "state_age_ms")
                ),
                "; ".join([f"{line['lateness_p99_ms']:.1f} ms", *line["gave"]]),
            ]
        )
    header = ["size", "site, cores", "its readers", "machine", "blocks lost", "by recordings"]
    header += ["frames/s", "age of frames, ms: median, p99", "of states, ms: median, p99"]
    header += ["lateness p99; what gave"]
    return f"{circumstances(lines)}.\n{MEASURED}\n\n{table(header, rows)}\n\n{MADE}"


def takes_section(lines: Sequence[Line]) -> str:
    """Return the section of what a site takes."""
    costs = fitted(lines)
    units = list(dict.fromkeys(unit for parts in UNITS.values() for unit in parts))
    rows = [
        [
            cost.kind,
            *(_told(cost, unit) for unit in units),
            f"{1e3 * cost.largest_error:.0f}",
            f"{cost.of(WHOLE):.2f}",
        ]
        for cost in costs
    ]
    whole = sum(cost.of(WHOLE) for cost in costs)
    rows.append(["all of it", *[""] * len(units), "", f"**{whole:.2f}**"])
    header = ["part", *(f"per {unit}" for unit in units), "largest error of the fit"]
    header.append(f"{WHOLE.rigs} rigs, {WHOLE.viewers} viewers: cores, extrapolated")
    return f"{TAKES}\n\n{table(header, rows)}\n\n{MADE}"


def _told(cost: Cost, unit: str) -> str:
    if unit not in cost.cores:
        return ""
    return f"{1e3 * cost.cores[unit]:.1f}" if cost.told_apart else "?"


MEASURED: Final = """\
*site*: processor time of all its parts; *its readers*: of subscribers, viewers and owners,
who are elsewhere in a real one; *machine*: all that ran there, others' work included. A
ladder ends at the first size in which something gave; what the page asks for is 60 frames/s."""
TAKES: Final = """\
Thousandths of a core per unit; a viewer counts by the frames that it got. *?*: the sizes
that ran do not tell one unit from another, only what all of them take."""
MADE: Final = """\
Made by `uv run python -m tests.campaigns.site lines.jsonl`, which goes on where it was
stopped, and `uv run python -m tests.campaigns.sizing lines.jsonl`."""


def main() -> None:
    """Write both sections."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("results", type=Path, help="lines of the campaign")
    lines = read(parser.parse_args().results)
    if not lines:
        raise SystemExit("no lines; run the campaign first")
    text = OUT.read_text(encoding="utf-8")
    text = with_section(text, "What was measured", measured_section(lines))
    OUT.write_text(
        with_section(text, "What a site takes", takes_section(lines)), encoding="utf-8"
    )


if __name__ == "__main__":
    main()
