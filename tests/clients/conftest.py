"""A tiny fake rig on real Zenoh: a router on a free port, publishers and queryables."""

import contextlib
import functools
import queue
import socket
import threading
import time
from collections.abc import Iterator
from typing import Any, Self

import numpy as np
import pytest
import zenoh
from tests.rig_status import rig_status
from zenoh.handlers import Callback

from frictus import Client, connect
from frictus.block import Block, Flag
from frictus.keys import CALLS, RigKeys, Topic, Topics
from frictus.messages import (
    MESSAGES,
    Applied,
    FingerState,
    Message,
    ModelState,
    Reply,
    Request,
    RigStatus,
    SceneState,
    TimeState,
)
from frictus.model import FirstOrderSpeedLaw, Model
from frictus.session import (
    declare_latest_publisher,
    declare_publisher,
    open_router,
    open_session,
)
from frictus.textures import Scene

WAIT_S = 10.0
APPLIED = Applied(
    gain=1.0,
    feasible_gain=2.0,
    bias=0.2,
    bias_n=0.08,
    scaled=False,
    speed_range_mm_s=(20.0, 100.0),
)


class FakeRig:
    """Answers every call with yes unless `refusal` is set, and notes what it was asked."""

    def __init__(self, router: str, keys: RigKeys) -> None:
        self.keys = keys
        self.router = router
        self.run = 1
        self.refusal: Reply | None = None
        self.silent = False
        self.garbled = False
        self.calls: queue.Queue[tuple[str, Message]] = queue.Queue()
        self.puts: queue.Queue[tuple[str, bytes]] = queue.Queue()
        self.tokens: queue.Queue[tuple[str, bool]] = queue.Queue()
        self.session = open_session(router)
        self.queries: list[zenoh.Query] = []
        self._publishers: dict[str, Any] = {}
        self._declared: list[Any] = []
        for call in CALLS:
            self._declared.append(
                self.session.declare_queryable(
                    keys.call(call), functools.partial(self._answer, call), complete=True
                )
            )
        for topic in (Topics.LEASE, Topics.TEXTURE, Topics.POINTER):
            self._declared.append(
                self.session.declare_subscriber(keys.of(topic), Callback(self._put))
            )
        self._declared.append(
            self.session.liveliness().declare_subscriber(
                keys.any_client_alive, Callback(self._token), history=True
            )
        )
        self.say(Topics.STATUS, self.status())
        self._declared.append(self.session.liveliness().declare_token(keys.alive))

    def _put(self, sample: zenoh.Sample) -> None:
        self.puts.put((str(sample.key_expr), sample.payload.to_bytes()))

    def _token(self, sample: zenoh.Sample) -> None:
        alive = sample.kind == zenoh.SampleKind.PUT
        self.tokens.put((str(sample.key_expr).rpartition("/")[2], alive))

    def _answer(self, call: str, query: zenoh.Query) -> None:
        assert query.payload is not None
        request = MESSAGES[CALLS[call]].from_json(query.payload.to_bytes())
        self.calls.put((call, request))
        if self.silent:
            self.queries.append(query)  # an unanswered query ends when it is dropped
            return
        reply = self.refusal or Reply(
            ok=True,
            state="armed",
            etag="e2",
            applied=APPLIED,
            ticket=7,
            compensation=getattr(request, "compensation", None),
            adaptation=getattr(request, "policy", None),
        )
        with query:
            query.reply(query.key_expr, b"{" if self.garbled else reply.to_json())

    def asked(self, call: str) -> Any:
        """The next request, which must be of this call."""
        name, request = self.calls.get(timeout=WAIT_S)
        assert name == call
        assert isinstance(request, Request)
        return request

    def next_put(self, topic: Topic) -> bytes:
        """The next payload put under a topic."""
        while True:
            key, payload = self.puts.get(timeout=WAIT_S)
            if key == self.keys.of(topic):
                return payload

    def say(self, topic: Topic, message: Message | Block | bytes) -> None:
        """Publish."""
        if topic.suffix not in self._publishers:
            declare = declare_latest_publisher if topic.latest else declare_publisher
            self._publishers[topic.suffix] = declare(self.session, self.keys.of(topic), topic)
        if isinstance(message, Block):
            message = message.pack()
        payload = message if isinstance(message, bytes) else message.to_json()
        self._publishers[topic.suffix].put(payload)

    def status(self, **changes: Any) -> RigStatus:
        own: dict[str, Any] = {
            "site": self.keys.site,
            "rig": self.keys.rig,
            "run": self.run,
            "model_etag": "m1",
            "model_placeholder": True,
            "scene_etag": "s1",
        }
        return rig_status(**(own | changes))

    def block(self, sequence: int, run: int = 1, first_sample: int | None = None) -> Block:
        data = np.full((3, 100), sequence, dtype=np.float32)
        first = 100 * sequence if first_sample is None else first_sample
        return Block(1, run, sequence, first, 0, 0, 20_000.0, Flag.SIMULATED, data)

    def finger(self, sequence: int) -> FingerState:
        return FingerState(
            sequence=sequence,
            sample=100 * sequence,
            utc_ns=0,
            uncertainty_ns=0,
            x_mm=1.0,
            y_mm=2.0,
            vx_mm_s=60.0,
            vy_mm_s=0.0,
            normal_force_n=0.4,
            in_contact=True,
            source="simulated",
            age_ms=16.0,
            stale=False,
            extrapolated=False,
        )

    @contextlib.contextmanager
    def stroking(self, ahead_samples: int = 400) -> Iterator[None]:
        """Say meanwhile where a finger is that strokes, at samples of the time it says."""
        ended = threading.Event()

        def stroke() -> None:
            sequence = 0
            while not ended.wait(0.002):
                sequence += 1
                sample = 100 + (time.time_ns() - 10**18) // 50_000 + ahead_samples
                place = {"sample": sample, "x_mm": 1.0 + sequence % 50}
                self.say(Topics.FINGER, self.finger(sequence).model_copy(update=place))

        thread = threading.Thread(target=stroke)
        thread.start()
        try:
            yield
        finally:
            ended.set()
            thread.join()

    def say_everything_once(self) -> None:
        """Publish scene, model and time as well."""
        base = FirstOrderSpeedLaw(gain_n=0.39, cutoff_0_hz=385.68, slope_hz_per_mm_s=13.811)
        self.say(Topics.SCENE, SceneState(etag="s1", scene=Scene(), applied=APPLIED))
        self.say(Topics.MODEL, ModelState(etag="m1", model=Model(base=base)))
        self.say(
            Topics.TIME,
            TimeState(
                run=1,
                sample=100,
                utc_ns=10**18,
                ns_per_sample=50_000.0,
                uncertainty_ns=1_000,
                skew_ppm=0.0,
                utc_steps=0,
            ),
        )

    def close(self) -> None:
        for query in self.queries:
            query.drop()  # type: ignore[no-untyped-call]
        self.session.close()  # type: ignore[no-untyped-call]

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


@pytest.fixture
def free_endpoint() -> str:
    """Endpoint at which nothing listens."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


@pytest.fixture
def router(free_endpoint: str) -> Iterator[str]:
    """Endpoint of a router that lives as long as the test."""
    with open_router(free_endpoint):
        yield free_endpoint


@pytest.fixture
def fake(router: str) -> Iterator[FakeRig]:
    """A rig named `sim` at site `lab`."""
    with FakeRig(router, RigKeys("lab", "sim")) as rig:
        yield rig


@pytest.fixture
def client(router: str) -> Iterator[Client]:
    """A client named `tester`."""
    with connect(router, "tester") as client:
        yield client
