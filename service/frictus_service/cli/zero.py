"""`frictus zero`: the output of this machine's device to zero, without the service."""

from frictus_service.cli.lines import write_line
from frictus_service.cli.options import AsJson, ConfigFile, wants_lines


def zero(config: ConfigFile = None, as_json: AsJson = False) -> None:
    """Reset the configured device, which brings its output to zero; nothing need be running.

    A rig that drives the device loses it, and trips.
    """
    from frictus_hardware import reset_device
    from frictus_service.config import load

    backend = load(config).backend
    reset_device(backend)
    if wants_lines(as_json):
        write_line(event="reset", backend=backend.kind)
    else:
        import typer

        typer.echo(f"the device ({backend.kind}) was reset: its output is zero")
