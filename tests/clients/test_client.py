"""The client against a fake rig on real Zenoh."""

import contextlib
import signal
import subprocess
import sys
import threading
import time
from typing import Any

import numpy as np
import pytest
from tests.clients.conftest import FakeRig

import frictus
from frictus import Client, Topics
from frictus.block import Block
from frictus.errors import (
    ArgumentError,
    LeaseLostError,
    LinkError,
    NoRigError,
    OutcomeUnknownError,
    RefusedError,
    SilenceError,
)
from frictus.keys import InvalidNameError, RigKeys
from frictus.messages import (
    Applied,
    LeaseEnd,
    LeaseRenewal,
    Reply,
    RigStatus,
    SceneState,
)
from frictus.model import FirstOrderSpeedLaw, Model
from frictus.session import open_router
from frictus.stream import StreamFrame
from frictus.textures import Component, Scene, Spectrum

WAIT_S = 10.0
APPLIED = Applied(
    gain=1.0,
    feasible_gain=2.0,
    bias=0.2,
    bias_n=0.08,
    scaled=False,
    speed_range_mm_s=(20.0, 100.0),
)


def test_rigs_are_found_by_liveliness(client: Client, fake: Any) -> None:
    with type(fake)(fake.router, RigKeys("attic", "other")):
        deadline = time.monotonic() + WAIT_S
        while len(client.rigs()) < 2:  # a router's answer may lag a new token by milliseconds
            assert time.monotonic() < deadline
        assert client.rigs() == [("attic", "other"), ("lab", "sim")]
        assert client.rigs("lab") == [("lab", "sim")]
    assert client.rigs("nowhere") == []


def test_presence_tells_who_appears_and_who_vanishes(client: Client, fake: Any) -> None:
    with client.presence(timeout_s=WAIT_S) as presence:
        assert next(presence) == (("lab", "sim"), True)
        with type(fake)(fake.router, RigKeys("attic", "other")):
            assert next(presence) == (("attic", "other"), True)
        assert next(presence) == (("attic", "other"), False)


def test_an_absent_rig_is_refused_with_those_that_are_there(client: Client, fake: Any) -> None:
    client.rig("sim")
    with pytest.raises(NoRigError, match=r"'simm'.*present: sim at lab"):
        client.rig("simm", wait_s=0.5)


def test_no_router_is_a_link_error() -> None:
    with pytest.raises(LinkError, match="frictus serve"):
        frictus.connect("tcp/127.0.0.1:9", timeout_s=0.2)


@pytest.mark.parametrize("router", ["lab", "192.168.1.10:7447", "tcp/lab", "http/lab:80", ""])
def test_what_is_no_endpoint_is_told_with_what_is_accepted(router: str) -> None:
    with pytest.raises(ArgumentError, match=r"tcp/HOST:PORT.*tcp/127\.0\.0\.1:7447"):
        frictus.connect(router)


def test_a_bad_client_name_is_refused_before_connecting() -> None:
    with pytest.raises(frictus.InvalidNameError, match="client name"):
        frictus.connect("tcp/127.0.0.1:9", "a/b")


def test_late_joiners_get_the_latest_values(client: Client, fake: Any) -> None:
    fake.say_everything_once()
    rig = client.rig("sim")
    assert rig.present
    assert rig.status().rig == "sim"
    assert rig.scene().etag == "s1"
    assert rig.model().etag == "m1"
    assert rig.time().utc_of(300) == 10**18 + 200 * 50_000


def test_the_newest_status_replaces_the_older(client: Client, fake: Any) -> None:
    rig = client.rig("sim")
    with rig.watch(Topics.STATUS, timeout_s=WAIT_S) as feed:
        first = next(feed)
        assert isinstance(first, RigStatus)
        assert first.state == "disarmed"
        rig.status()
        fake.say(Topics.STATUS, fake.status(state="armed", owner="someone"))
        second = next(feed)
        assert isinstance(second, RigStatus)
        assert second.owner == "someone"
        deadline = time.monotonic() + WAIT_S
        while rig.status().owner != "someone":  # another subscriber; its copy may come later
            assert time.monotonic() < deadline


def test_a_silent_topic_says_so(router: str, fake: Any) -> None:
    with frictus.connect(router, timeout_s=0.2) as client:
        with pytest.raises(LinkError, match="state/scene"):
            client.rig("sim").scene()


def test_blocks_are_not_watched_as_json(client: Client, fake: Any) -> None:
    with pytest.raises(ArgumentError, match="not JSON"):
        client.rig("sim").watch(Topics.FORCE)
    with pytest.raises(ArgumentError, match="force, accel, voltage, truth"):
        client.rig("sim").blocks("smell")  # type: ignore[arg-type]


