"""`frictus api`: the REST API alone."""

from frictus_service.cli.options import AsJson, ConfigFile
from frictus_service.cli.serve import said, where_to_look


def api(config: ConfigFile = None, as_json: AsJson = False) -> None:
    """Run the REST API alone until Ctrl-C; the router runs elsewhere."""
    from frictus_service.config import load

    settings = load(config)
    from frictus_service.daemon import supervisor  # seconds, so after the configuration

    say = said(as_json)
    say(where_to_look(settings.api))
    supervisor.serve(settings, ("api",), host_router=False, say=say)
