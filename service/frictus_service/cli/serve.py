"""`frictus serve`, and its parts alone: `rig`, `api`, `router`, `recorder`, `tracker`."""

import socket
import sys
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from frictus_service.cli.options import AsJson, ConfigFile, write_line

if TYPE_CHECKING:
    from frictus_service.config import ApiConfig, Config


def serve(config: ConfigFile = None, as_json: AsJson = False) -> None:
    """Run router, rig, recorder, tracker and API on this machine until Ctrl-C."""
    from frictus_service.config_file import load

    settings = with_port(load(config, runs_rig=True))
    from frictus_service.daemon.processes import serve as daemon  # seconds: after the file
    from frictus_service.daemon.processes.supervisor import ALL

    say = said(as_json)
    tell_of_folders(settings, say)
    if settings.api.enabled:
        say(where_to_look(settings.api))
    wanted = {"api": settings.api.enabled, "tracker": settings.tracker.enabled}
    parts = tuple(part for part in ALL if wanted.get(part, True))
    daemon.serve(settings, parts, say=say)


def with_port(settings: "Config") -> "Config":
    """Return settings whose API has a port of its own, also after a restart: 0 is any free."""
    if settings.api.port:
        return settings
    from frictus_service.processes import free_port

    api = settings.api.model_copy(update={"port": free_port()})
    return settings.model_copy(update={"api": api})


def where_to_look(api: "ApiConfig") -> str:
    """Return what an operator is told of the API's pages."""
    host = socket.gethostname() if api.host in ("0.0.0.0", "::") else api.host
    url = f"http://{f'[{host}]' if ':' in host else host}:{api.port}"
    return f"the dashboard will be at {url}/ and the API's description at {url}/docs"


def tell_of_folders(settings: "Config", say: Callable[[str], None]) -> None:
    """Say which folders cannot be used; a rig does without until somebody asks for them."""
    from frictus_service.cli.checks import storage_checks

    for check in storage_checks.folders(settings):
        say(f"{check.found}: {check.to_do}")


def said(as_json: bool) -> Callable[[str], None]:
    """Return what writes down the lines that a service says to its operator."""

    def to_stderr(line: str) -> None:
        sys.stderr.write(f"{line}\n")
        sys.stderr.flush()

    def to_stdout(line: str) -> None:
        write_line(event="said", utc_ns=time.time_ns(), text=line)

    return to_stdout if as_json else to_stderr


def rig(config: ConfigFile = None, as_json: AsJson = False) -> None:
    """Run the rig alone until Ctrl-C; the router runs elsewhere."""
    from frictus_service.config_file import load

    settings = load(config, runs_rig=True)
    from frictus_service.daemon.processes import serve as daemon  # seconds: after the file

    daemon.serve(settings, ("rig",), host_router=False, say=said(as_json))


def api(config: ConfigFile = None, as_json: AsJson = False) -> None:
    """Run the REST API alone until Ctrl-C; the router runs elsewhere."""
    from frictus_service.config_file import load

    settings = with_port(load(config))
    from frictus_service.daemon.processes import serve as daemon  # seconds: after the file

    say = said(as_json)
    tell_of_folders(settings, say)
    say(where_to_look(settings.api))
    daemon.serve(settings, ("api",), host_router=False, say=say)


def router(config: ConfigFile = None, as_json: AsJson = False) -> None:
    """Run the router alone until Ctrl-C; rigs, recorders and APIs run elsewhere."""
    from frictus_service.config_file import load

    settings = load(config)
    from frictus_service.daemon.processes import serve as daemon  # seconds: after the file

    daemon.serve(settings, (), host_router=True, say=said(as_json))


def recorder(config: ConfigFile = None, as_json: AsJson = False) -> None:
    """Run the recorder alone until Ctrl-C, on any machine; the router runs elsewhere."""
    from frictus_service.config_file import load

    settings = load(config)
    from frictus_service.daemon.processes import serve as daemon  # seconds: after the file

    say = said(as_json)
    tell_of_folders(settings, say)
    daemon.serve(settings, ("recorder",), host_router=False, say=say)


def tracker(config: ConfigFile = None, as_json: AsJson = False) -> None:
    """Run the tracker alone until Ctrl-C, best beside its rig; the router runs elsewhere."""
    from frictus_service.config_file import load

    settings = load(config)
    from frictus_service.daemon.processes import serve as daemon  # seconds: after the file

    daemon.serve(settings, ("tracker",), host_router=False, say=said(as_json))
