"""What is known of a call: done, refused, not sent, unknown; and by whom it was made."""

import contextlib
import queue
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest
from tests.clients.conftest import APPLIED, WAIT_S, FakeRig

import frictus
from frictus import Client, Topics
from frictus.errors import (
    ArgumentError,
    LeaseLostError,
    LinkError,
    OutcomeUnknownError,
    OutdatedStateError,
)
from frictus.keys import RigKeys
from frictus.messages import LeaseEnd, LeaseRenewal, Reply, SceneState
from frictus.session import open_router
from frictus.textures import Scene


def test_what_breaks_on_the_way_has_an_unknown_outcome(free_endpoint: str) -> None:
    with contextlib.ExitStack() as network:
        session = network.enter_context(open_router(free_endpoint))
        fake = network.enter_context(FakeRig(free_endpoint, RigKeys("lab", "sim")))
        with frictus.connect(free_endpoint) as client:
            fake.silent = True
            rig = client.rig("sim")
            asking = ThreadPoolExecutor(1).submit(rig.stop)
            fake.asked("stop")
            session.close()  # type: ignore[no-untyped-call]
            with pytest.raises(OutcomeUnknownError, match="may have been done"):
                asking.result(WAIT_S)
            with pytest.raises(LinkError, match="stop was not sent") as known:
                rig.stop()
            assert not isinstance(known.value, OutcomeUnknownError)


def test_a_state_that_was_confirmed_and_never_published_is_outdated(
    router: str, fake: Any
) -> None:
    fake.say_everything_once()
    with frictus.connect(router, timeout_s=0.3) as client:
        rig = client.rig("sim")
        assert rig.scene().etag == "s1"
        rig.set_scene(Scene(name="new"))
        for _ in range(2):  # not once only: what was said last stays out of date
            with pytest.raises(OutdatedStateError, match="state/scene of rig sim"):
                rig.scene()
        fake.say(Topics.SCENE, SceneState(etag="e2", scene=Scene(name="new"), applied=APPLIED))
        rig.set_scene(Scene(name="new"))
        assert rig.scene().etag == "e2"


def test_a_rig_whose_clock_was_set_back_is_read_at_once(router: str, fake: Any) -> None:
    fake.say_everything_once()
    now_ns = 3_600 * 10**9
    fake.refusal = Reply(ok=True, utc_ns=now_ns)
    with frictus.connect(router, timeout_s=0.3) as client:
        rig = client.rig("sim")
        fake.say(Topics.STATUS, fake.status(utc_ns=now_ns - 10**9))
        while rig.status().utc_ns != now_ns - 10**9:
            pass
        rig.stop()
        with pytest.raises(OutdatedStateError):
            rig.status()
        with rig.watch(Topics.STATUS, timeout_s=WAIT_S) as states:
            fake.say(Topics.STATUS, fake.status(utc_ns=10**9))  # an hour before it answered
            while next(states).utc_ns != 10**9:  # type: ignore[attr-defined]
                pass
        assert rig.status().utc_ns == 10**9


def test_several_people_speak_through_one_client(client: Client, fake: Any) -> None:
    fake.say_everything_once()
    rig = client.rig("sim")
    ann = rig.on_behalf_of("ann.page-1")
    assert ann.scene().etag == "s1"
    with ann.arm(share_with=["ben"]):
        asked = fake.asked("arm")
        assert (asked.client, asked.share_with) == ("ann.page-1", ("ben",))
        assert ("ann.page-1", True) == fake.tokens.get(timeout=WAIT_S)
        ann.set_scene(Scene(name="new"))
        assert fake.asked("scene").client == "ann.page-1"
        late = SceneState(etag="e2", scene=Scene(name="new"), applied=APPLIED)
        timer = threading.Timer(0.2, fake.say, (Topics.SCENE, late))
        timer.start()
        assert rig.scene().etag == "e2"  # what one has changed the other reads
        timer.join()
    fake.asked("disarm")
    ann.close()
    assert rig.scene().etag == "e2"
    with pytest.raises(ArgumentError, match="share_with"):
        ann.arm(share_with=["not a name"])
    with pytest.raises(ArgumentError, match="share_with"):
        ann.arm(share_with=["ben"] * 17)
    with pytest.raises(ArgumentError, match="share_with 'ben': a list of names"):
        ann.arm(share_with="ben")


@pytest.mark.parametrize("ending", ["stopped", "replaced"])
def test_a_stream_without_a_lease_of_its_own_ends_with_what_it_was_opened_under(
    client: Client, fake: Any, ending: str
) -> None:
    fake.refusal = Reply(ok=True, ticket=7, etag="stream-7", applied=APPLIED, utc_ns=10)
    rig = client.rig("sim")

    def say(utc_ns: int, **fields: Any) -> None:
        fake.say(Topics.STATUS, fake.status(utc_ns=utc_ns, **fields))
        while rig.status().utc_ns != utc_ns:
            pass

    say(9)
    with rig.open_stream(0.3) as stream:
        stream.send([0.1, -0.1], period_mm=2.0)  # that status is of before it was opened
        say(10, state="armed", owner="ann", scene_etag="stream-7")
        stream.send([0.1, -0.1], period_mm=2.0)
        if ending == "stopped":
            say(11, last_end=LeaseEnd(owner="ann", by="ben", reason="stopped", utc_ns=10**18))
        else:
            say(11, state="armed", owner="ann", scene_etag="s2")
        words = "stopped by 'ben'" if ending == "stopped" else "'ann' holds .* 's2'"
        for _ in range(2):
            with pytest.raises(LeaseLostError, match=words):
                stream.send([0.1, -0.1], period_mm=2.0)


