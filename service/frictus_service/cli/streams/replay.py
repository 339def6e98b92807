"""`frictus replay`: a recording plays as one more rig."""

import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from frictus_service.cli.options import AsJson, ConfigFile, RouterOption, SiteOption
from frictus_service.cli.serve import said

if TYPE_CHECKING:
    from frictus_service.config import Config


def replay(
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="Recording, or what export made of one.")
    ],
    rig: Annotated[str, typer.Option("--rig", help="What the rig is called.")] = "replay",
    once: Annotated[
        bool, typer.Option("--once", help="End with it instead of beginning again.")
    ] = False,
    touch_latency: Annotated[
        float | None,
        typer.Option("--touch-latency", min=0.0, help="s, where an old recording has none."),
    ] = None,
    config: ConfigFile = None,
    router: RouterOption = None,
    site: SiteOption = None,
    as_json: AsJson = False,
) -> None:
    """Play FILE as a simulated rig until Ctrl-C, or its end; the router runs elsewhere.

    What is sensed is what was sensed; what others play on it is felt by nobody.
    """
    from frictus_service.config_file import load

    settings = load(config)
    from pydantic import ValidationError

    from frictus_hardware import ReplayConfig
    from frictus_hardware.errors import ConfigError
    from frictus_hardware.replay.tape import read_tape
    from frictus_service.config import Config, RouterConfig
    from frictus_service.daemon.processes import serve as daemon
    from frictus_service.recording.tape import export_tape

    say = said(as_json)
    with tempfile.TemporaryDirectory(prefix="frictus-replay-") as folder:
        tape = file
        if file.suffix == ".mcap":
            tape = Path(folder) / f"{file.stem}.npz"
            done = export_tape(file, tape, touch_latency_s=touch_latency)
            say(f"{file.name}: {done.seconds:.2f} s, {done.missing} samples missing")
            say(f"the recording {done.ending}")
        try:
            backend = ReplayConfig(
                file=tape.absolute(),
                sample_rate_hz=read_tape(tape).sample_rate_hz,
                at_end="stop" if once else "loop",
            )
            endpoint = router or settings.router.endpoint
            asked = {
                "rig": rig,
                "site": site or settings.site,
                "router": RouterConfig(endpoint=endpoint, host=False),
                "backend": backend,
            }
            played = Config.model_validate(vars(settings) | asked)
        except ConfigError as error:
            raise typer.BadParameter(str(error)) from error
        except ValidationError as error:
            faults = [f"{each['loc'][-1]}: {each['msg']}" for each in error.errors()]
            raise typer.BadParameter("; ".join(faults)) from error
        with _watched(played) if once else nullcontext(lambda: False) as is_over:
            daemon.serve(played, ("rig",), host_router=False, say=say, is_over=is_over)


@contextmanager
def _watched(played: "Config") -> Iterator[Callable[[], bool]]:
    """Give what says whether the recording is over: its rig has lost its device then."""
    import frictus
    from frictus_service.security.members import tls_of_rig

    def is_over() -> bool:
        try:
            fault = client.rig(played.rig, played.site).status().fault
        except frictus.FrictusError:
            return False  # whoever runs the rig tells what became of it
        return fault is not None and fault.kind == "device_lost"

    tls = tls_of_rig(played)
    with frictus.connect(played.router.endpoint, tls=tls, patient=True) as client:
        yield is_over
