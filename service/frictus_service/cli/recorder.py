"""`frictus recorder`: the recorder alone."""

from frictus_service.cli.options import AsJson, ConfigFile
from frictus_service.cli.serve import said


def recorder(config: ConfigFile = None, as_json: AsJson = False) -> None:
    """Run the recorder alone until Ctrl-C, on any machine; the router runs elsewhere."""
    from frictus_service.config import load

    settings = load(config)
    from frictus_service.daemon import supervisor  # seconds, so after the configuration

    supervisor.serve(settings, ("recorder",), host_router=False, say=said(as_json))
