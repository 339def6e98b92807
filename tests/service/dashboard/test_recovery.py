"""Who comes and goes: the router, the rig, a new run of it. Pages are told, and go on."""

import itertools
import queue
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
import zenoh
from tests.rig_status import rig_status
from tests.service.dashboard.conftest import Serve
from tests.service.dashboard.page import Page, page_at

from frictus.block import Block, Flag
from frictus.keys import RigKeys, Topics
from frictus.messages import RigStatus
from frictus.session import (
    declare_latest_publisher,
    declare_publisher,
    open_router,
    open_session,
)
from frictus_service.processes import free_endpoint

KEYS = RigKeys("lab", "rig1")
Publish = Callable[[], None]


def status(run: int) -> RigStatus:
    return rig_status(run=run, utc_ns=run, sample_rate_hz=1_000.0, block_samples=10)


@contextmanager
def rig(session: zenoh.Session, run: int) -> Iterator[Publish]:
    """A rig that is present, and publishes a block whenever it is told to."""
    statuses = declare_latest_publisher(session, KEYS.of(Topics.STATUS), Topics.STATUS)
    force = declare_publisher(session, KEYS.of(Topics.FORCE), Topics.FORCE)
    token = session.liveliness().declare_token(KEYS.alive)
    statuses.put(status(run).to_json())
    numbers = itertools.count()

    def publish() -> None:
        number = next(numbers)
        data = np.full((3, 10), run, dtype=np.float32)
        block = Block(1, run, number, 10 * number, 0, 0, 1_000.0, Flag.SIMULATED, data)
        force.put(block.pack())

    try:
        yield publish
    finally:
        for declared in (token, statuses, force):
            declared.undeclare()  # type: ignore[no-untyped-call]


def shows(page: Page, run: int, publish: Publish) -> None:
    """Wait until a page sees the samples of a run."""
    page.wait("status", lambda told: told["status"]["run"] == run)
    while True:
        publish()
        page.say("ping", id=1)  # whether or not there is a frame, there is an answer
        page.wait("pong")
        if page.frames and page.frames[-1].run == run:
            assert (page.frames[-1].data == run).all()
            return


def test_a_router_that_comes_late_and_rigs_that_come_and_go(serve: Serve) -> None:
    endpoint = free_endpoint()
    with serve(endpoint) as port, page_at(port) as page:
        assert page.wait("rigs") == {"op": "rigs", "rigs": [], "link": False}
        page.say("watch", rig="rig1", streams=["force"], raw=True)
        page.wait("lost", lambda told: told["rig"] == "rig1")
        with open_router(endpoint):
            page.wait("rigs", lambda told: told["link"])
            with open_session(endpoint) as session:
                for run in (1, 2):
                    with rig(session, run) as publish:
                        page.wait("rigs", lambda told: told["rigs"] == ["rig1"])
                        shows(page, run, publish)
                    page.wait("lost", lambda told: told["rig"] == "rig1")


def test_a_router_that_goes_and_comes_back(serve: Serve) -> None:
    endpoint = free_endpoint()
    with serve(endpoint) as port, page_at(port) as page:
        page.say("watch", rig="rig1", streams=["force"], raw=True)
        for run in (1, 2):
            with (
                open_router(endpoint),
                open_session(endpoint) as session,
                rig(session, run) as publish,
            ):
                shows(page, run, publish)
            page.wait("rigs", lambda told: not told["link"])


def test_subscriptions_end_with_their_last_page(serve: Serve) -> None:
    endpoint = free_endpoint()
    with open_router(endpoint), open_session(endpoint) as session, serve(endpoint) as port:
        force = declare_publisher(session, KEYS.of(Topics.FORCE), Topics.FORCE)

        changes: queue.Queue[bool] = queue.Queue()
        listener = force.declare_matching_listener(lambda status: changes.put(status.matching))

        def subscribed(wanted: bool) -> None:
            while changes.get(timeout=20.0) != wanted:
                pass

        with rig(session, 1), page_at(port) as page, page_at(port) as other:
            page.say("watch", rig="rig1", streams=["force"])
            other.say("watch", rig="rig1", streams=["force"])
            subscribed(True)
        subscribed(False)
        listener.undeclare()  # type: ignore[no-untyped-call]
        force.undeclare()  # type: ignore[no-untyped-call]


def test_what_was_not_answered_is_asked_again(serve: Serve) -> None:
    endpoint = free_endpoint()
    key = KEYS.of(Topics.STATUS)
    with open_router(endpoint), open_session(endpoint) as session, serve(endpoint) as port:
        token = session.liveliness().declare_token(KEYS.alive)
        with page_at(port) as page:
            page.say("watch", rig="rig1")
            page.wait("rigs", lambda told: told["rigs"] == ["rig1"])
            asked: queue.Queue[str] = queue.Queue()
            # In the place of a publisher's cache, but with an empty answer.
            late = session.declare_queryable(
                f"{key}/@adv/**", lambda query: asked.put(str(query.key_expr)), complete=False
            )
            for _ in range(3):
                asked.get(timeout=20.0)
            late.undeclare()  # type: ignore[no-untyped-call]
        token.undeclare()  # type: ignore[no-untyped-call]