def test_what_ends_the_output_reaches_whoever_has_the_name_of_the_rig(
    client: Client, fake: Any
) -> None:
    rig = client.rig("sim")
    with type(fake)(fake.router, fake.keys) as namesake:
        rig.stop()
        lease = rig.arm()
        lease.disarm()
        calls: list[str] = []
        until_s = time.monotonic() + WAIT_S
        while len(calls) < 5 and time.monotonic() < until_s:
            for each in (fake, namesake):
                with contextlib.suppress(queue.Empty):
                    calls.append(each.calls.get(timeout=0.01)[0])
        # No second screen is armed without anybody's knowing.
        assert sorted(calls) == ["arm", "disarm", "disarm", "stop", "stop"]


def test_a_namesake_that_does_not_answer_holds_no_stop_up(router: str, fake: Any) -> None:
    with (
        frictus.connect(router, timeout_s=60.0) as client,
        type(fake)(fake.router, fake.keys) as namesake,
    ):
        namesake.silent = True
        stopping = ThreadPoolExecutor(1).submit(client.rig("sim").stop)
        namesake.asked("stop")
        assert stopping.result(WAIT_S) == "armed"  # as this rig answers whatever it is asked
        fake.asked("stop")


def test_the_lease_is_renewed_no_more_though_nobody_answers_the_disarming(
    router: str, fake: Any
) -> None:
    with frictus.connect(router, timeout_s=0.5) as client:
        lease = client.rig("sim").arm(lease_ms=100)
        fake.asked("arm")
        fake.next_put(Topics.LEASE)
        fake.silent = True
        with pytest.raises(OutcomeUnknownError):
            lease.disarm()
        asked_ns = fake.asked("disarm").utc_ns
        while not fake.puts.empty():
            assert LeaseRenewal.from_json(fake.next_put(Topics.LEASE)).utc_ns <= asked_ns
        assert not lease.lost


def test_an_answer_that_cannot_be_read_ends_no_client(router: str, fake: Any) -> None:
    client = frictus.connect(router)
    rig = client.rig("sim")
    lease = rig.arm()
    fake.garbled = True
    with pytest.raises(OutcomeUnknownError, match="stop was answered with what cannot be read"):
        rig.stop()
    with type(fake)(router, fake.keys):
        assert rig.stop() == "armed"  # another's that can be read is taken
    session = client.session
    client.close()
    assert lease.finished
    assert session.is_closed()


def test_ctrl_c_while_a_client_closes_does_not_keep_it_connected(
    client: Client, fake: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted() -> None:
        raise KeyboardInterrupt

    session = client.session
    monkeypatch.setattr(client.rig("sim"), "close", interrupted)
    with pytest.raises(KeyboardInterrupt):
        client.close()
    assert session.is_closed()


def test_a_lease_on_a_rig_of_which_nothing_is_heard_is_lost(
    client: Client, fake: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("frictus.lease.SILENT_S", 0.2)
    fake.say(Topics.STATUS, fake.status(state="armed", owner="tester"))
    with client.rig("sim").arm(lease_ms=100) as lease:  # its presence goes on to be seen
        assert lease.wait_lost(WAIT_S)
        assert "nothing has come from the rig" in lease.reason


def test_a_lease_whose_holder_cannot_be_asked_for_is_lost(client: Client, fake: Any) -> None:
    def there() -> bool:
        raise ZeroDivisionError

    with client.rig("sim").arm(still_there=there) as lease:
        assert lease.wait_lost(WAIT_S)
        assert "still_there has failed: ZeroDivisionError" in lease.reason


def test_a_status_that_cannot_be_read_ends_no_stream(client: Client, fake: Any) -> None:
    rig = client.rig("sim")
    rig.status()
    with rig.open_stream(0.3) as stream, rig.watch(Topics.STATUS) as states:
        fake.say(Topics.STATUS, b"{")
        while not states.unreadable:
            states.drain()
            stream.send([0.1, -0.1], period_mm=2.0)
        stream.send([0.1, -0.1], period_mm=2.0)


def test_whoever_waits_on_a_client_that_is_closed_learns_it(client: Client, fake: Any) -> None:
    rig = client.rig("sim")
    with ThreadPoolExecutor(1) as pool:
        waiting = pool.submit(rig.scene)
        while not rig._readings._latest:
            pass
        client.close()
        with pytest.raises(LinkError, match="closed"):
            waiting.result(WAIT_S)
    for work in (rig.status, rig.arm, rig.fingers, lambda: rig.point(1.0, 2.0), rig.stop):
        with pytest.raises(LinkError):
            work()
