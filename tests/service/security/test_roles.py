"""What each role may do, over real links: who may not is not heard, who may is.

A put that is denied leaves no trace, so after each one its sender does something that it may
do: when that has arrived on the same link, the put would have, too.
"""

import queue

import pytest
import zenoh
from zenoh.handlers import Callback

import frictus
from frictus.keys import CALLS, ROOT, RigKeys, Topics
from frictus.session import declare_reader

from .conftest import WAIT_S, Ear, Join, Lab, SecuredRig, shout

HARMFUL = sorted(set(CALLS) - {"stop"})


def test_an_observer_sees_the_rig_and_its_last_status(
    lab: Lab, rig: SecuredRig, join: Join
) -> None:
    with join(lab.observer) as observer, observer.presence(timeout_s=WAIT_S) as presence:
        assert next(presence) == (("lab", "rig1"), True)
        for topic in (Topics.STATUS, Topics.FORCE, Topics.FINGER):
            key = rig.keys.of(topic)
            ear = Ear(observer.session, key)
            ear.attune(rig.session, key)


def test_a_late_observer_gets_what_was_said_before(
    lab: Lab, rig: SecuredRig, join: Join
) -> None:
    observer = join(lab.observer)
    seen: queue.Queue[bytes] = queue.Queue()

    def note(sample: zenoh.Sample) -> None:
        seen.put(sample.payload.to_bytes())

    reader = declare_reader(
        observer.session, rig.keys.of(Topics.STATUS), Topics.STATUS, Callback(note)
    )
    assert seen.get(timeout=WAIT_S) == b"first"
    reader.undeclare()


def test_a_controller_arms_renews_and_streams(lab: Lab, rig: SecuredRig, join: Join) -> None:
    controller = join(lab.controller)
    with controller.rig("rig1").arm():
        rig.reached_until(rig.keys.call("arm"))
        rig.reached_until(rig.keys.of(Topics.LEASE))
        shout(controller.session, rig.keys, Topics.TEXTURE, b"texture")
        assert rig.reached_until(rig.keys.of(Topics.TEXTURE))[-1][1] == b"texture"
    rig.reached_until(rig.keys.call("disarm"))


def test_a_controller_guides_and_everybody_sees_it(
    lab: Lab, rig: SecuredRig, join: Join
) -> None:
    key = rig.keys.of(Topics.GUIDANCE)
    ears = [Ear(session, key) for session in (rig.session, join(lab.observer).session)]
    controller = join(lab.controller)
    for ear in ears:
        ear.attune(controller.session, key)


@pytest.mark.parametrize("topic", [Topics.TEXTURE, Topics.LEASE, Topics.POINTER])
def test_an_observer_cannot_put_a_command(
    topic: frictus.Topic, lab: Lab, rig: SecuredRig, join: Join
) -> None:
    observer = join(lab.observer)
    shout(observer.session, rig.keys, topic, b"not mine to send")
    observer.rig("rig1").stop()
    assert rig.reached_until(rig.keys.call("stop")) == [(rig.keys.call("stop"), b"")]


def test_an_observer_cannot_arm_and_is_told_why(lab: Lab, rig: SecuredRig, join: Join) -> None:
    observer = join(lab.observer)
    with pytest.raises(frictus.LinkError, match="only a controller may command a rig"):
        observer.rig("rig1").arm()
    observer.rig("rig1").stop()  # nobody is refused that
    assert rig.reached_until(rig.keys.call("stop")) == [(rig.keys.call("stop"), b"")]


@pytest.mark.parametrize("call", HARMFUL)
def test_no_call_that_changes_something_passes(
    call: str, lab: Lab, rig: SecuredRig, join: Join
) -> None:
    observer = join(lab.observer)
    answers = observer.session.get(rig.keys.call(call), payload=b"{}", timeout=1.0)
    assert [answer.ok for answer in answers if answer.ok] == []
    observer.rig("rig1").stop()
    assert rig.reached_until(rig.keys.call("stop")) == [(rig.keys.call("stop"), b"")]


@pytest.mark.parametrize("who", ["observer", "controller"])
def test_neither_observer_nor_controller_can_spoof_a_state(
    who: str, lab: Lab, rig: SecuredRig, join: Join
) -> None:
    spoofer, other = join(getattr(lab, who)), join(lab.observer)
    ear = Ear(other.session, rig.keys.of(Topics.STATUS))
    ear.attune(rig.session, rig.keys.of(Topics.STATUS))
    for topic in (Topics.STATUS, Topics.FORCE):
        shout(spoofer.session, rig.keys, topic, b"spoof")
    spoofer.rig("rig1").stop()
    rig.reached_until(rig.keys.call("stop"))
    rig.status.put(b"true")
    assert b"spoof" not in ear.until(b"true")


def test_a_rig_speaks_for_itself_alone(
    lab: Lab, rig: SecuredRig, other_rig: SecuredRig, join: Join
) -> None:
    viewer = join(lab.observer)
    ear = Ear(viewer.session, f"{ROOT}/*/*/{Topics.STATUS.suffix}")
    ear.attune(other_rig.session, other_rig.keys.of(Topics.STATUS))
    shout(other_rig.session, rig.keys, Topics.STATUS, b"spoof")
    shout(other_rig.session, other_rig.keys, Topics.STATUS, b"own")
    assert b"spoof" not in ear.until(b"own")


def test_nobody_answers_in_place_of_the_rig(lab: Lab, rig: SecuredRig, join: Join) -> None:
    observer, controller = join(lab.observer), join(lab.controller)
    asked: queue.Queue[str] = queue.Queue()

    def steal(query: zenoh.Query) -> None:
        asked.put(str(query.key_expr))
        query.drop()  # type: ignore[no-untyped-call]

    thief = observer.session.declare_queryable(
        rig.keys.call("scene"), Callback(steal), complete=True
    )
    token = observer.session.liveliness().declare_token(RigKeys("lab", "rig9").alive)
    observer.rig("rig1").stop()
    controller.session.get(rig.keys.call("scene"), payload=b"{}").recv()
    rig.reached_until(rig.keys.call("scene"))
    assert asked.empty()
    assert controller.rigs() == [("lab", "rig1")]
    for declared in (thief, token):
        declared.undeclare()  # type: ignore[no-untyped-call]


def test_an_unknown_member_neither_says_nor_hears_anything(
    lab: Lab, rig: SecuredRig, join: Join
) -> None:
    stranger = join(lab.stranger)
    assert stranger.rigs() == []
    with pytest.raises(frictus.NoRigError, match="folder of members"):
        stranger.rig("rig1", wait_s=0.1)
    ear = Ear(stranger.session, rig.keys.of(Topics.STATUS))
    shout(stranger.session, rig.keys, Topics.TEXTURE, b"texture")
    known = join(lab.controller)
    known_ear = Ear(known.session, rig.keys.of(Topics.STATUS))
    known_ear.attune(rig.session, rig.keys.of(Topics.STATUS))
    shout(stranger.session, rig.keys, Topics.TEXTURE, b"texture")
    known.rig("rig1").stop()
    assert rig.reached_until(rig.keys.call("stop")) == [(rig.keys.call("stop"), b"")]
    rig.status.put(b"now")
    known_ear.until(b"now")
    assert ear.heard.empty()
