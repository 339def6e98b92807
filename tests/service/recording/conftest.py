"""A finished recording of known samples, and what a reading of one must satisfy."""

import queue
import runpy
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from tests.service.recording.recorder_service import SECRET, Service

import frictus
from frictus_hardware import SimulatedConfig
from frictus_hardware.simulated.strokes import SteadyStrokes
from frictus_service.config import ApiConfig, Config, Limits, RegistryConfig, RouterConfig
from frictus_service.daemon.processes.supervisor import Supervisor
from frictus_service.processes import free_endpoint
from frictus_service.recording.reader import Ending, RecordingReader, State
from frictus_service.recording.samples import Samples
from frictus_service.recording.writer import RecordingWriter

SCRIPT = Path(__file__).with_name("known.py")
KNOWN = SimpleNamespace(**runpy.run_path(str(SCRIPT), run_name="known"))


@dataclass(frozen=True)
class Read:
    """What a clean reading gave."""

    samples: dict[int, int]
    """By stream, how many from index 0 on."""
    touches: int
    ending: Ending


def read_clean(path: Path) -> Read:
    """Read a recording of known samples; every value must be right, nothing may be skipped."""
    counts = {KNOWN.FORCE: 0, KNOWN.TRUTH: 0}
    touches = 0
    with RecordingReader(path) as reader:
        for item in reader.items():
            if isinstance(item, Samples):
                assert item.run == KNOWN.RUN
                assert item.first_sample == counts[item.stream]
                n = item.data.shape[1]
                expected = KNOWN.known(item.stream, item.first_sample, n)
                assert np.array_equal(item.data, expected)
                counts[item.stream] += n
            elif isinstance(item, State):
                assert item.message == KNOWN.touch(touches)
                touches += 1
        return Read(counts, touches, reader.ending)


@dataclass(frozen=True)
class Whole:
    """A finished recording.

    Attributes
    ----------
    path : Path
    blocks : int
    flushed : list of (bytes, samples)
        What was in the file whenever a chunk was closed.
    """

    path: Path
    blocks: int
    flushed: list[tuple[int, int]]

    @property
    def content(self) -> bytes:
        return self.path.read_bytes()


MakeWhole = Callable[[int], Whole]


@pytest.fixture
def make_whole(tmp_path: Path) -> MakeWhole:
    """Make a finished recording of so many blocks; its clock is what the samples say."""

    def make(blocks: int) -> Whole:
        path = tmp_path / f"whole-{blocks}.mcap"
        now_s = 0.0
        flushed: list[tuple[int, int]] = []
        with RecordingWriter(path, KNOWN.info("whole"), {}, lambda: now_s) as writer:
            for sequence in range(blocks):
                KNOWN.hand_over(writer, sequence)
                now_s = sequence * 5e-3
                before = path.stat().st_size
                writer.tick()
                size = path.stat().st_size
                if size > before:
                    flushed.append((size, writer.totals["truth"].samples))
            writer.end("asked for", KNOWN.UTC_NS)
        return Whole(path, blocks, flushed)

    return make


ReadClean = Callable[[Path], Read]


@pytest.fixture
def read() -> ReadClean:
    """Read a recording of known samples and hold every value to what was written."""
    return read_clean


@pytest.fixture
def known() -> Any:
    """The module of known samples."""
    return KNOWN


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    folder = tmp_path_factory.mktemp("service")
    token: Any = {"name": "one", "scopes": ("read",), "value": SECRET}
    config = Config(
        backend=SimulatedConfig(finger=SteadyStrokes()),
        router=RouterConfig(endpoint=free_endpoint()),
        api=ApiConfig(port=0, tokens=(token,)),
        registry=RegistryConfig(url=f"sqlite:///{folder}/frictus.db"),
        recordings=folder / "recordings",
        limits=Limits(freeze_ms=1_000, missed_deadlines=1_000),
    )
    said: queue.Queue[str] = queue.Queue()
    with Supervisor(config, ("rig", "recorder"), say=said.put) as supervisor:
        supervisor.wait_ready(100.0)
        yield Service(config, supervisor, said)


@pytest.fixture
def client(service: Service) -> Iterator[frictus.Client]:
    with frictus.connect(service.config.router.endpoint, timeout_s=10.0) as client:
        yield client


@pytest.fixture
def rig(client: frictus.Client) -> frictus.Rig:
    return client.rig("rig1", wait_s=60.0)
