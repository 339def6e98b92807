"""`frictus router`: the router of a site alone."""

from frictus_service.cli.options import AsJson, ConfigFile
from frictus_service.cli.serve import said


def router(config: ConfigFile = None, as_json: AsJson = False) -> None:
    """Run the router alone until Ctrl-C; rigs, recorders and APIs run elsewhere."""
    from frictus_service.config import load

    settings = load(config)
    from frictus_service.daemon import supervisor  # seconds, so after the configuration

    supervisor.serve(settings, (), host_router=True, say=said(as_json))
