"""For whatever supervises the service: liveness, readiness, and Prometheus metrics."""

import sys
import time
from collections.abc import Iterator
from typing import Annotated, Final, get_args

from fastapi import APIRouter, Depends, Request
from fastapi.responses import Response
from prometheus_client import CollectorRegistry, Counter, Histogram
from prometheus_client.exposition import CONTENT_TYPE_LATEST, generate_latest
from prometheus_client.metrics_core import (
    CounterMetricFamily,
    GaugeMetricFamily,
    InfoMetricFamily,
    Metric,
)
from prometheus_client.registry import Collector
from pydantic import BaseModel, Field
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from frictus.errors import FrictusError, LinkError
from frictus.messages import Counters, LoopTiming, RigStatus, SafetyState
from frictus_service.api import problems
from frictus_service.api.access import needs
from frictus_service.api.services import RigConnection, Services, services

_METHODS: Final = frozenset({"GET", "HEAD", "OPTIONS", "POST", "PUT", "PATCH", "DELETE"})
_RIG: Final = ["site", "rig"]
ASK_S: Final = 5.0
"""For asking rigs, all together; each that is silent would take 2 s."""
router = APIRouter(tags=["health"])


class ApiMetrics:
    """Counts the requests of one app, in a registry of its own.

    Parameters
    ----------
    link : RigConnection
        Where the rigs' figures come from.
    """

    def __init__(self, link: RigConnection) -> None:
        self.registry = CollectorRegistry()
        self.registry.register(RigCollector(link))
        self.requests = Counter(
            "frictus_api_requests",
            "Requests answered, by path as documented.",
            ["method", "path", "status"],
            registry=self.registry,
        )
        self.seconds = Histogram(
            "frictus_api_request_seconds",
            "Time until a request was answered.",
            ["method", "path"],
            registry=self.registry,
        )


class RigCollector(Collector):
    """Reads the newest status of every rig of the site when Prometheus asks."""

    def __init__(self, link: RigConnection) -> None:
        self._link = link

    def describe(self) -> list[Metric]:
        """Return nothing: the registry need not ask the rigs when this is registered."""
        return []

    def collect(self) -> Iterator[Metric]:
        """Return the metrics of all rigs that are present."""
        linked = GaugeMetricFamily("frictus_router_linked", "Whether the router is linked.")
        up = GaugeMetricFamily("frictus_rig_up", "Whether a rig tells its status.", labels=_RIG)
        statuses: list[tuple[list[str], RigStatus]] = []
        try:
            names = self._link.names()
            linked.add_metric([], 1.0)
        except LinkError:
            names = []
            linked.add_metric([], 0.0)
        skipped = GaugeMetricFamily(
            "frictus_rigs_not_asked", "Rigs left out: asking the others had taken too long."
        )
        begun_s, asked = time.monotonic(), 0
        for name in names:
            if time.monotonic() - begun_s > ASK_S:
                break
            asked += 1
            # Of the rig that was asked, whatever it says it is.
            labels = [self._link.site, name]
            try:
                statuses.append((labels, self._link.rig(name).status()))
                up.add_metric(labels, 1.0)
            except FrictusError:
                up.add_metric(labels, 0.0)
        skipped.add_metric([], float(len(names) - asked))
        yield linked
        yield up
        yield skipped
        if statuses:
            yield from _of_rigs(statuses)


class CountRequests:
    """ASGI middleware that counts and times requests."""

    def __init__(self, app: ASGIApp, metrics: ApiMetrics) -> None:
        self._app = app
        self._metrics = metrics

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on and count its answer."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        begun_s = time.perf_counter()
        status = 500

        async def watched(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
            await send(message)

        try:
            await self._app(scope, receive, watched)
        finally:
            method = scope["method"] if scope["method"] in _METHODS else "other"
            path = getattr(scope.get("route"), "path", "none")  # bounded: never the raw path
            self._metrics.requests.labels(method, path, str(status)).inc()
            self._metrics.seconds.labels(method, path).observe(time.perf_counter() - begun_s)


@router.get(
    "/metrics",
    dependencies=[Depends(needs("read"))],
    response_class=Response,
    responses={
        **problems.documented(problems.UnauthenticatedError, problems.MissingScopeError),
        200: {"content": {"text/plain": {}}, "description": "Prometheus text format"},
    },
)
def metrics(request: Request) -> Response:
    """Return all metrics in the Prometheus text format."""
    found: ApiMetrics = request.app.state.metrics
    return Response(generate_latest(found.registry), media_type=CONTENT_TYPE_LATEST)


def _of_rigs(statuses: list[tuple[list[str], RigStatus]]) -> Iterator[Metric]:
    for name in Counters.model_fields:
        text = f"{name.replace('_', ' ')} since the rig started."
        counter = CounterMetricFamily(f"frictus_rig_{name}", text, labels=_RIG)
        for rig, status in statuses:
            counter.add_metric(rig, float(min(getattr(status.counters, name), sys.maxsize)))
        yield counter
    for name in LoopTiming.model_fields:
        seconds = GaugeMetricFamily(
            f"frictus_rig_loop_{name.removesuffix('_ms')}_seconds",
            f"{name.removesuffix('_ms').replace('_', ' ')} of the block loop.",
            labels=_RIG,
        )
        for rig, status in statuses:
            seconds.add_metric(rig, getattr(status.timing, name) / 1_000)
        yield seconds
    yield from _states(statuses)


def _states(statuses: list[tuple[list[str], RigStatus]]) -> Iterator[Metric]:
    state = GaugeMetricFamily(
        "frictus_rig_state", "1 for the state the rig is in.", labels=[*_RIG, "state"]
    )
    info = InfoMetricFamily("frictus_rig", "What the rig is.", labels=_RIG)
    for rig, status in statuses:
        for name in get_args(SafetyState):
            state.add_metric([*rig, name], float(status.state == name))
        described = {
            "version": status.version,
            "backend": status.backend,
            "simulated": str(status.simulated).lower(),
            "model_etag": status.model_etag,
            "model_placeholder": str(status.model_placeholder).lower(),
        }
        info.add_metric(rig, described)
    yield state
    yield info


class Alive(BaseModel):
    """The process answers."""

    alive: bool = True


class Ready(BaseModel):
    """The API can do its work."""

    ready: bool = True
    site: str
    rigs: int
    registry: bool = Field(description="Whether the registry of models can be used")


@router.get("/v1/health")
async def health() -> Alive:  # at once, not behind others who wait for a thread
    """Say that the process answers; nothing else is looked at."""
    return Alive()


@router.get("/v1/ready", responses=problems.documented(problems.NoLinkError))
def ready(given: Annotated[Services, Depends(services)]) -> Ready:
    """Say whether the router is linked; a site without a rig is ready too.

    Rigs are served without the registry: `registry` says whether models can be had.
    """
    return Ready(
        site=given.link.site,
        rigs=len(given.link.names()),
        registry=given.registry.database.usable,
    )
