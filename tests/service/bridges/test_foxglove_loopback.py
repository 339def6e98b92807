"""From a running rig to a viewer over Foxglove's WebSocket, each in a process of its own."""

import json
import subprocess
import sys
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from tests.service.bridges.foxglove_viewer import Came, viewing

import frictus
from frictus_service.config import Config

SAMPLES = 20_000
"""1 s; the bridge keeps six times as much of two streams for a viewer that is set aside."""
BRIDGE = """
import sys
import time

import frictus
from frictus_service.bridges.foxglove import FoxgloveBridge

with frictus.connect(sys.argv[1], patient=True) as client:
    with FoxgloveBridge(client, client.rig(sys.argv[2], wait_s=60.0)) as bridge:
        print(bridge.port, flush=True)
        while True:
            bridge.turn()
            time.sleep(0.01)
"""


@pytest.fixture
def port(config: Config) -> Iterator[int]:
    command = [sys.executable, "-c", BRIDGE, config.router.endpoint, config.rig]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        yield int(process.stdout.readline())
        process.kill()


def test_nothing_is_lost_and_stamps_rise(config: Config, port: int) -> None:
    with frictus.connect(config.router.endpoint, patient=True) as client:
        rig = client.rig(config.rig, wait_s=60.0)
        with (
            rig.blocks("force", capacity=8_192) as force,
            rig.blocks("accel", capacity=8_192) as accel,
            viewing(port) as viewer,
        ):
            feeds = {"stream/force": force, "stream/accel": accel}
            blocks: dict[str, list[Any]] = {topic: [next(feeds[topic])] for topic in feeds}
            viewer.await_channels(*feeds, "state/status", "state/finger")
            viewer.subscribe(*feeds, "state/status", "state/finger")
            while min(len(viewer.came[topic]) for topic in feeds) < SAMPLES:
                viewer.receive()
            for topic, feed in feeds.items():
                blocks[topic] += feed.drain()
                newest_ns = viewer.came[topic][-1].log_ns
                while blocks[topic][-1].utc_ns < newest_ns + 50_000_000:
                    blocks[topic].append(next(feed))
    for topic, came in viewer.came.items():
        assert np.all(np.diff([one.log_ns for one in came]) > 0) or topic == "state/status"
    for topic in feeds:
        _hold(viewer.came[topic], blocks[topic])
    status = json.loads(viewer.came["state/status"][0].data)
    assert status["rig"] == config.rig


def _hold(came: list[Came], items: list[Any]) -> None:
    """Hold what a viewer got against the blocks themselves."""
    blocks = [item for item in items if isinstance(item, frictus.Block)]
    assert len(blocks) == len(items), "this reader lost none, so that it may judge"
    sent = np.concatenate([block.data.T for block in blocks])
    # The bridge may be behind this reader, whose first block is not the viewer's.
    came = [one for one in came if one.log_ns > blocks[0].utc_ns + 10_000_000]
    assert len(came) > SAMPLES // 2
    rows: NDArray[np.float32] = np.array([np.frombuffer(one.data, "<f4") for one in came])
    starts = np.flatnonzero((sent[: -len(rows) or None] == rows[0]).all(axis=1))
    (start,) = [at for at in starts if np.array_equal(sent[at : at + len(rows)], rows)]
    edge = 0
    for block in blocks:
        if 0 <= edge - start < len(rows):
            assert abs(came[edge - start].log_ns - block.utc_ns) < 1_000_000
        edge += block.data.shape[1]