def test_requests_carry_client_time_and_time_to_live(client: Client, fake: Any) -> None:
    before = time.time_ns()
    client.rig("sim").stop()
    request = fake.asked("stop")
    assert request.client == "tester"
    assert before <= request.utc_ns <= time.time_ns()
    assert request.ttl_ms == 3_000


def test_scene_and_model_are_set(client: Client, fake: Any) -> None:
    rig = client.rig("sim")
    texture = Spectrum(components=[Component(amplitude_n=0.1, cycles_per_mm=2.0)])
    assert rig.set_scene(texture).applied.gain == 1.0
    assert fake.asked("scene").scene.regions[0].texture == texture
    rig.set_scene(Scene(name="smooth"), if_match="s1")
    assert fake.asked("scene").if_match == "s1"
    base = FirstOrderSpeedLaw(gain_n=0.39, cutoff_0_hz=385.68, slope_hz_per_mm_s=13.811)
    assert rig.set_model(Model(base=base), if_match="m1") == "e2"
    assert fake.asked("model").model.base == base
    rig.reset()
    fake.asked("reset")


def test_a_call_may_have_a_timeout_of_its_own(client: Client, fake: Any) -> None:
    rig = client.rig("sim")
    rig.set_scene(Scene(), timeout_s=20.0)
    assert fake.asked("scene").ttl_ms == 20_000
    with pytest.raises(ArgumentError, match="ttl_ms"):
        rig.set_scene(Scene(), timeout_s=0.0)
    fake.silent = True
    with pytest.raises(OutcomeUnknownError, match=r"within 0\.1 s"):
        rig.set_scene(Scene(), timeout_s=0.1)
    assert fake.asked("scene").ttl_ms == 100


def test_a_refusal_keeps_its_code_and_text(client: Client, fake: Any) -> None:
    fake.refusal = Reply(ok=False, code="not_owner", message="rig held by alice")
    with pytest.raises(RefusedError, match="alice") as refused:
        client.rig("sim").set_scene(Scene())
    assert refused.value.code == "not_owner"


def test_a_refused_arm_leaves_nothing_behind(client: Client, fake: Any) -> None:
    fake.refusal = Reply(ok=False, code="tripped", message="reset first")
    with pytest.raises(RefusedError, match="reset first"):
        client.rig("sim").arm()
    assert fake.tokens.get(timeout=WAIT_S) == ("tester", True)
    assert fake.tokens.get(timeout=WAIT_S) == ("tester", False)


@pytest.mark.parametrize("lease_ms", [0, -1, 99, 10_001, float("nan")])
def test_a_bad_lease_is_refused_before_sending(
    client: Client, fake: Any, lease_ms: Any
) -> None:
    with pytest.raises(ArgumentError, match="lease_ms"):
        client.rig("sim").arm(lease_ms=lease_ms)
    assert fake.calls.empty()


def test_what_was_sent_and_not_answered_has_an_unknown_outcome(router: str, fake: Any) -> None:
    fake.silent = True
    with frictus.connect(router, timeout_s=0.3) as client:
        rig = client.rig("sim")
        with pytest.raises(OutcomeUnknownError, match=r"stop was sent .* not answered within"):
            rig.stop()
        fake.asked("stop")  # it had arrived


def test_a_vanished_rig_is_a_no_rig_error(client: Client, fake: Any) -> None:
    with type(fake)(fake.router, RigKeys("lab", "brief")):
        rig = client.rig("brief")
    with client.presence(timeout_s=WAIT_S) as presence:
        for event in presence:  # the token may outlive the session by a moment
            if event.rig.name == "sim":
                break
    with pytest.raises(NoRigError, match="'brief'"):
        rig.stop()


def test_what_a_vanished_rig_said_last_holds_no_more(client: Client, fake: Any) -> None:
    keys = RigKeys("lab", "brief")
    with type(fake)(fake.router, keys):
        rig = client.rig("brief")
        assert rig.status().rig == "brief"
    with pytest.raises(NoRigError, match="'brief'"):
        for _ in iter(rig.status, None):  # its token falls a moment later
            pass
    with type(fake)(fake.router, keys) as again:
        with rig.watch(Topics.STATUS, timeout_s=WAIT_S) as feed:
            next(feed)
        assert rig.status().rig == again.keys.rig


