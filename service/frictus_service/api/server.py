"""The API process: the REST API as an ASGI application, served until it is told to stop.

The reference, `/openapi.json`: made and encoded once.

What any path may answer is added, and what `parse_json` demands of bodies.
"""

import asyncio
import contextlib
import logging
import socket
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from importlib.metadata import version
from typing import Any, Final

import uvicorn
from fastapi import FastAPI, Request
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import JSONResponse, Response
from starlette.routing import Route

from frictus.session import LEASE_MS
from frictus.websocket.messages import MAX_BYTES
from frictus_service.api import error_handlers, problems
from frictus_service.api.dashboard import asyncapi, conversation, pages
from frictus_service.api.dashboard.hub import Hub
from frictus_service.api.http_forms import AbsoluteTargets, Heads
from frictus_service.api.limits import (
    HEAD_BYTES,
    OriginCheck,
    PatientProtocol,
    Rate,
    RequestLimits,
)
from frictus_service.api.own_process import OwnProcesses
from frictus_service.api.patient_socket import PatientSocket
from frictus_service.api.routes import (
    activation,
    calibrations,
    discoveries,
    estimates,
    experiments,
    models,
    monitoring,
    previews,
    recordings,
    rigs,
    studies,
    textures,
)
from frictus_service.api.services import ConnectedPages, RigConnection, Services
from frictus_service.config import Config
from frictus_service.errors import RegistryUnavailableError, StartError
from frictus_service.jobs.calibrations import CALIBRATE, CalibrationEngine
from frictus_service.jobs.discoveries import DISCOVER, DiscoveryEngine
from frictus_service.jobs.engine import RigUse
from frictus_service.jobs.experiments import PRESENT, ExperimentEngine
from frictus_service.library import TextureLibrary
from frictus_service.processes import ReadySignal, StopSignal, existing_objects_frozen
from frictus_service.registry.store import Registry
from frictus_service.security.members import tls_of_client

_TEMPLATE: Final = "#/components/schemas/{model}"


def install(app: FastAPI) -> None:
    """Serve the reference of `app`, whose routes are complete, in place of FastAPI's own."""
    made: list[bytes] = []
    making = asyncio.Lock()

    async def reference(_: Request) -> Response:
        async with making:
            if not made:
                made.append(await run_in_threadpool(_encoded, app))
        return Response(made[0], media_type=JSONResponse.media_type)

    # The first route that matches answers; pages such as /docs name the same path.
    app.router.routes.insert(0, Route(app.openapi_url or "/openapi.json", reference))
    described = app.openapi
    app.openapi = lambda: _completed(described())  # type: ignore[method-assign]


def _encoded(app: FastAPI) -> bytes:
    return bytes(JSONResponse(app.openapi()).body)


def _completed(page: dict[str, Any]) -> dict[str, Any]:
    """Complete a page; the schema of `Problem` comes in place of FastAPI's own errors."""
    schemas = page["components"]["schemas"]
    for unused in ("HTTPValidationError", "ValidationError"):
        schemas.pop(unused, None)
    operations = [operation for path in page["paths"].values() for operation in path.values()]
    for operation in operations:
        for parameter in operation.get("parameters", ()):
            _without_null(parameter["schema"])
        kinds = problems.EVERYWHERE + (problems.OF_BODIES if "requestBody" in operation else ())
        for status, said in problems.documented(*kinds).items():
            operation["responses"].setdefault(str(status), said)
    _make_strict([operation.get("requestBody") for operation in operations], schemas)
    problem = problems.Problem.model_json_schema(ref_template=_TEMPLATE)
    schemas.update(problem.pop("$defs"))
    schemas["Problem"] = problem
    return page


def _without_null(parameter: dict[str, Any]) -> None:
    """Take null from what a parameter may be: one that has no value is left out."""
    kinds = [kind for kind in parameter.get("anyOf", ()) if kind != {"type": "null"}]
    if len(kinds) == 1:
        del parameter["anyOf"]
        parameter.update(kinds[0])


def _make_strict(bodies: list[Any], schemas: dict[str, Any]) -> None:
    """State what is demanded of bodies: known fields only, and the tag of each alternative.

    A type that carries unknown fields on says so itself.
    """
    waiting, seen = bodies, set[int]()
    while waiting:
        part = waiting.pop()
        if isinstance(part, list):
            waiting.extend(part)
        elif isinstance(part, dict) and id(part) not in seen:
            seen.add(id(part))
            waiting.extend(part.values())
            if "$ref" in part:
                waiting.append(_referred(part, schemas))
            if "properties" in part:
                part.setdefault("additionalProperties", False)
            if "discriminator" in part:
                tag = part["discriminator"]["propertyName"]
                for alternative in part["oneOf"]:
                    required = _referred(alternative, schemas).setdefault("required", [])
                    required += [tag] * (tag not in required)


def _referred(part: dict[str, Any], schemas: dict[str, Any]) -> Any:
    return schemas[part["$ref"].rpartition("/")[2]]


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
    experiments,
    estimates,
    studies,
    monitoring,
    pages,
    conversation,
    asyncapi,
)


