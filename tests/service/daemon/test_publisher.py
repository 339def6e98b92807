"""What a status says is of one moment, whatever happens while it is made."""

import pytest
from tests.service.daemon.conftest import build_bench
from tests.service.daemon.desk import Desk

from frictus.keys import RigKeys
from frictus.session import open_router, open_session
from frictus_service.daemon.interlock import Interlock
from frictus_service.daemon.publisher import Publisher
from frictus_service.daemon.safety import Disarm, Safety
from frictus_service.ports import free_endpoint


def test_no_status_says_armed_and_names_what_is_played_after_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    desk, bench, endpoint = Desk(), build_bench(), free_endpoint()
    reads_left = 0

    def state(interlock: Interlock) -> Safety:
        nonlocal reads_left
        if reads_left == 0:
            interlock.feed(Disarm("ann"), desk.now_s)
        reads_left -= 1
        return interlock._state

    with open_router(endpoint), open_session(endpoint) as session:
        publisher = Publisher(
            session,
            RigKeys("lab", "rig"),
            bench.rig.info,
            100,
            bench.loop,
            desk.interlock,
            desk.stage,
            desk.commands,
            lambda: desk.now_s,
            lambda: desk.utc_ns,
        )
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