def test_the_lease_is_renewed_and_given_back(client: Client, fake: Any) -> None:
    rig = client.rig("sim")
    with rig.arm(lease_ms=200) as lease:
        assert fake.asked("arm").lease_ms == 200
        assert fake.tokens.get(timeout=WAIT_S) == ("tester", True)
        renewals = [LeaseRenewal.from_json(fake.next_put(Topics.LEASE)) for _ in range(4)]
        assert {renewal.client for renewal in renewals} == {"tester"}
        assert {renewal.ttl_ms for renewal in renewals} == {200}
        times = [renewal.utc_ns for renewal in renewals]
        assert times == sorted(times)
        assert not lease.lost
    fake.asked("disarm")
    assert fake.tokens.get(timeout=WAIT_S) == ("tester", False)
    lease.disarm()
    assert fake.calls.empty()


def test_the_lease_is_not_renewed_for_somebody_who_is_gone(client: Client, fake: Any) -> None:
    asked, asked_again = 0, threading.Event()

    def there() -> bool:
        nonlocal asked
        asked += 1
        if asked == 5:
            asked_again.set()
        return asked <= 2

    with client.rig("sim").arm(lease_ms=100, still_there=there):
        assert asked_again.wait(WAIT_S)
        fake.next_put(Topics.LEASE)
        fake.next_put(Topics.LEASE)
    fake.asked("arm")
    fake.asked("disarm")
    assert fake.puts.empty()


def test_a_lease_taken_away_is_seen_and_not_renewed(client: Client, fake: Any) -> None:
    rig = client.rig("sim")
    with rig.arm(lease_ms=100) as lease:
        fake.asked("arm")
        fake.say(Topics.STATUS, fake.status(state="armed", owner="tester"))
        with rig.watch(Topics.STATUS, timeout_s=WAIT_S) as feed:
            for status in feed:
                if isinstance(status, RigStatus) and status.owner == "tester":
                    break
        # Two more renewals: the lease has read the status before the second.
        while not fake.puts.empty():
            fake.puts.get()
        fake.next_put(Topics.LEASE)
        fake.next_put(Topics.LEASE)
        assert not lease.lost
        fake.say(Topics.STATUS, fake.status(state="stopping"))
        assert lease.wait_lost(WAIT_S)
        assert "stopping" in lease.reason
    assert fake.calls.empty()  # what is lost needs no disarm


@pytest.mark.parametrize("lease_ms", ["100", 100.0])
def test_a_lease_that_is_accepted_is_renewed(client: Client, fake: Any, lease_ms: Any) -> None:
    with client.rig("sim").arm(lease_ms=lease_ms):
        for _ in range(3):
            assert b'"ttl_ms":100}' in fake.next_put(Topics.LEASE)


def test_a_lost_lease_says_nothing_of_the_next(client: Client, fake: Any) -> None:
    rig = client.rig("sim")
    fake.say(Topics.STATUS, fake.status(state="armed", owner="tester"))
    first = rig.arm(lease_ms=100)  # by a program that uses no `with`
    fake.asked("arm")
    fake.next_put(Topics.LEASE)
    fake.next_put(Topics.LEASE)
    fake.say(Topics.STATUS, fake.status(state="stopping"))
    assert first.wait_lost(WAIT_S)
    with pytest.raises(LeaseLostError):
        next(rig.fingers())
    fake.say(Topics.STATUS, fake.status(state="armed", owner="tester"))
    with rig.arm(lease_ms=10_000), rig.fingers(timeout_s=WAIT_S) as fingers:
        fake.say(Topics.FINGER, fake.finger(1))
        assert next(fingers).sequence == 1
    first.disarm()


def test_a_lost_lease_ends_what_follows_it_and_says_who_when_why(
    client: Client, fake: Any
) -> None:
    rig = client.rig("sim")
    with rig.arm(lease_ms=100) as lease, rig.open_stream(0.3) as stream:
        fingers, touches, blocks = rig.fingers(), rig.touches(), rig.blocks("force")
        fake.say(Topics.STATUS, fake.status(state="armed", owner="tester"))
        with rig.watch(Topics.STATUS, timeout_s=WAIT_S) as feed:
            while getattr(next(feed), "owner", None) != "tester":
                pass
        while not fake.puts.empty():
            fake.puts.get()
        fake.next_put(Topics.LEASE)
        fake.next_put(Topics.LEASE)  # now the lease has read that status
        end = LeaseEnd(owner="tester", by="alice", reason="stopped", utc_ns=10**18)
        fake.say(Topics.STATUS, fake.status(state="stopping", last_end=end))
        for _ in range(2):
            with pytest.raises(LeaseLostError, match=r"stopped by 'alice' at 01:46:40") as lost:
                next(fingers)
            assert (lost.value.by, lost.value.utc_ns) == ("alice", 10**18)
        with pytest.raises(LeaseLostError, match="alice"):
            next(touches)
        with pytest.raises(LeaseLostError, match="alice"):
            stream.send([0.1, -0.1], period_mm=2.0)
        with pytest.raises(LeaseLostError, match="alice"):
            next(rig.fingers())
        fake.say(Topics.FORCE, fake.block(0))
        assert isinstance(next(blocks), Block)  # what is measured goes on
        assert lease.reason == str(lost.value)
    with rig.fingers(timeout_s=WAIT_S) as observed:  # without a lease nothing ends it
        fake.say(Topics.FINGER, fake.finger(1))
        assert next(observed).sequence == 1


