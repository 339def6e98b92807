"""LSL on this machine alone, and a rig that publishes what a test hands it."""

import secrets
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from tests.rig_status import rig_status

import frictus
from frictus.block import Block, Flag
from frictus.keys import STREAMS, RigKeys, Topic, Topics
from frictus.messages import Message, RigStatus, TimeState
from frictus.session import declare_latest_publisher, open_router, open_session
from frictus_hardware import SimulatedConfig
from frictus_hardware.simulated.strokes import SteadyStrokes
from frictus_service.config import ApiConfig, Config, Limits, RouterConfig
from frictus_service.daemon.processes.supervisor import Supervisor
from frictus_service.processes import free_endpoint

RATE_HZ = 20_000.0
BLOCK = 100
LSL = f"""
[lab]
SessionID = frictus-{secrets.token_hex(8)}
KnownPeers = {{127.0.0.1}}
[ports]
IPv6 = disable
[multicast]
ResolveScope = machine
[log]
level = -3
"""


@pytest.fixture(scope="session")
def lsl(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Keep LSL to this machine and this session; return the file that says so to children."""
    import pylsl

    pylsl.set_config_content(LSL)
    file = tmp_path_factory.mktemp("lsl") / "lsl_api.cfg"
    file.write_text(LSL, encoding="utf-8")
    return file


@pytest.fixture(scope="module")
def config() -> Iterator[Config]:
    """Of a service whose rig is simulated, as it runs."""
    config = Config(
        backend=SimulatedConfig(finger=SteadyStrokes()),
        router=RouterConfig(endpoint=free_endpoint()),
        api=ApiConfig(port=0),
        limits=Limits(missed_deadlines=1_000),  # for busy machines
    )
    with Supervisor(config, ("rig",), say=lambda _line: None) as supervisor:
        supervisor.wait_ready(100.0)
        yield config


class HandRig:
    """A rig whose every message a test chooses; its clock goes with UTC from `began_ns` on."""

    def __init__(self, endpoint: str) -> None:
        self.session = open_session(endpoint)
        self.keys = RigKeys("lab", "hand")
        self.began_ns = time.time_ns()
        self._latest: dict[str, Any] = {}
        self.say(Topics.STATUS, self.status())
        self.say(Topics.TIME, self.fit(1, 0))
        self._token = self.session.liveliness().declare_token(self.keys.alive)

    def status(self, **changes: Any) -> RigStatus:
        said = rig_status(rig="hand")
        return said.model_copy(update=changes)

    def utc_ns(self, sample: int) -> int:
        return self.began_ns + round(1e9 * sample / RATE_HZ)

    def fit(self, run: int, sample: int, error_ns: int = 0) -> TimeState:
        return TimeState(
            run=run,
            sample=sample,
            utc_ns=self.utc_ns(sample) + error_ns,
            ns_per_sample=1e9 / RATE_HZ,
            uncertainty_ns=300_000,
            skew_ppm=0.0,
            utc_steps=0,
        )

    def say(self, topic: Topic, message: Message) -> None:
        if not topic.latest:
            self.session.put(self.keys.of(topic), message.to_json())
            return
        if topic.suffix not in self._latest:
            publisher = declare_latest_publisher(self.session, self.keys.of(topic), topic)
            self._latest[topic.suffix] = publisher
        self._latest[topic.suffix].put(message.to_json())

    def force(self, run: int, sequence: int, **changes: Any) -> NDArray[np.float32]:
        """Publish a block that counts its samples, of force unless changed; return it."""
        first = sequence * BLOCK
        data = np.tile(np.arange(first, first + BLOCK, dtype=np.float32), (3, 1))
        fields: dict[str, Any] = {
            "stream": 1,
            "run": run,
            "sequence": sequence,
            "first_sample": first,
            "utc_ns": self.utc_ns(first),
            "uncertainty_ns": 300_000,
            "sample_rate_hz": RATE_HZ,
            "flags": Flag(0),
            "data": data,
        }
        block = Block(**(fields | changes))
        self.session.put(self.keys.of(STREAMS[block.stream]), block.pack())
        return block.data

    def close(self) -> None:
        self._token.undeclare()  # type: ignore[no-untyped-call]
        for publisher in self._latest.values():
            publisher.undeclare()
        self.session.close()  # type: ignore[no-untyped-call]


@pytest.fixture(scope="module")
def endpoint() -> Iterator[str]:
    endpoint = free_endpoint()
    with open_router(endpoint):
        yield endpoint


@pytest.fixture
def hand(endpoint: str) -> Iterator[HandRig]:
    rig = HandRig(endpoint)
    yield rig
    rig.close()


@pytest.fixture
def client(endpoint: str) -> Iterator[frictus.Client]:
    with frictus.connect(endpoint, patient=True) as client:
        yield client


Inlet = Callable[[str], Any]


@pytest.fixture
def inlet(lsl: Path) -> Inlet:
    """Open the LSL stream of a name."""
    import pylsl

    def opened(name: str) -> Any:
        found = pylsl.resolve_byprop("name", name, 1, 20.0)
        assert found, f"no stream {name}"
        one = pylsl.StreamInlet(found[0], recover=False, as_numpy=True)
        one.open_stream(20.0)
        return one

    return opened


Pull = Callable[[Any, int], tuple[NDArray[Any], NDArray[Any]]]


@pytest.fixture
def pull() -> Pull:
    """Return so many samples of an inlet, and their stamps."""

    def pulled(inlet: Any, n: int) -> tuple[NDArray[Any], NDArray[Any]]:
        rows: list[Any] = []
        stamps: list[float] = []
        deadline_s = time.monotonic() + 20.0
        while len(stamps) < n and time.monotonic() < deadline_s:
            most = n - len(stamps)
            part, times = inlet.pull_chunk(timeout=1.0, max_samples=most, min_samples=1)
            rows += [part] if len(times) else []
            stamps += list(times)
        assert len(stamps) == n, f"{len(stamps)} of {n} samples came"
        return np.concatenate(rows), np.array(stamps)

    return pulled
