"""`frictus lsl`: a rig on Lab Streaming Layer."""

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
)
from frictus_service.cli.streams.bridging import run_bridge

if TYPE_CHECKING:
    from frictus_service.bridges.lsl import BridgeReport

INSTALL: Final = "pip install 'frictus[lsl]'"


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
        raise typer.BadParameter(f"{error}: LSL needs {INSTALL}") from error
    import frictus

    names = [name.strip() for name in streams.split(",") if name.strip()]
    unknown = sorted(set(names) - set(OUTLETS))
    if unknown or len(set(names)) < len(names):
        raise typer.BadParameter(
            f"--streams {streams}: each once, of {', '.join(OUTLETS)}", param_hint="--streams"
        )
    if markers is not None and ("'" in markers or not markers):
        raise typer.BadParameter("a stream's name has letters, and no apostrophe")
    target = TargetRig.of(config, router, site, rig)
    with (
        frictus.connect(target.router, tls=target.tls, patient=True) as client,
        LslBridge(client, target.choose(client), names, markers) as bridge,
    ):
        run_bridge(bridge, _line, seconds, as_json)


def _line(report: "BridgeReport") -> str:
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