@pytest.mark.parametrize(("by", "told"), [(None, True), ("alice", False)])
def test_a_lease_that_is_lost_after_the_clock_was_set_names_the_clock(
    client: Client, fake: Any, monkeypatch: pytest.MonkeyPatch, by: str | None, told: bool
) -> None:
    fake.say(Topics.STATUS, fake.status(state="armed", owner="tester"))
    with client.rig("sim").arm(lease_ms=100) as lease:
        fake.next_put(Topics.LEASE)
        fake.next_put(Topics.LEASE)
        of_before = time.time_ns
        monkeypatch.setattr(time, "time_ns", lambda: of_before() + 3_600 * 10**9)
        end = LeaseEnd(owner="tester", by=by, reason="it ended", utc_ns=10**18)
        fake.say(Topics.STATUS, fake.status(state="stopping", last_end=end))
        assert lease.wait_lost(WAIT_S)
        assert ("this machine's clock jumped by +3600.0 s" in lease.reason) is told


def test_what_was_set_is_read_whatever_was_published_before(client: Client, fake: Any) -> None:
    fake.say_everything_once()
    rig = client.rig("sim")
    assert rig.scene().etag == "s1"
    assert rig.set_scene(Scene(name="new")).etag == "e2"
    fake.say(Topics.SCENE, SceneState(etag="s0", scene=Scene(), applied=APPLIED, utc_ns=4))
    late = SceneState(etag="e2", scene=Scene(name="new"), applied=APPLIED, utc_ns=5)
    timer = threading.Timer(0.2, fake.say, (Topics.SCENE, late))  # a publisher that is late
    timer.start()
    assert rig.scene().etag == "e2"
    timer.join()


def test_a_vanished_rig_takes_the_lease_with_it(client: Client, fake: Any) -> None:
    with type(fake)(fake.router, RigKeys("lab", "brief")) as brief:
        lease = client.rig("brief").arm(lease_ms=100)
        brief.asked("arm")
    assert lease.wait_lost(WAIT_S)
    assert "gone" in lease.reason
    lease.disarm()


def test_leaving_the_client_disarms(router: str, fake: Any) -> None:
    with frictus.connect(router, "tester") as client:
        client.rig("sim").arm()
        fake.asked("arm")
    fake.asked("disarm")


def test_the_first_update_of_a_stream_arrives(client: Client, fake: Any) -> None:
    with client.rig("sim").open_stream(0.3) as stream:
        assert fake.asked("open_stream").peak_n == 0.3
        assert stream.applied is not None
        stream.send([0.1, -0.3], period_mm=2.0, angle_deg=90.0)
        stream.send(np.zeros(4096), period_s=0.5, ttl_ms=50)
        first = StreamFrame.unpack(fake.next_put(Topics.TEXTURE))
        second = StreamFrame.unpack(fake.next_put(Topics.TEXTURE))
    assert (first.ticket, first.sequence, first.spatial, first.period) == (7, 0, True, 2.0)
    assert first.angle_deg == 90.0
    assert (second.sequence, second.spatial, second.ttl_ms) == (1, False, 50)
    np.testing.assert_allclose(first.friction_n, [0.1, -0.3], rtol=1e-6)
    fake.asked("close_stream")
    with pytest.raises(LinkError, match="closed"):
        stream.send([0.0, 0.0], period_mm=1.0)


