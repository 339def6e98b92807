"""The rules as data: nothing but what a role needs, for exactly who bears it."""

import zenoh

from frictus.keys import (
    CALLS,
    COMMAND,
    RECORDER_CALLS,
    TOPICS,
    RigKeys,
    Topics,
    any_rig_alive,
)
from frictus_service.security.members import Member
from frictus_service.security.router import access_control

KEYS = RigKeys("lab", "rig1")
OTHER = RigKeys("lab", "rig2")
RIG = Member("rig", "lab/rig1")
ALICE = Member("controller", "alice")
BOB = Member("observer", "bob")
EVERYBODY = [RIG, ALICE, BOB, Member("router", "hall"), Member("rig", "lab/rig2")]
CALL_KEYS = [KEYS.call(name) for name in (*CALLS, *RECORDER_CALLS)]


def allowed(member: Member, flow: str, message: str, key: str) -> bool:
    """Whether the router lets a member do it, by the rules alone."""
    access = access_control(EVERYBODY)
    rules = {rule["id"]: rule for rule in access["rules"]}
    subjects = {
        subject["id"]
        for subject in access["subjects"]
        if member.common_name in subject["cert_common_names"]
    }
    granted = [
        rules[name]
        for policy in access["policies"]
        if subjects & set(policy["subjects"])
        for name in policy["rules"]
    ]
    return any(
        flow in rule["flows"]
        and message in rule["messages"]
        and any(zenoh.KeyExpr(one).includes(zenoh.KeyExpr(key)) for one in rule["key_exprs"])
        for rule in granted
    )


def test_denied_unless_allowed() -> None:
    access = access_control(EVERYBODY)
    assert access["enabled"] is True
    assert access["default_permission"] == "deny"
    assert {rule["permission"] for rule in access["rules"]} == {"allow"}


def test_nobody_is_known_where_there_are_no_members() -> None:
    access = access_control([])
    assert (access["subjects"], access["policies"]) == ([], [])


def test_names_are_unique_and_every_one_is_defined() -> None:
    access = access_control([*EVERYBODY, BOB])
    names = [rule["id"] for rule in access["rules"]]
    assert len(set(names)) == len(names)
    for policy in access["policies"]:
        assert set(policy["rules"]) <= set(names)
    bearers = [name for subject in access["subjects"] for name in subject["cert_common_names"]]
    assert len(set(bearers)) == len(bearers)


def test_only_a_rig_says_what_it_measured_and_only_its_own() -> None:
    for topic in TOPICS:
        mine = topic.qos is not COMMAND and topic not in (Topics.GUIDANCE, Topics.MARKER)
        assert allowed(RIG, "ingress", "put", KEYS.of(topic)) is mine
        assert not allowed(RIG, "ingress", "put", OTHER.of(topic))
        assert not allowed(BOB, "ingress", "put", KEYS.of(topic))
        assert allowed(ALICE, "ingress", "put", KEYS.of(topic)) is not mine
    assert allowed(RIG, "ingress", "liveliness_token", KEYS.alive)
    assert not allowed(RIG, "ingress", "liveliness_token", OTHER.alive)


def test_everybody_may_stop_and_only_a_controller_may_command() -> None:
    for key in CALL_KEYS:
        stops = key == KEYS.call("stop")
        assert allowed(ALICE, "ingress", "query", key)
        assert allowed(BOB, "ingress", "query", key) is stops
        assert not allowed(Member("rig", "lab/rig2"), "ingress", "query", key)
        assert allowed(RIG, "egress", "query", key)
        assert not allowed(Member("rig", "lab/rig2"), "egress", "query", key)


def test_a_rigs_tracker_may_have_its_own_model_adapted_and_nothing_else() -> None:
    for key in CALL_KEYS:
        asks = key in (KEYS.call("adapt"), KEYS.call("stop"))
        assert allowed(RIG, "ingress", "query", key) is asks
        for message in ("reply", "declare_queryable"):
            assert allowed(RIG, "egress", message, key) is asks
        assert not allowed(RIG, "ingress", "query", key.replace("rig1", "rig2"))


def test_only_a_rig_answers_for_itself() -> None:
    for key in CALL_KEYS:
        for message in ("declare_queryable", "reply"):
            assert allowed(RIG, "ingress", message, key)
            assert not allowed(ALICE, "ingress", message, key)
            assert not allowed(BOB, "ingress", message, key)
            assert not allowed(RIG, "ingress", message, key.replace("rig1", "rig2"))


def test_everybody_looks_on_at_one_rig_or_all() -> None:
    for member in (ALICE, BOB):
        for topic in TOPICS:
            if topic.qos is COMMAND:
                assert not allowed(member, "ingress", "declare_subscriber", KEYS.of(topic))
                continue
            for key in (KEYS.of(topic), KEYS.of(topic).replace("rig1", "*")):
                assert allowed(member, "ingress", "declare_subscriber", key)
            assert allowed(member, "egress", "put", KEYS.of(topic))
        for key in (any_rig_alive(), any_rig_alive("lab"), KEYS.alive):
            assert allowed(member, "ingress", "liveliness_query", key)
            assert allowed(member, "ingress", "declare_liveliness_subscriber", key)


def test_a_rig_learns_who_listens_so_that_it_sends_at_all() -> None:
    for key in (KEYS.of(Topics.STATUS), KEYS.of(Topics.STATUS).replace("rig1", "*")):
        assert allowed(RIG, "egress", "declare_subscriber", key)
    assert allowed(ALICE, "egress", "declare_subscriber", KEYS.of(Topics.TEXTURE))


def test_only_a_controller_holds_a_lease() -> None:
    token = KEYS.client_alive("alice")
    assert allowed(ALICE, "ingress", "liveliness_token", token)
    assert not allowed(BOB, "ingress", "liveliness_token", token)
    assert allowed(RIG, "egress", "liveliness_token", token)
