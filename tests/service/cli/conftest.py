"""A rig made of a real Zenoh session that can be armed and that publishes what rigs publish."""

import queue
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zenoh
from tests.rig_status import rig_status
from zenoh import ext

from frictus.block import Block, Flag
from frictus.keys import CALLS, STREAMS, RigKeys, Topic, Topics
from frictus.messages import (
    Applied,
    CompensationRequest,
    FingerState,
    Message,
    Reply,
    Request,
    SafetyState,
    SceneRequest,
    SceneState,
)
from frictus.model import BY_MODEL
from frictus.session import open_router, open_session
from frictus_service.processes import free_endpoint

RATE_HZ = 20_000.0
BLOCK = 400
CHANNELS = {1: 3, 2: 3, 3: 1, 4: 5}
APPLIED = Applied(
    gain=0.8,
    feasible_gain=0.9,
    bias=0.3,
    bias_n=0.1,
    scaled=True,
    speed_range_mm_s=(0.0, 300.0),
)


class FakeRig:
    """Answers calls in one thread and publishes 50 blocks per second and stream in another."""

    def __init__(self, session: zenoh.Session) -> None:
        self.session = session
        self.name = "fake"
        self.keys = RigKeys("lab", self.name)
        self.refusal: tuple[str, str] | None = None
        self.remarks = ""
        """Said with each answer."""
        self.skips = False
        """Leave out every tenth block."""
        self.trip_after_scene = False
        self.calls: list[tuple[str, Any]] = []
        self.called = threading.Condition()
        self.state: SafetyState = "disarmed"
        self.owner: str | None = None
        self.compensation = BY_MODEL
        self._over = threading.Event()
        self._waiting: queue.Queue[tuple[str, zenoh.Query] | None] = queue.Queue()
        self._latest: dict[str, Any] = {
            topic.suffix: ext.declare_advanced_publisher(
                session,
                self.keys.of(topic),
                cache=ext.CacheConfig(max_samples=1),
                publisher_detection=True,
            )
            for topic in (Topics.STATUS, Topics.SCENE)
        }
        self._queryables: list[Any] = [
            session.declare_queryable(
                self.keys.call(call),
                lambda query, call=call: self._waiting.put((call, query)),  # type: ignore[misc]
            )
            for call in CALLS
        ]
        self.tell()
        self._token = session.liveliness().declare_token(self.keys.alive)
        self._threads = [threading.Thread(target=work) for work in (self._answer, self._play)]
        for thread in self._threads:
            thread.start()

    def close(self) -> None:
        self._token.undeclare()  # type: ignore[no-untyped-call]
        self._over.set()
        self._waiting.put(None)
        for thread in self._threads:
            thread.join(10.0)
        for declared in [*self._queryables, *self._latest.values()]:
            declared.undeclare()

    def wait_for(self, call: str, timeout_s: float = 20.0) -> bool:
        with self.called:
            return self.called.wait_for(lambda: call in [c for c, _ in self.calls], timeout_s)

    def tell(self, **changes: Any) -> None:
        said = rig_status(
            rig=self.name,
            state=self.state,
            owner=self.owner,
            block_samples=BLOCK,
            compensation=self.compensation,
        )
        self.publish(Topics.STATUS, said.model_copy(update=changes))

    def publish(self, topic: Topic, message: Message) -> None:
        self._latest[topic.suffix].put(message.to_json())

    def _answer(self) -> None:
        while (item := self._waiting.get()) is not None:
            call, query = item
            with query:
                assert query.payload is not None
                reply = self._reply(call, query.payload.to_bytes())
                query.reply(query.key_expr, reply.to_json())

    def _reply(self, call: str, payload: bytes) -> Reply:
        kinds: dict[str, type[Request]] = {
            "scene": SceneRequest,
            "compensation": CompensationRequest,
        }
        request = kinds.get(call, Request).model_validate_json(payload)
        with self.called:
            self.calls.append((call, request))
            self.called.notify_all()
        if self.refusal is not None:
            return Reply(ok=False, code=self.refusal[0], message=self.refusal[1])
        if call == "arm":
            self.state, self.owner = "armed", request.client
        elif call == "disarm":
            self.state, self.owner = "disarmed", None
        elif isinstance(request, CompensationRequest):
            self.compensation = request.compensation
        elif isinstance(request, SceneRequest):
            state = SceneState(etag="s1", scene=request.scene, applied=APPLIED)
            self.publish(Topics.SCENE, state)
            if self.trip_after_scene:
                threading.Timer(0.5, self._trip).start()
        self.tell()
        return Reply(
            ok=True,
            state=self.state,
            etag="s1",
            applied=APPLIED,
            compensation=self.compensation,
            message=self.remarks,
        )

    def _trip(self) -> None:
        self.state, self.owner = "tripped", None
        self.tell()

    def _play(self) -> None:
        sequence = 0
        due_s = time.monotonic()
        while not self._over.is_set():
            if not (self.skips and sequence % 10 == 0):
                self._publish_blocks(sequence)
            self.session.put(self.keys.of(Topics.FINGER), _finger(sequence).to_json())
            sequence += 1
            due_s += BLOCK / RATE_HZ
            self._over.wait(max(0.0, due_s - time.monotonic()))

    def _publish_blocks(self, sequence: int) -> None:
        time_s = (sequence * BLOCK + np.arange(BLOCK)) / RATE_HZ
        tone = 0.1 * np.sin(2.0 * np.pi * 100.0 * time_s)
        for stream, channels in CHANNELS.items():
            data = np.tile(tone.astype(np.float32), (channels, 1))
            block = Block(
                stream,
                1,
                sequence,
                sequence * BLOCK,
                time.time_ns(),
                1_000,
                RATE_HZ,
                Flag(0),
                data,
            )
            self.session.put(self.keys.of(STREAMS[stream]), block.pack())


def _finger(sequence: int) -> FingerState:
    return FingerState(
        sequence=sequence,
        sample=sequence * BLOCK,
        utc_ns=time.time_ns(),
        uncertainty_ns=1_000,
        x_mm=20.0,
        y_mm=30.0,
        vx_mm_s=60.0,
        vy_mm_s=0.0,
        normal_force_n=0.4,
        in_contact=True,
        source="simulated",
        age_ms=20.0,
        stale=False,
        extrapolated=False,
    )


@pytest.fixture(scope="session")
def router() -> Iterator[str]:
    endpoint = free_endpoint()
    with open_router(endpoint):
        yield endpoint


@pytest.fixture
def rig(router: str) -> Iterator[FakeRig]:
    with open_session(router) as session:
        fake = FakeRig(session)
        yield fake
        fake.close()


@pytest.fixture
def config(router: str, tmp_path: Path) -> Path:
    """A configuration file that leads to the router."""
    file = tmp_path / "frictus.toml"
    file.write_text(f'rig = "fake"\n[router]\nendpoint = "{router}"\n', encoding="utf-8")
    return file
