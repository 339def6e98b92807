"""A rig made of real Zenoh sessions that answers every call, and the API beside it."""

import queue
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
import zenoh
from fastapi.testclient import TestClient
from tests.rig_status import rig_status
from zenoh import ext

from frictus.keys import CALLS, RigKeys, Topic, Topics
from frictus.messages import (
    AdaptationPolicy,
    AdaptationRequest,
    Applied,
    CompensationRequest,
    Counters,
    Fault,
    Message,
    ModelRequest,
    ModelState,
    Reply,
    Request,
    RigStatus,
    SceneRequest,
    SceneState,
    TimeState,
)
from frictus.model import BY_MODEL, Compensation, FirstOrderSpeedLaw, Model
from frictus.session import open_router, open_session
from frictus.textures import Component, Region, Scene, Spectrum
from frictus_service.api.server import build_app
from frictus_service.config import ApiConfig, Config, RegistryConfig, RouterConfig, Token
from frictus_service.jobs.calibrations import CALIBRATE
from frictus_service.jobs.discoveries import DISCOVER
from frictus_service.jobs.experiments import PRESENT
from frictus_service.processes import free_endpoint

SITE = "lab"
APPLIED = Applied(
    gain=0.8,
    feasible_gain=0.9,
    bias=0.3,
    bias_n=0.12,
    scaled=True,
    speed_range_mm_s=(20.0, 100.0),
    notes=["scaled to fit the drive"],
)


def status(rig: str, **changes: Any) -> RigStatus:
    """What a disarmed simulated rig says."""
    said = rig_status(rig=rig, run=7, counters=Counters(blocks=1234, underruns=2))
    return said.model_copy(update=changes)


