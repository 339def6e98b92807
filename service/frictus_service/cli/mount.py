"""`frictus mount`: resonances of a mount from a recording of hammer blows."""

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from frictus_service.cli.lines import write_line
from frictus_service.cli.options import AsJson, wants_lines

if TYPE_CHECKING:
    from frictus_service.discovery.mount.ring_down import Resonance


def mount(
    recording: Annotated[
        Path, typer.Argument(metavar="RECORDING", help="Samples of blows: .mat or .npy.")
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
    as_json: AsJson = False,
) -> None:
    """Tell frequency and damping of a mount's resonances from hammer blows in RECORDING."""
    from frictus_service.discovery.mount.impact_test import read_impacts
    from frictus_service.discovery.mount.ring_down import estimate_ring_down

    blows = read_impacts(recording, rate_hz)
    found = estimate_ring_down(blows.samples, blows.rate_hz, band)
    if wants_lines(as_json):
        write_line(resonances=[asdict(each) for each in found])
    else:
        _show(found)


def _show(found: "list[Resonance]") -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(title="resonances, 95 % intervals", title_justify="left")
    for heading in ("Hz", "damping ratio", "peak, dB"):
        table.add_column(heading, justify="right")
    for each in found:
        low_hz, high_hz = each.frequency_ci_hz
        low, high = each.damping_ratio_ci
        table.add_row(
            f"{each.frequency_hz:.1f} [{low_hz:.1f}, {high_hz:.1f}]",
            f"{each.damping_ratio:.4f} [{low:.4f}, {high:.4f}]",
            f"{each.level_db:.1f}",
        )
    Console().print(table)
