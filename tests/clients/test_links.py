"""Links last: of a reader that is set aside for seconds, and between routers."""

import itertools
import os
import signal
import subprocess
import sys
import threading
import time
from functools import partial

import numpy as np
import pytest
import zenoh

from frictus.block import Block, Flag
from frictus.errors import LinkError
from frictus.keys import STREAMS, RigKeys, Topic, Topics
from frictus.session import declare_publisher, open_router, open_session
from frictus_laboratory.benchmarks.processes import await_subscriber
from frictus_service.processes import free_endpoint

BLOCK_S = 0.005
LAST = 700
SAMPLES = np.zeros((3, 100), np.float32)
READER = f"""
import sys
import frictus
from frictus.keys import RigKeys, Topics
from frictus.session import declare_reader

key = RigKeys("lab", "rig1").of(Topics.FORCE)
with frictus.connect(sys.argv[1], patient=True) as client:
    declare = lambda put: declare_reader(client.session, key, Topics.FORCE, put)
    with frictus.BlockFeed(declare, Topics.FORCE, 4_000, timeout_s=20.0) as feed:
        for item in feed:
            if isinstance(item, frictus.Block) and item.sequence >= {LAST}:
                break
        print(feed.lost)
"""


def test_a_port_in_use_is_refused_with_what_to_do() -> None:
    endpoint = free_endpoint()
    with open_router(endpoint), pytest.raises(LinkError) as caught, open_router(endpoint):
        pass
    assert "`endpoint` in [router]" in str(caught.value)
    assert ".rs" not in str(caught.value)


@pytest.mark.skipif(sys.platform == "win32", reason="there is no SIGSTOP")
def test_a_reader_set_aside_for_two_seconds_loses_nothing() -> None:
    endpoint = free_endpoint()
    with (
        open_router(endpoint),
        open_session(endpoint) as session,
        subprocess.Popen(
            [sys.executable, "-c", READER, endpoint], stdout=subprocess.PIPE, text=True
        ) as reader,
    ):
        publisher = declare_publisher(
            session, RigKeys("lab", "rig1").of(Topics.FORCE), Topics.FORCE
        )
        await_subscriber(publisher)
        numbers = itertools.count()

        def publish(blocks: int) -> None:
            for n in itertools.islice(numbers, blocks):
                block = Block(1, 1, n, 100 * n, 0, 0, 20_000.0, Flag(0), SAMPLES)
                publisher.put(block.pack())
                threading.Event().wait(BLOCK_S)

        publish(100)
        os.kill(reader.pid, signal.SIGSTOP)
        publish(400)
        os.kill(reader.pid, signal.SIGCONT)
        publish(LAST + 1 - 500)
        told, _ = reader.communicate(timeout=30.0)
        assert told == "0\n"


ROUTER = """
import sys
from frictus.session import open_router

with open_router(sys.argv[1]) as session:
    subscriber = session.declare_subscriber("frictus/@v1/**", lambda sample: None)
    print("ready", flush=True)
    sys.stdin.read()
"""
STALL_S = 2.5
"""Longer than the lease of a link, after which nothing is sent at all."""


def _slowest_put_s(*topics: Topic) -> float:
    """Return how long a put takes at most while the router stands still."""
    endpoint, keys = free_endpoint(), RigKeys("lab", "rig1")
    payload = bytes(20_000)
    with subprocess.Popen(
        [sys.executable, "-c", ROUTER, endpoint],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as router:
        assert router.stdout is not None
        assert router.stdout.readline() == "ready\n"
        with open_session(endpoint) as session:
            publishers = [declare_publisher(session, keys.of(topic), topic) for topic in topics]
            for publisher in publishers:
                await_subscriber(publisher)
            os.kill(router.pid, signal.SIGSTOP)
            began_s = put_s = time.monotonic()
            slowest_s = 0.0
            for publisher in itertools.cycle(publishers):
                publisher.put(payload)
                before_s, put_s = put_s, time.monotonic()
                slowest_s = max(slowest_s, put_s - before_s)
                if put_s > began_s + STALL_S:
                    break
            os.kill(router.pid, signal.SIGCONT)
        router.communicate(timeout=30.0)
    return slowest_s


@pytest.mark.long
@pytest.mark.skipif(sys.platform == "win32", reason="there is no SIGSTOP")
def test_what_a_rig_publishes_never_waits_for_a_router_that_stands_still() -> None:
    published_s = _slowest_put_s(*STREAMS.values(), Topics.FINGER, Topics.STATUS)
    waiting_s = _slowest_put_s(Topics.TEXTURE)  # which a client sends, who may wait
    assert published_s < 0.5 * waiting_s


def _note(came: threading.Event, _sample: zenoh.Sample) -> None:
    came.set()


def test_linked_routers_are_one_network_in_any_order_and_again() -> None:
    endpoint, other = free_endpoint(), free_endpoint()
    key = RigKeys("lab", "rig1").of(Topics.FORCE)
    with (
        open_router(endpoint, links=[other]),
        open_session(endpoint) as session,
    ):
        publisher = declare_publisher(session, key, Topics.FORCE)
        for _ in range(2):  # the router that is linked to comes second, and goes
            with open_router(other), open_session(other) as far:
                came = threading.Event()
                subscriber = far.declare_subscriber(key, partial(_note, came))
                for _ in range(600):
                    publisher.put(b"over the link")
                    if came.wait(0.05):
                        break
                assert came.is_set()
                subscriber.undeclare()  # type: ignore[no-untyped-call]


STARVED = """
import resource, sys
from frictus.errors import LinkError
from frictus.session import open_router

with open("/proc/self/statm") as sizes:
    most = int(sizes.read().split()[0]) * resource.getpagesize() + 1_000_000
resource.setrlimit(resource.RLIMIT_AS, (most, most))
try:
    open_router("tcp/127.0.0.1:0")
except LinkError as error:
    sys.exit(f"told: {error}")
"""


@pytest.mark.skipif(sys.platform != "linux", reason="limits of addresses are POSIX's")
def test_a_process_without_memory_for_threads_is_told_so() -> None:
    done = subprocess.run(
        [sys.executable, "-c", STARVED], capture_output=True, text=True, check=False
    )
    assert "told: Zenoh cannot start here" in done.stderr
    assert "ulimit" in done.stderr


LOOKS_AT_MANY = """
import sys
import threading
from zenoh.handlers import Callback
from frictus.calls import present_rigs
from frictus.keys import RigKeys, any_rig_alive
from frictus.session import open_router, open_session
seen, all_seen = set(), threading.Event()

def see(sample):
    seen.add(str(sample.key_expr))  # one is told twice now and then
    if len(seen) == 600:
        all_seen.set()

endpoint = sys.argv[1]
with open_router(endpoint), open_session(endpoint) as rigs, open_session(endpoint) as looking:
    told = Callback(see, indirect=False)
    follows = looking.liveliness().declare_subscriber(any_rig_alive("*"), told, history=True)
    tokens = [
        rigs.liveliness().declare_token(RigKeys("lab", f"r{number}").alive)
        for number in range(600)
    ]
    assert all_seen.wait(100.0)
    print(len(present_rigs(looking, wait_s=60.0)))
"""


def test_who_knows_hundreds_of_rigs_can_look_for_them() -> None:
    # In a process of its own: a session that stands still could not be closed either.
    looked = subprocess.run(
        [sys.executable, "-c", LOOKS_AT_MANY, free_endpoint()],
        capture_output=True,
        text=True,
        timeout=200.0,
    )
    assert looked.stdout == "600\n", looked.stderr