@dataclass
class FakeRig:
    """Holds what a rig holds, answers calls in a thread of its own, refuses when told to."""

    session: zenoh.Session
    name: str
    refusal: tuple[str, str] | None = None
    silent: bool = False
    """Does what it is asked, and does not answer."""
    publishes: bool = True
    owner: str | None = None
    compensation: Compensation = BY_MODEL
    adaptation: AdaptationPolicy = "observe"
    calls: list[tuple[str, Request]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.keys = RigKeys(SITE, self.name)
        self.count = 0
        self._unanswered: list[zenoh.Query] = []
        self._waiting: queue.Queue[tuple[str, zenoh.Query] | None] = queue.Queue()
        self._publishers: dict[str, Any] = {}
        self._declared = [
            self.session.declare_queryable(
                self.keys.call(call),
                lambda query, call=call: self._waiting.put((call, query)),  # type: ignore[misc]
            )
            for call in CALLS
        ]
        spectrum = Spectrum(components=[Component(amplitude_n=0.1, cycles_per_mm=1.0)])
        self.scene = Scene(regions=[Region(texture=spectrum)], name="first")
        law = FirstOrderSpeedLaw(gain_n=0.39, cutoff_0_hz=385.68, slope_hz_per_mm_s=13.811)
        self.model = Model(base=law)
        self.publish(Topics.SCENE, SceneState(etag="s0", scene=self.scene, applied=APPLIED))
        self.publish(Topics.MODEL, ModelState(etag="m0", model=self.model))
        self.publish(
            Topics.TIME,
            TimeState(
                run=7,
                sample=1_000,
                utc_ns=time.time_ns(),
                ns_per_sample=50_000.0,
                uncertainty_ns=900,
                skew_ppm=12.5,
                utc_steps=0,
            ),
        )
        self.tell()
        self._token = self.session.liveliness().declare_token(self.keys.alive)
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def publish(self, topic: Topic, message: Message) -> None:
        if topic.suffix not in self._publishers:
            self._publishers[topic.suffix] = ext.declare_advanced_publisher(
                self.session,
                self.keys.of(topic),
                cache=ext.CacheConfig(max_samples=1),
                publisher_detection=True,
            )
        if self.publishes:
            self._publishers[topic.suffix].put(message.to_json())

    def tell(self, **changes: Any) -> None:
        said = {
            "owner": self.owner,
            "compensation": self.compensation,
            "adaptation": self.adaptation,
            **changes,
        }
        self.publish(Topics.STATUS, status(self.name, **said))

    def trip(self) -> None:
        fault = Fault(kind="safety", reason="monitor", utc_ns=1, action="reset")
        self.tell(state="tripped", fault=fault)

    def vanish(self) -> None:
        self._token.undeclare()  # type: ignore[no-untyped-call]

    def close(self) -> None:
        self._waiting.put(None)
        self._thread.join(10.0)

    def _serve(self) -> None:
        while (item := self._waiting.get()) is not None:
            call, query = item
            assert query.payload is not None
            reply = self._answer(call, query.payload.to_bytes())
            if self.silent:
                self._unanswered.append(query)  # it would end as it is dropped
                continue
            with query:
                query.reply(query.key_expr, reply.to_json())

    def _answer(self, call: str, payload: bytes) -> Reply:
        if self.refusal is not None:
            code, message = self.refusal
            return Reply(ok=False, code=code, message=message)
        self.count += 1
        if call == "scene":
            scene = SceneRequest.model_validate_json(payload)
            self.calls.append((call, scene))
            etag = f"s{self.count}"
            self.publish(
                Topics.SCENE, SceneState(etag=etag, scene=scene.scene, applied=APPLIED)
            )
            return Reply(ok=True, etag=etag, applied=APPLIED)
        if call == "model":
            model = ModelRequest.model_validate_json(payload)
            self.calls.append((call, model))
            etag = f"m{self.count}"
            self.publish(Topics.MODEL, ModelState(etag=etag, model=model.model))
            return Reply(ok=True, etag=etag)
        if call == "compensation":
            asked = CompensationRequest.model_validate_json(payload)
            self.calls.append((call, asked))
            self.compensation = asked.compensation
            answered_ns = time.time_ns()
            self.tell(utc_ns=answered_ns, state="armed")
            return Reply(ok=True, compensation=asked.compensation, utc_ns=answered_ns)
        if call == "adaptation":
            chosen = AdaptationRequest.model_validate_json(payload)
            self.calls.append((call, chosen))
            self.adaptation = chosen.policy
            answered_ns = time.time_ns()
            self.tell(utc_ns=answered_ns)
            return Reply(ok=True, etag="m0", adaptation=chosen.policy, utc_ns=answered_ns)
        self.calls.append((call, Request.model_validate_json(payload)))
        return Reply(ok=True, state="stopping" if call == "stop" else "disarmed")


@pytest.fixture(scope="session")
def router() -> Iterator[str]:
    """The endpoint of a running router."""
    endpoint = free_endpoint()
    with open_router(endpoint):
        yield endpoint


@pytest.fixture(scope="session")
def rig_session(router: str) -> Iterator[zenoh.Session]:
    with open_session(router) as session:
        yield session


@pytest.fixture
def rig(rig_session: zenoh.Session, request: pytest.FixtureRequest) -> Iterator[FakeRig]:
    """A rig with a name of its own, present."""
    name = f"rig-{abs(hash(request.node.nodeid)) % 10**9}"
    fake = FakeRig(rig_session, name)
    yield fake
    fake.close()
    for declared in (*fake._declared, *fake._publishers.values()):
        declared.undeclare()
    try:
        fake.vanish()
    except zenoh.ZError:
        pass  # it has vanished already


TOKENS = {scope: f"the-{scope}-token-of-a-test" for scope in ("read", "render", "admin")}
TOKENS["calibrate"] = "the-calibrate-token-of-a-test"


def configuration(router: str, folder: Path, **api: Any) -> Config:
    return Config(
        site=SITE,
        textures=folder,
        studies=folder.parent / "studies",
        registry=RegistryConfig(url=f"sqlite:///{folder.parent / 'registry.db'}"),
        router=RouterConfig(endpoint=router, host=False),
        api=ApiConfig(**api),
    )


Serve = Callable[..., TestClient]


@pytest.fixture
def serve(router: str, tmp_path: Path) -> Iterator[Serve]:
    """Make a client of an app; without arguments one that is open, on loopback."""
    clients: list[TestClient] = []

    def start(
        tokens: bool = False,
        endpoint: str = router,
        calibrate: str = CALIBRATE,
        discover: str = DISCOVER,
        present: str = PRESENT,
        **changes: Any,
    ) -> TestClient:
        given: dict[str, Any] = {}
        if tokens:
            given["tokens"] = tuple(
                Token(name=scope, scopes=(scope,), value=value)
                for scope, value in TOKENS.items()
            )
        config = configuration(endpoint, tmp_path / "textures", **given)
        app = build_app(config.model_copy(update=changes), calibrate, discover, present)
        client = TestClient(
            app, base_url="http://127.0.0.1:8420", raise_server_exceptions=False
        )
        clients.append(client.__enter__())
        return client

    yield start
    for client in clients:
        client.__exit__(None, None, None)


@pytest.fixture
def api(serve: Serve) -> TestClient:
    return serve()