@pytest.mark.parametrize(
    ("friction", "arguments", "complaint"),
    [
        ([0.1, 0.2], {}, "either period_mm or period_s"),
        ([0.1, 0.2], {"period_mm": 1.0, "period_s": 1.0}, "either period_mm or period_s"),
        ([0.1, 0.31], {"period_mm": 1.0}, "peak of 0.3 N"),
        ([0.1, float("nan")], {"period_mm": 1.0}, "finite"),
        ([], {"period_mm": 1.0}, "2 to 4096"),
        ([0.1], {"period_mm": 1.0}, "2 to 4096"),
        ([0.1, 0.1], {"period_mm": float("inf")}, "period"),
        ([0.1, 0.1], {"period_s": 11.0}, "period"),
        ([0.1, 0.1], {"period_mm": 1.0, "angle_deg": float("nan")}, "angle"),
        ([0.1, 0.1], {"period_mm": 1.0, "ttl_ms": -1}, "ttl_ms"),
        ([0.1, 0.1], {"period_mm": 1.0, "ttl_ms": 0}, "ttl_ms"),
    ],
)
def test_a_bad_update_is_refused_before_sending(
    client: Client, fake: Any, friction: list[float], arguments: dict[str, Any], complaint: str
) -> None:
    with client.rig("sim").open_stream(0.3) as stream:
        with pytest.raises(ArgumentError, match=complaint):
            stream.send(friction, **arguments)
        assert stream.sent == 0


def test_the_pointer_moves_a_virtual_finger(client: Client, fake: Any) -> None:
    rig = client.rig("sim")
    rig.point(1.0, 2.0)
    assert b'"x_mm":1.0' in fake.next_put(Topics.POINTER)
    with pytest.raises(ArgumentError, match="x_mm"):
        rig.point(float("nan"), 0.0)
    with pytest.raises(ArgumentError, match=r"^point: normal_force_n: [^\n]*$"):
        rig.point(1.0, 2.0, normal_force_n=6.0)


def test_silence_is_an_error_where_a_timeout_is_given(client: Client, fake: Any) -> None:
    with client.rig("sim").fingers(timeout_s=0.05) as fingers:
        with pytest.raises(SilenceError, match=r"0\.05 s"):
            next(fingers)


ROUTER = """
import sys
from frictus.session import open_router
with open_router(sys.argv[1]):
    print("open", flush=True)
    sys.stdin.read()
"""


@pytest.mark.skipif(sys.platform == "win32", reason="Windows stops no process halfway")
def test_what_was_said_before_the_link_went_is_not_told_as_if_it_were_so(
    free_endpoint: str,
) -> None:
    """A rig of which nothing can be heard any more was 'armed' for ever."""
    with contextlib.ExitStack() as held:
        router = held.enter_context(open_router(free_endpoint))
        fake = held.enter_context(FakeRig(free_endpoint, RigKeys("lab", "sim")))
        rig = held.enter_context(frictus.connect(free_endpoint)).rig("sim")
        fake.say(Topics.STATUS, fake.status(state="armed", owner="tester"))
        assert rig.status().state == "armed"
        router.close()  # type: ignore[no-untyped-call]
        deadline_s = time.monotonic() + WAIT_S
        told = ""
        while not told and time.monotonic() < deadline_s:
            try:
                rig.status()
            except LinkError as error:
                told = str(error)
        assert told.startswith("state/status is not known: the link to the router is gone")


def test_a_router_that_does_not_answer_is_not_an_empty_site(free_endpoint: str) -> None:
    command = [sys.executable, "-c", ROUTER, free_endpoint]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "open\n"
        with frictus.connect(free_endpoint) as client:
            assert client.rigs() == []
            process.send_signal(signal.SIGSTOP)
            try:
                with pytest.raises(LinkError, match=r"not answered within 0\.1 s"):
                    client.rigs(wait_s=0.1)
            finally:
                process.send_signal(signal.SIGCONT)
        process.communicate()


def test_a_closed_client_says_so(router: str) -> None:
    client = frictus.connect(router)
    client.close()
    client.close()
    with pytest.raises(RuntimeError, match="connect again"):
        client.rigs()


def test_a_rig_of_a_closed_client_says_so(router: str, fake: Any) -> None:
    """Nothing is tried again there."""
    with frictus.connect(router) as client:
        rig = client.rig("sim")
    for call in (rig.stop, lambda: rig.set_scene(Scene()), lambda: rig.present):
        with pytest.raises(LinkError, match="the client was closed; connect again"):
            call()


@pytest.mark.parametrize("timeout_s", [0.0, -1.0, float("nan"), 61.0])
def test_a_wait_that_no_request_can_have_is_refused(router: str, timeout_s: float) -> None:
    with pytest.raises(ArgumentError, match=r"timeout_s .*: above 0 and up to 60 s"):
        frictus.connect(router, timeout_s=timeout_s)


def test_a_rig_is_named_by_a_text(client: Client, fake: Any) -> None:
    with pytest.raises(InvalidNameError, match="rig name RigName"):
        client.rig(client.rigs()[0])  # type: ignore[arg-type]
