"""The adaptation policy as a client chooses and reads it, and what a tracker asks for."""

from typing import Any

import pytest
from pydantic import ValidationError

import frictus
from frictus.errors import ArgumentError, LinkError, RefusedError
from frictus.keys import Topics
from frictus.messages import MAX_REASON, AdaptationPolicy, ModelState, Reply, RigStatus
from frictus.model import FirstOrderSpeedLaw, Model

LAW = FirstOrderSpeedLaw(gain_n=0.4, cutoff_0_hz=400.0, slope_hz_per_mm_s=12.0)
MODEL = Model(base=LAW)


@pytest.mark.parametrize("policy", ["observe", "suggest", "adapt"])
@pytest.mark.parametrize("undo", [False, True])
def test_what_is_asked_is_what_is_sent_and_answered(
    fake: Any, client: frictus.Client, policy: AdaptationPolicy, undo: bool
) -> None:
    assert client.rig("sim").set_adaptation(policy, undo=undo) == policy
    asked = fake.asked("adaptation")
    assert (asked.policy, asked.undo) == (policy, undo)


def test_what_is_no_policy_is_not_sent(fake: Any, client: frictus.Client) -> None:
    with pytest.raises(ArgumentError, match="policy"):
        client.rig("sim").set_adaptation("follow")  # type: ignore[arg-type]
    assert fake.calls.empty()


def test_a_tracker_sends_what_it_was_made_from_and_why(
    fake: Any, client: frictus.Client
) -> None:
    assert client.rig("sim").adapt(MODEL, "e1", "the finger is drier") == "e2"
    asked = fake.asked("adapt")
    assert (asked.model, asked.if_match, asked.reason) == (MODEL, "e1", "the finger is drier")


def test_a_reason_that_is_too_long_is_not_sent(fake: Any, client: frictus.Client) -> None:
    with pytest.raises(ArgumentError, match="reason"):
        client.rig("sim").adapt(MODEL, "e1", (MAX_REASON + 1) * "x")
    assert fake.calls.empty()


def test_a_refusal_is_an_error(fake: Any, client: frictus.Client) -> None:
    fake.refusal = Reply(ok=False, code="not_owner", message="'ann' keeps its model")
    with pytest.raises(RefusedError, match="keeps its model") as refused:
        client.rig("sim").set_adaptation("observe", undo=True)
    assert refused.value.code == "not_owner"
    with pytest.raises(RefusedError, match="keeps its model"):
        client.rig("sim").adapt(MODEL, "e1")


def test_a_reply_that_names_nothing_is_a_fault(fake: Any, client: frictus.Client) -> None:
    fake.refusal = Reply(ok=True)
    with pytest.raises(LinkError, match="did not say"):
        client.rig("sim").set_adaptation("observe")
    with pytest.raises(LinkError, match="did not name"):
        client.rig("sim").adapt(MODEL, "e1")


def test_what_is_read_next_includes_what_was_confirmed(
    fake: Any, client: frictus.Client
) -> None:
    rig = client.rig("sim")
    assert (rig.status().adaptation, rig.status().adaptations) == ("observe", 0)
    fake.refusal = Reply(ok=True, utc_ns=5, etag="e9")
    fake.say(Topics.STATUS, fake.status(utc_ns=4))
    rig.adapt(MODEL, "e1")
    state = ModelState(etag="e9", model=MODEL, adapted_from="e1", reason="why", utc_ns=6)
    fake.say(Topics.MODEL, state)
    fake.say(Topics.STATUS, fake.status(utc_ns=6, adaptation="adapt", adaptations=1))
    assert rig.model() == state
    assert rig.status().adaptations == 1


def test_a_rig_is_armed_with_the_model_kept(fake: Any, client: frictus.Client) -> None:
    rig = client.rig("sim")
    for keep_model in (True, False):
        rig.arm(keep_model=keep_model).disarm()
        assert fake.asked("arm").keep_model is keep_model
        fake.asked("disarm")


def test_a_rig_that_adapts_nothing_is_read(fake: Any) -> None:
    older = fake.status().model_dump(mode="json", exclude={"adaptation", "adaptations"})
    assert RigStatus.model_validate(older).adaptation == "observe"
    with pytest.raises(ValidationError):
        RigStatus.model_validate({**older, "adaptation": "follow"})
