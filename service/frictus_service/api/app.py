"""The REST API as an ASGI application."""

import logging
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from importlib.metadata import version
from typing import Final

from fastapi import FastAPI
from fastapi.concurrency import run_in_threadpool

from frictus_service.api import (
    activation,
    calibrations,
    discoveries,
    health,
    metrics,
    models,
    previews,
    problems,
    recordings,
    reference,
    rigs,
    studies,
    textures,
)
from frictus_service.api.callers import ConnectedPages
from frictus_service.api.dashboard import pages, socket
from frictus_service.api.dashboard.hub import Hub
from frictus_service.api.event_stream import Departures
from frictus_service.api.limits import Rate, RequestLimits
from frictus_service.api.origin_check import OriginCheck
from frictus_service.api.rig_connection import RigConnection
from frictus_service.api.services import Services
from frictus_service.config import Config
from frictus_service.jobs.discoveries import DISCOVER, Discoveries
from frictus_service.jobs.jobs import RUN, Jobs
from frictus_service.library import TextureLibrary
from frictus_service.registry.errors import RegistryUnavailableError
from frictus_service.registry.store import Registry
from frictus_service.security.identity import tls_of_client

_LOG: Final = logging.getLogger(__name__)
_PARTS: Final = (
    rigs,
    recordings,
    activation,
    textures,
    previews,
    models,
    calibrations,
    discoveries,
    studies,
    health,
    metrics,
    pages,
    socket,
)


def build_app(config: Config, run: str = RUN, discover: str = DISCOVER) -> FastAPI:
    """Return the API of one site.

    It connects to the router when it is started, or later, when the router is there.

    Parameters
    ----------
    config : Config
        Its site, router, registry, API section, folders and size limits are used.
    run : str
        ``module:function`` that carries out a calibration in a process of its own.
    discover : str
        The same for a discovery.
    """
    link = RigConnection(config.router.endpoint, config.site, tls_of_client(config))
    hub = Hub(link)
    registry = Registry(config.registry.url)
    jobs = Jobs(config, registry, run)
    analyses = Discoveries(config, discover)

    def recover() -> None:
        analyses.shelf.interrupt()
        try:
            if registry.database.exists:  # or nothing was ever calibrated
                jobs.recover()
        except RegistryUnavailableError as error:
            # Rigs are served without it; whoever asks for a model is told.
            _LOG.warning("%s", error)

    def close() -> None:
        analyses.close()
        jobs.close()
        registry.close()
        link.close()

    @asynccontextmanager
    async def linked(_: FastAPI) -> AsyncIterator[None]:
        await run_in_threadpool(recover)
        yield
        await hub.close()
        await run_in_threadpool(close)

    app = FastAPI(
        title="frictus",
        version=version("frictus"),
        summary="Rigs for friction-modulated touch: scenes, textures, models and calibrations",
        lifespan=linked,
        separate_input_output_schemas=False,  # a scene is read and written in one form
    )
    library = TextureLibrary(config.textures)
    app.state.services = Services(
        config, link, library, registry, jobs, analyses, ConnectedPages()
    )
    app.state.hub = hub
    app.state.limits = RequestLimits()
    app.state.metrics = metrics.ApiMetrics(link)
    for part in _PARTS:
        app.include_router(part.router)
    app.mount(pages.PAGE, pages.DashboardFiles(), name="dashboard")
    problems.install(app)
    app.add_middleware(Departures)
    app.add_middleware(OriginCheck, loopback_only=config.api.loopback)
    app.add_middleware(Rate, per_s=config.api.max_requests_per_s)
    app.add_middleware(metrics.CountRequests, metrics=app.state.metrics)
    reference.install(app)
    return app
