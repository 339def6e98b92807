"""When the publisher wakes, and that a status is of one moment, whatever happens meanwhile."""

import queue
import threading
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import pytest
import zenoh
from tests.service.daemon.conftest import Bench, build_bench
from tests.service.daemon.desk import Desk

from frictus.block import Block
from frictus.keys import RigKeys, Topics
from frictus.session import open_router, open_session
from frictus_hardware.simulated.faults import EmptyOutput
from frictus_laboratory.benchmarks.processes import await_subscriber
from frictus_service.daemon.block_loop.timebase import BIN_BLOCKS
from frictus_service.daemon.control import Interlock
from frictus_service.daemon.publisher import UNREAD_BLOCKS, UNREAD_S, Publisher
from frictus_service.daemon.safety import Disarm, FaultCleared, FaultRaised, Safety
from frictus_service.processes import free_endpoint

KEYS = RigKeys("lab", "rig")


@dataclass
class Published:
    """A publisher on a session of its own, of a loop that is turned by hand."""

    session: zenoh.Session
    bench: Bench
    desk: Desk = field(default_factory=Desk)

    def __post_init__(self) -> None:
        self.publisher = Publisher(
            self.session,
            KEYS,
            self.bench.rig.info,
            100,
            10.0,
            self.bench.loop,
            self.desk.interlock,
            self.desk.stage,
            self.desk.models,
            self.desk.commands,
            lambda: self.desk.now_s,
            lambda: self.desk.utc_ns,
        )


class LoopGoesOn(threading.Event):
    """An event whose waits let the loop turn, until it is set after some of them.

    Whoever asks again and again without a wait finds it set too.
    """

    def __init__(self, bench: Bench, n_waits: int) -> None:
        super().__init__()
        self.bench = bench
        self.left = n_waits
        self.asked = 0
        self.waited_s: list[float] = []

    def is_set(self) -> bool:
        self.asked += 1
        return self.asked > 200 or super().is_set()

    def wait(self, timeout: float | None = None) -> bool:
        assert timeout is not None
        self.waited_s.append(timeout)
        if self.left:
            self.left -= 1
            for _ in range(UNREAD_BLOCKS):
                self.bench.loop.turn()
        else:
            self.set()
        return self.is_set()


@pytest.fixture
def published() -> Iterator[Published]:
    endpoint = free_endpoint()
    with open_router(endpoint), open_session(endpoint) as session:
        yield Published(session, build_bench())


@pytest.mark.parametrize("clock_scale", [1.0, 50.0])
def test_where_nobody_reads_the_publisher_wakes_once_for_several_blocks(
    published: Published, monkeypatch: pytest.MonkeyPatch, clock_scale: float
) -> None:
    bench = build_bench()
    monkeypatch.setattr(bench.rig, "_info", replace(bench.rig.info, clock_scale=clock_scale))
    idle = Published(published.session, bench)
    bench.loop.turn()
    stop = LoopGoesOn(bench, 10)
    idle.publisher.run_until(stop)
    taken = 1 + 10 * UNREAD_BLOCKS
    assert bench.loop.tally.blocks == taken
    assert bench.loop.handover.empty()
    assert bench.loop.tally.blocks_dropped == 0
    assert idle.publisher._timebase.newest_sample == 100 * taken
    blocks_s = UNREAD_BLOCKS * 100 / bench.rig.info.clock_hz
    assert 0.0 < max(stop.waited_s) <= min(UNREAD_S, blocks_s)


def test_who_reads_gets_each_block_at_once(published: Published) -> None:
    got: queue.SimpleQueue[zenoh.Sample] = queue.SimpleQueue()
    with published.session.declare_subscriber(KEYS.of(Topics.FORCE), got.put):
        await_subscriber(published.publisher._streams[1])
        stop = LoopGoesOn(published.bench, 0)
        for _ in range(8):
            published.bench.loop.turn()
        stop.set()
        published.publisher.run_until(stop)
        numbers = [
            Block.unpack(got.get(timeout=10.0).payload.to_bytes()).sequence for _ in range(8)
        ]
    assert numbers == list(range(8))
    assert not stop.waited_s


