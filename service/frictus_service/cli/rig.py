"""`frictus rig`: the rig of this machine alone."""

from frictus_service.cli.options import AsJson, ConfigFile
from frictus_service.cli.serve import said


def rig(config: ConfigFile = None, as_json: AsJson = False) -> None:
    """Run the rig alone until Ctrl-C; the router runs elsewhere."""
    from frictus_service.config import load

    settings = load(config, runs_rig=True)
    from frictus_service.daemon import supervisor  # seconds, so after the configuration

    supervisor.serve(settings, ("rig",), host_router=False, say=said(as_json))
