"""What the paths of the API work with; one instance stands in the app's state."""

from dataclasses import dataclass

from fastapi import Request

from frictus_service.api.callers import Pages
from frictus_service.api.link import RigLink
from frictus_service.config import Config
from frictus_service.jobs.discoveries import Discoveries
from frictus_service.jobs.jobs import Jobs
from frictus_service.library import TextureLibrary
from frictus_service.registry.store import Registry


@dataclass(frozen=True, slots=True)
class Services:
    """Configuration, rigs, texture library, registry, calibrations, discoveries, pages."""

    config: Config
    link: RigLink
    library: TextureLibrary
    registry: Registry
    jobs: Jobs
    discoveries: Discoveries
    pages: Pages


def services(request: Request) -> Services:
    """Return the services of the app that serves `request`."""
    found: Services = request.app.state.services
    return found