def test_readers_of_a_block_wait_for_nothing_that_is_done_for_the_next(
    published: Published, monkeypatch: pytest.MonkeyPatch
) -> None:
    done: list[str] = []

    class Noted:
        """A publisher that somebody reads, and that notes what is asked of it."""

        def put(self, _payload: bytes) -> None:
            done.append("put")

        @property
        def matching_status(self) -> "Noted":
            done.append("ask")
            return self

        matching = True

    publisher = published.publisher
    noted: Any = Noted()
    monkeypatch.setattr(publisher, "_streams", dict.fromkeys(publisher._streams, noted))
    monkeypatch.setattr(publisher, "_finger", noted)
    monkeypatch.setattr(publisher._timebase, "_close_bin", lambda: done.append("fit"))
    for _ in range(2 * BIN_BLOCKS):
        published.bench.loop.turn()
        done.clear()
        publisher._publish([published.bench.loop.handover.get()])
        puts = done.count("put")
        assert puts == 6  # force, acceleration, voltage, truth, render, finger
        assert done[:puts] == ["put"] * puts
    assert "fit" in done


def test_a_lead_that_grew_is_said_published_and_counted(published: Published) -> None:
    bench, said = build_bench(lead_ms=5.0), list[str]()
    publisher = Publisher(
        published.session,
        KEYS,
        bench.rig.info,
        100,
        10.0,
        bench.loop,
        published.desk.interlock,
        published.desk.stage,
        published.desk.models,
        published.desk.commands,
        lambda: published.desk.now_s,
        lambda: published.desk.utc_ns,
        said.append,
    )
    publisher._publish_states()
    status = publisher.status()
    assert (status.lead_ms, status.max_lead_ms) == (5.0, 20.0)
    assert status.force_limit_n == 10.0
    assert (status.counters.lead_growths, said) == (0, [])
    bench.rig.faults.add(EmptyOutput(at_sample=5_000, samples=100))
    bench.rig.faults.add(EmptyOutput(at_sample=5_100, samples=30))
    for lease_s in (0.5, 10.0):
        bench.arm(lease_s)
        bench.turn(1.0)
    publisher._publish_states()
    publisher._publish_states()
    status = publisher.status()
    assert (status.lead_ms, status.max_lead_ms) == (15.0, 20.0)
    assert (status.counters.lead_growths, status.counters.underruns) == (1, 2)
    (line,) = said
    assert "5 ms, 15 from now on" in line
    assert "at most 20, max_lead_ms" in line


def test_a_fault_that_suspends_is_logged_once_and_told_no_longer_than_it_lasts(
    published: Published,
) -> None:
    desk, publisher = published.desk, published.publisher
    said: list[str] = []
    publisher._say = said.append
    assert desk.call("arm").ok
    desk.interlock.feed(FaultRaised("sensor", "gauge 2 is silent"), desk.now_s)
    for _ in range(3):
        assert publisher.status().fault is not None
    (line,) = said
    assert line.startswith("sensor fault: gauge 2 is silent. Check")
    desk.interlock.feed(FaultCleared("sensor"), desk.now_s)
    status = publisher.status()
    assert (status.state, status.fault) == ("armed", None)


def test_no_status_says_armed_and_names_what_is_played_after_it(
    published: Published, monkeypatch: pytest.MonkeyPatch
) -> None:
    desk, publisher = published.desk, published.publisher
    reads_left = 0

    def state(interlock: Interlock) -> Safety:
        nonlocal reads_left
        if reads_left == 0:
            interlock.feed(Disarm("ann"), desk.now_s)
        reads_left -= 1
        return interlock._state

    monkeypatch.setattr(Interlock, "state", property(state))
    seen = set()
    for reads in range(10):
        reads_left = -1  # none of these ends it
        desk.streaming()
        stream = desk.stage.scene.etag
        reads_left = reads
        status = publisher.status()
        seen.add((status.state, status.scene_etag == stream))
        desk.call("disarm")
    assert ("armed", False) not in seen
    assert {("armed", True), ("stopping", False)} <= seen
