"""The live table: what the finger feels, on a terminal."""

import math
from types import TracebackType
from typing import Self

from rich.live import Live
from rich.table import Table

from frictus_service.cli.felt import RigSnapshot
from frictus_service.cli.lines import write_line

ALARM_S = 1.0


class Display:
    """Shows one look after another: a live table, or JSON lines; a context manager.

    Parameters
    ----------
    title : str
        Heads the table.
    lines : bool
        Write JSON lines instead.
    """

    def __init__(self, title: str, lines: bool) -> None:
        self._title = title
        self._live = None if lines else Live(auto_refresh=False)

    def show(self, felt: RigSnapshot, elapsed_s: float) -> None:
        """Show one look."""
        if self._live is None:
            write_line(event="felt", elapsed_s=round(elapsed_s, 3), **felt.fields())
        else:
            self._live.update(table_of(felt, self._title, elapsed_s), refresh=True)

    def __enter__(self) -> Self:
        """Take the terminal."""
        if self._live is not None:
            self._live.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Give the terminal back; the last table stays."""
        if self._live is not None:
            self._live.stop()


def table_of(felt: RigSnapshot, title: str, elapsed_s: float) -> Table:
    """Return the table of one look."""
    table = Table(title=f"{title}, {elapsed_s:.1f} s", show_header=False, min_width=60)
    table.add_column(style="bold", no_wrap=True)
    table.add_column()
    for row in (*_finger_rows(felt), *_rig_rows(felt)):
        table.add_row(*row)
    return table


def _finger_rows(felt: RigSnapshot) -> list[tuple[str, str]]:
    finger = felt.finger
    if finger is None:
        return [("finger", "[yellow]no finger state yet[/]")]
    speed = math.hypot(finger.vx_mm_s, finger.vy_mm_s)
    remarks = [
        text
        for holds, text in (
            (not finger.in_contact, "not touching"),
            (finger.stale, "[red]stale sensor[/]"),
            (finger.extrapolated, "[yellow]outside the model's speeds[/]"),
        )
        if holds
    ]
    friction = "-"
    if felt.friction_rms_n is not None:
        friction = (
            f"{1e3 * felt.friction_rms_n:.1f} mN rms, 20 to 1000 Hz ({felt.friction_from})"
        )
    return [
        ("position", f"{finger.x_mm:6.1f}, {finger.y_mm:6.1f} mm  {' '.join(remarks)}"),
        ("speed", f"{speed:6.1f} mm/s"),
        ("normal force", f"{finger.normal_force_n:6.2f} N"),
        ("friction felt", friction),
    ]


def _rig_rows(felt: RigSnapshot) -> list[tuple[str, str]]:
    rows = []
    if felt.scene is not None:
        applied = felt.scene.applied
        scaled = "  [yellow]scaled to fit the drive[/]" if applied.scaled else ""
        rows.append(("applied gain", f"{applied.gain:.3f}{scaled}"))
    if (status := felt.status) is not None:
        state = f"[red]{status.state}[/]" if status.state == "tripped" else status.state
        fault = f": {status.fault.reason}; {status.fault.action}" if status.fault else ""
        owner = f", held by {status.owner}" if status.owner else ""
        late, counts = status.timing, status.counters
        rows += [
            ("rig", f"{state}{owner}{fault}"),
            (
                "loop late",
                f"p50 {late.lateness_p50_ms:.2f}, p99 {late.lateness_p99_ms:.2f}, "
                f"max {late.lateness_max_ms:.2f} ms; least margin {late.margin_min_ms:.1f} ms",
            ),
            (
                "loop",
                f"{counts.blocks} blocks, {counts.deadline_misses} late, "
                f"{counts.overruns} overruns, {counts.underruns} underruns, "
                f"{counts.clipped_samples} clipped samples",
            ),
        ]
    received = ", ".join(f"{name} {count}" for name, count in felt.received.items() if count)
    gaps = ", ".join(f"{count} {reason}" for reason, count in felt.gaps.items()) or "no gap"
    lost = sum(felt.lost.values())
    rows.append(("blocks", f"{received or 'none'}; {lost} lost, {gaps}"))
    if felt.silent_s > ALARM_S:
        rows.append(("", f"[red]nothing from the rig for {felt.silent_s:.0f} s[/]"))
    return rows
