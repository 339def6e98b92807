"""What commands that run a bridge to another program share: turns until Ctrl-C, and reports."""

import sys
import time
from collections.abc import Callable
from dataclasses import asdict
from typing import Any, Final, Protocol, TypeVar

from frictus_service.cli.options import wants_lines, write_line

TURN_S: Final = 0.01
SHOWN_S: Final = 1.0
Report = TypeVar("Report", covariant=True)


class Bridge(Protocol[Report]):
    """Sends what has come since its last turn."""

    def turn(self) -> None:
        """Send it."""

    def report(self) -> Report:
        """Return what was done so far: a dataclass."""


def run_bridge(
    bridge: Bridge[Any], line_of: Callable[[Any], str], seconds: float | None, as_json: bool
) -> None:
    """Turn a bridge until Ctrl-C, and tell of it.

    Parameters
    ----------
    bridge : Bridge
        Open.
    line_of : callable
        From its report to a line for people.
    seconds : float or None
        How long; None: until Ctrl-C.
    as_json : bool
        Lines for programs.
    """
    from frictus_service.cli.streams.record import interruption

    with interruption() as interrupted:
        begun_s = shown_s = due_s = time.monotonic()
        while not interrupted and (seconds is None or due_s - begun_s < seconds):
            bridge.turn()
            if due_s - shown_s >= SHOWN_S:
                _show(bridge.report(), line_of, as_json)
                shown_s = due_s
            due_s = max(due_s + TURN_S, time.monotonic())
            time.sleep(max(0.0, due_s - time.monotonic()))
        bridge.turn()
        if wants_lines(as_json):
            write_line(event="end", **asdict(bridge.report()))
        else:
            sys.stdout.write(f"{line_of(bridge.report())}\n")


def _show(report: Any, line_of: Callable[[Any], str], as_json: bool) -> None:
    if wants_lines(as_json):
        write_line(event="sent", **asdict(report))
    elif sys.stderr.isatty():
        sys.stderr.write(f"\r\x1b[K{line_of(report)}")
        sys.stderr.flush()