def build_app(
    config: Config, calibrate: str = CALIBRATE, discover: str = DISCOVER, present: str = PRESENT
) -> FastAPI:
    """Return the API of one site.

    It connects to the router when it is started, or later, when the router is there.

    Parameters
    ----------
    config : Config
        Its site, router, registry, API section, folders and size limits are used.
    calibrate : str
        ``module:function`` that carries out a calibration in a process of its own.
    discover : str
        The same for a discovery.
    present : str
        The same for an experiment.
    """
    # Longer leases are for rigs whose finger nobody could surprise: there, links last, too.
    patient = config.api.page_lease_ms > LEASE_MS
    tls = tls_of_client(config)
    link = RigConnection(config.router.endpoint, config.site, tls, patient)
    hub = Hub(link, config.api.page_lease_ms)
    registry = Registry(config.registry.url)
    use = RigUse()
    jobs = (
        CalibrationEngine(config, registry, use, calibrate),
        DiscoveryEngine(config, discover),
        ExperimentEngine(config, use, present),
    )
    library = TextureLibrary(config.textures)
    given = Services(config, link, library, registry, *jobs, ConnectedPages(), OwnProcesses())

    def recover() -> None:
        recordings.remove_left_exports()
        for engine in jobs:
            try:
                engine.recover()
            except RegistryUnavailableError as error:
                # Rigs are served without it; whoever asks for a model is told.
                _LOG.warning("%s", error)

    def close() -> None:
        given.stop_jobs()
        for engine in jobs:
            engine.close()
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
    app.state.services = given
    app.state.hub = hub
    app.state.limits = RequestLimits()
    app.state.metrics = monitoring.ApiMetrics(link)
    # First: a page asks for 150 files, each of which would be compared with every path below.
    app.mount(pages.PAGE, pages.DashboardFiles(), name="dashboard")
    for part in _PARTS:
        app.include_router(part.router)
    error_handlers.install(app)
    app.add_middleware(Heads)
    app.add_middleware(error_handlers.UnsatisfiableRanges)
    app.add_middleware(error_handlers.Departures)
    app.add_middleware(
        OriginCheck, loopback_only=config.api.loopback, allowed=config.api.origins
    )
    app.add_middleware(Rate, per_s=config.api.max_requests_per_s)
    app.add_middleware(monitoring.CountRequests, metrics=app.state.metrics)
    app.add_middleware(AbsoluteTargets)
    install(app)
    return app


GRACE_S: Final = 3
SEND_BYTES: Final = 262_144
"""What the kernel keeps of answers that a client does not take; Linux would keep megabytes."""


class _Server(uvicorn.Server):
    """Tells when it listens, stops when it is told to, and leaves signals to its caller."""

    def __init__(
        self,
        config: uvicorn.Config,
        stop: StopSignal,
        ready: ReadySignal,
        ending: Callable[[], None],
    ) -> None:
        super().__init__(config)
        self._ending = ending
        self._stop = stop
        self._ready = ready

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        if self.started:
            self._ready.set()

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        self._ending()  # streams of events would hold the end up
        await super().shutdown(sockets)

    async def on_tick(self, counter: int) -> bool:
        return await super().on_tick(counter) or self._stop.is_set()

    def capture_signals(self) -> contextlib.AbstractContextManager[None]:  # type: ignore[override]
        return contextlib.nullcontext()


def listen(host: str, port: int) -> socket.socket:
    """Return a socket that listens at `host`; port 0 takes any free one.

    Raises
    ------
    StartError
        If nothing can listen there.
    """
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    try:
        listener = socket.create_server((host, port), family=family)
        # Connections inherit it. With Nagle's algorithm each answer on a connection that is
        # kept open would wait 40 ms for the client's acknowledgement.
        listener.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BYTES)
        return listener
    except OSError as error:
        raise StartError(
            f"the API cannot listen at {host}:{port}: {error}. If another server runs there, "
            "give `port` in [api] of the configuration another number"
        ) from error


def run_api(config: Config, stop: StopSignal, ready: ReadySignal) -> None:
    """Serve the API until `stop` is set, then end cleanly, with the requests under way.

    Parameters
    ----------
    config : Config
        The whole configuration.
    stop : Event
        Looked at ten times a second.
    ready : Event
        Set as soon as connections are accepted.

    Raises
    ------
    StartError
        If nothing can listen at the configured address.
    """
    with listen(config.api.host, config.api.port) as listener:
        app = build_app(config)
        settings = uvicorn.Config(
            app,
            log_level="warning",
            access_log=False,
            server_header=False,
            http=PatientProtocol,
            ws=PatientSocket,
            h11_max_incomplete_event_size=HEAD_BYTES,
            limit_concurrency=config.api.max_connections,
            timeout_graceful_shutdown=GRACE_S,
            ws_max_size=MAX_BYTES,
            ws_per_message_deflate=False,  # samples hardly shrink, and it costs a core
        )
        server = _Server(settings, stop, ready, app.state.services.stop_jobs)
        with existing_objects_frozen():
            server.run(sockets=[listener])
