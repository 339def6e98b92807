"""`frictus foxglove`: a rig live in Foxglove or Lichtblick."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

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
from frictus_service.cli.streams.bridging import run_bridge

if TYPE_CHECKING:
    from frictus_service.bridges.foxglove import FoxgloveReport

INSTALL: Final = "pip install 'frictus[service,foxglove]'"
PORT: Final = 8765
"""Which viewers propose."""
LOOPBACK: Final = ("127.0.0.1", "::1", "localhost")


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
        raise typer.BadParameter(f"{error}: Foxglove needs {INSTALL}") from error
    import frictus
    from frictus_service.recording.foxglove import LAYOUT

    names = [name.strip() for name in streams.split(",") if name.strip()]
    if set(names) - set(STREAM_IDS) or len(set(names)) < len(names):
        raise typer.BadParameter(
            f"--streams {streams}: each once, of {', '.join(STREAM_IDS)}",
            param_hint="--streams",
        )
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
        _begin(host, bridge.port, as_json)
        run_bridge(bridge, _line, seconds, as_json)


def _begin(host: str, port: int, as_json: bool) -> None:
    url = f"ws://{f'[{host}]' if ':' in host else host}:{port}"
    if wants_lines(as_json):
        write_line(event="serving", url=url)
        return
    sys.stdout.write(f"open a connection of kind Foxglove WebSocket to {url}\n")
    if host not in LOOPBACK:
        sys.stdout.write("whoever reaches this port sees the rig: it asks for no password\n")
    sys.stdout.flush()


def _line(report: "FoxgloveReport") -> str:
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
