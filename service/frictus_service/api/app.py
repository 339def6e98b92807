"""The REST API as an ASGI application."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from importlib.metadata import version
from typing import Any

from fastapi import FastAPI
from fastapi.concurrency import run_in_threadpool

from frictus_service.api import health, metrics, problems, rigs, textures
from frictus_service.api.gate import Gate
from frictus_service.api.link import RigLink
from frictus_service.api.services import Services
from frictus_service.config import Config
from frictus_service.library import TextureLibrary


def build_app(config: Config) -> FastAPI:
    """Return the API of one site.

    It connects to the router when it is started, or later, when the router is there.

    Parameters
    ----------
    config : Config
        Its site, router, API section, texture folder and size limits are used.
    """
    link = RigLink(config.router.endpoint, config.site)

    @asynccontextmanager
    async def linked(_: FastAPI) -> AsyncIterator[None]:
        yield
        await run_in_threadpool(link.close)

    app = FastAPI(
        title="frictus",
        version=version("frictus"),
        summary="Rigs for friction-modulated touch: their state, scenes, models and textures",
        lifespan=linked,
        separate_input_output_schemas=False,  # a scene is read and written in one form
    )
    app.state.services = Services(config, link, TextureLibrary(config.textures))
    app.state.metrics = metrics.ApiMetrics(link)
    for part in (rigs, textures, health, metrics):
        app.include_router(part.router)
    problems.install(app)
    app.add_middleware(Gate, loopback_only=config.api.loopback)
    app.add_middleware(metrics.CountRequests, metrics=app.state.metrics)
    _document_problems(app)
    return app


def _document_problems(app: FastAPI) -> None:
    """Put the schema of `Problem` in the OpenAPI page, in place of FastAPI's own errors."""
    made = app.openapi

    def described() -> dict[str, Any]:
        page = made()
        schemas = page["components"]["schemas"]
        for unused in ("HTTPValidationError", "ValidationError"):
            schemas.pop(unused, None)
        template = "#/components/schemas/{model}"
        problem = problems.Problem.model_json_schema(ref_template=template)
        schemas.update(problem.pop("$defs"))
        schemas["Problem"] = problem
        return page

    app.openapi = described  # type: ignore[method-assign]
