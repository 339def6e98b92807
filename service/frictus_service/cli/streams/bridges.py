"""`frictus lsl` and `frictus foxglove`: a rig live in another program, until Ctrl-C."""

import sys
import time
from collections.abc import Callable, Collection
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, Protocol, TypeVar

import typer

from frictus_service.cli.options import (
    AsJson,
    ConfigFile,
    RigOption,
    RouterOption,
    Seconds,
    SiteOption,
    TargetRig,
    wants_lines,
    write_line,
)

if TYPE_CHECKING:
    from frictus_service.bridges.foxglove import FoxgloveReport
    from frictus_service.bridges.lsl import BridgeReport

FOXGLOVE_INSTALL: Final = "pip install 'frictus[service,foxglove]'"
LSL_INSTALL: Final = "pip install 'frictus[lsl]'"
PORT: Final = 8765
"""Which viewers of Foxglove propose."""
LOOPBACK: Final = ("127.0.0.1", "::1", "localhost")
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
    from frictus_service.processes import interruption

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


def foxglove(
    streams: Annotated[
        str,
        typer.Option(
            "--streams",
            metavar="NAMES",
            help="Of force, accel, voltage, truth, aux and render, with commas.",
        ),
    ] = "force,accel,voltage,render",
    samples_per_column: Annotated[
        int,
        typer.Option(
            "--samples-per-column",
            min=1,
            max=100_000,
            help="Of so many samples the least and the greatest; 1: every sample, which few "
            "viewers follow.",
        ),
    ] = 50,
    host: Annotated[
        str, typer.Option("--host", help="Interface; whoever reaches it may look.")
    ] = "127.0.0.1",
    port: Annotated[
        int, typer.Option("--port", min=0, max=65_535, help="0: any that is free.")
    ] = PORT,
    layout: Annotated[
        Path | None,
        typer.Option("--layout", metavar="FILE", help="Write the layout, to be imported."),
    ] = None,
    rig: RigOption = None,
    site: SiteOption = None,
    router: RouterOption = None,
    config: ConfigFile = None,
    seconds: Seconds = None,
    as_json: AsJson = False,
) -> None:
    """Show a rig's samples and states live in Foxglove or Lichtblick, until Ctrl-C."""
    try:
        from foxglove import set_log_level

        from frictus_service.bridges.foxglove import STREAM_IDS, FoxgloveBridge
    except ModuleNotFoundError as error:
        raise typer.BadParameter(f"{error}: Foxglove needs {FOXGLOVE_INSTALL}") from error
    import frictus
    from frictus_service.recording.foxglove import LAYOUT

    names = _names_of(streams, STREAM_IDS)
    if layout is not None:
        layout.write_bytes(LAYOUT.read_bytes())
    set_log_level("CRITICAL")  # else a line for every message to a viewer that has gone
    target = TargetRig.of(config, router, site, rig)
    with (
        frictus.connect(target.router, tls=target.tls, patient=True) as client,
        FoxgloveBridge(
            client, target.choose(client), names, samples_per_column, host, port
        ) as bridge,
    ):
        _tell_address(host, bridge.port, as_json)
        run_bridge(bridge, _foxglove_line, seconds, as_json)


def _names_of(streams: str, accepted: Collection[str]) -> list[str]:
    """Return the streams that are asked for, each once."""
    names = [name.strip() for name in streams.split(",") if name.strip()]
    if set(names) - set(accepted) or len(set(names)) < len(names):
        raise typer.BadParameter(
            f"--streams {streams}: each once, of {', '.join(accepted)}", param_hint="--streams"
        )
    return names


def _tell_address(host: str, port: int, as_json: bool) -> None:
    url = f"ws://{f'[{host}]' if ':' in host else host}:{port}"
    if wants_lines(as_json):
        write_line(event="serving", url=url)
        return
    sys.stdout.write(f"open a connection of kind Foxglove WebSocket to {url}\n")
    if host not in LOOPBACK:
        sys.stdout.write("whoever reaches this port sees the rig: it asks for no password\n")
    sys.stdout.flush()


def _foxglove_line(report: "FoxgloveReport") -> str:
    sent = ", ".join(
        f"{topic.removeprefix('stream/')} {count}"
        for topic, count in report.sent.items()
        if topic.startswith("stream/")
    )
    lost = f"; {report.lost} blocks lost" if report.lost else ""
    refused = f"; {report.refused} blocks refused" if report.refused else ""
    return (
        f"{report.seconds:.0f} s: {report.viewers} viewers; {sent or 'no samples asked for'}"
        f"{lost}{refused}; {report.cpu_percent:.1f} % of a processor"
    )


def lsl(
    streams: Annotated[
        str,
        typer.Option(
            "--streams",
            metavar="NAMES",
            help="Of force, accel, voltage, truth, aux, render and finger, with commas.",
        ),
    ] = "force,accel,finger",
    markers: Annotated[
        str | None,
        typer.Option(
            "--markers",
            metavar="NAME",
            help="LSL stream whose markers the rig's recordings get.",
        ),
    ] = None,
    rig: RigOption = None,
    site: SiteOption = None,
    router: RouterOption = None,
    config: ConfigFile = None,
    seconds: Seconds = None,
    as_json: AsJson = False,
) -> None:
    """Send a rig's samples, finger and events to Lab Streaming Layer, until Ctrl-C."""
    try:
        from frictus_service.bridges.lsl import LslBridge
        from frictus_service.bridges.lsl_outlets import OUTLETS
    except ModuleNotFoundError as error:
        raise typer.BadParameter(f"{error}: LSL needs {LSL_INSTALL}") from error
    import frictus

    names = _names_of(streams, OUTLETS)
    if markers is not None and ("'" in markers or not markers):
        raise typer.BadParameter("a stream's name has letters, and no apostrophe")
    target = TargetRig.of(config, router, site, rig)
    with (
        frictus.connect(target.router, tls=target.tls, patient=True) as client,
        LslBridge(client, target.choose(client), names, markers) as bridge,
    ):
        run_bridge(bridge, _lsl_line, seconds, as_json)


def _lsl_line(report: "BridgeReport") -> str:
    sent = ", ".join(
        f"{name} {count}" + (f" ({report.filled[name]} lost)" if report.filled[name] else "")
        for name, count in report.sent.items()
    )
    refused = f"; {report.refused} refused" if report.refused else ""
    return (
        f"{report.seconds:.0f} s: {sent}; markers {report.markers_sent} out, "
        f"{report.markers_received} in{refused}; clock {report.clock_error_ms:+.3f} ms; "
        f"{report.cpu_percent:.1f} % of a processor"
    )
