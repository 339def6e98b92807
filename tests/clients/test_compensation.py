"""The compensation mode as a client chooses and reads it."""

from typing import Any

import pytest
from pydantic import ValidationError

import frictus
from frictus.errors import ArgumentError, LinkError, RefusedError
from frictus.keys import Topics
from frictus.messages import Reply, RigStatus
from frictus.model import BY_MODEL, Compensation


@pytest.mark.parametrize(
    ("asked", "shown"),
    [
        ({"mode": "model"}, "model"),
        ({"mode": "fixed", "speed_mm_s": 60.0}, "fixed:60"),
        ({"mode": "fixed", "speed_mm_s": 37.5}, "fixed:37.5"),
        ({"mode": "none"}, "none"),
    ],
)
def test_what_is_asked_is_what_is_sent_and_answered(
    fake: Any, client: frictus.Client, asked: dict[str, Any], shown: str
) -> None:
    found = client.rig("sim").compensate(**asked)
    assert fake.asked("compensation").compensation == found == Compensation(**asked)
    assert str(found) == shown


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"mode": "off"}, "mode"),
        ({"mode": "fixed"}, "1 to 1000 mm/s"),
        ({"mode": "fixed", "speed_mm_s": 0.5}, "speed_mm_s"),
        ({"mode": "fixed", "speed_mm_s": 1e9}, "speed_mm_s"),
        ({"mode": "fixed", "speed_mm_s": float("nan")}, "speed_mm_s"),
        ({"mode": "none", "speed_mm_s": 60.0}, "leave it out"),
    ],
    ids=str,
)
def test_what_is_no_mode_is_not_sent(
    fake: Any, client: frictus.Client, asked: dict[str, Any], said: str
) -> None:
    with pytest.raises(ArgumentError, match=said):
        client.rig("sim").compensate(**asked)
    assert fake.calls.empty()


def test_a_refusal_is_an_error(fake: Any, client: frictus.Client) -> None:
    fake.refusal = Reply(ok=False, code="not_armed", message="arm the rig first")
    with pytest.raises(RefusedError, match="arm the rig first") as refused:
        client.rig("sim").compensate("none")
    assert refused.value.code == "not_armed"


def test_a_reply_that_names_no_mode_is_a_fault(fake: Any, client: frictus.Client) -> None:
    fake.refusal = Reply(ok=True, state="armed")
    with pytest.raises(LinkError, match="did not say"):
        client.rig("sim").compensate("none")


def test_the_next_status_includes_what_was_confirmed(fake: Any, client: frictus.Client) -> None:
    rig = client.rig("sim")
    assert rig.status().compensation == BY_MODEL
    fake.refusal = Reply(
        ok=True, state="armed", utc_ns=5, compensation=Compensation(mode="none")
    )
    fake.say(Topics.STATUS, fake.status(utc_ns=4))
    rig.compensate("none")
    chosen = Compensation(mode="none")
    fake.say(Topics.STATUS, fake.status(utc_ns=6, compensation=chosen))
    assert rig.status().compensation == chosen


def test_a_rig_that_knows_no_modes_renders_by_the_model(fake: Any) -> None:
    fields = fake.status().model_dump(mode="json", exclude={"compensation"})
    assert RigStatus.model_validate(fields).compensation == BY_MODEL


def test_a_mode_may_know_more_than_this_reader() -> None:
    newer = {"mode": "fixed", "speed_mm_s": 60.0, "colour": "blue"}
    assert str(Compensation.model_validate(newer)) == "fixed:60"
    with pytest.raises(ValidationError):
        Compensation.model_validate({"speed_mm_s": 60.0})
