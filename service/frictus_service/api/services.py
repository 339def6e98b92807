"""What the paths of the API work with; one instance stands in the app's state."""

from dataclasses import dataclass

from fastapi import Request

from frictus_service.api.callers import ConnectedPages
from frictus_service.api.rig_connection import RigConnection
from frictus_service.config import Config
from frictus_service.jobs.discoveries import Discoveries
from frictus_service.jobs.jobs import Jobs
from frictus_service.library import TextureLibrary
from frictus_service.registry.store import Registry


@dataclass(frozen=True, slots=True)
class Services:
    """Configuration, rigs, texture library, registry, calibrations, discoveries, pages."""

    config: Config
    link: RigConnection
    library: TextureLibrary
    registry: Registry
    jobs: Jobs
    discoveries: Discoveries
    pages: ConnectedPages


def services(request: Request) -> Services:
    """Return the services of the app that serves `request`."""
    found: Services = request.app.state.services
    return found
