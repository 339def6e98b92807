"""The one table of keys."""

import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from frictus.keys import (
    CALLS,
    ROOT,
    STREAMS,
    TOPICS,
    InvalidNameError,
    RigKeys,
    any_rig_alive,
    rig_of,
    spoken_name,
)
from frictus.messages import MESSAGES

NAME = r"[A-Za-z0-9_.-]{1,64}"
names = st.from_regex(NAME, fullmatch=True)


@given(names, names, names)
def test_every_key_leads_back_to_its_rig(site: str, rig: str, client: str) -> None:
    keys = RigKeys(site, rig)
    every = [keys.of(topic) for topic in TOPICS] + [keys.call(name) for name in CALLS]
    every += [keys.alive, keys.client_alive(client), keys.any_client_alive]
    assert len(set(every)) == len(every)
    for key in every:
        assert rig_of(key) == keys


@given(st.text(max_size=70).filter(lambda text: not re.fullmatch(NAME, text)))
def test_names_that_cannot_stand_in_a_key_are_refused(name: str) -> None:
    with pytest.raises(InvalidNameError, match="site name"):
        RigKeys(name, "rig")
    with pytest.raises(InvalidNameError, match="rig name"):
        RigKeys("lab", name)
    with pytest.raises(InvalidNameError, match="client name"):
        RigKeys("lab", "rig").client_alive(name)
    if name != "*":
        with pytest.raises(InvalidNameError, match="site name"):
            any_rig_alive(name)


@pytest.mark.parametrize("key", ["", "frictus", "frictus/@v2/lab/rig/x", f"{ROOT}/lab/rig"])
def test_other_keys_are_refused(key: str) -> None:
    with pytest.raises(ValueError, match="not a key of frictus"):
        rig_of(key)


def test_an_unknown_call_names_those_there_are() -> None:
    with pytest.raises(KeyError, match="open_stream"):
        RigKeys("lab", "rig").call("dance")


def test_every_message_in_the_table_exists() -> None:
    for topic in TOPICS:
        assert topic.message in MESSAGES or topic.message.startswith(("Block", "StreamFrame"))
        assert topic.unit
        assert topic.qos.why
    assert set(CALLS.values()) <= set(MESSAGES)
    assert all(topic in TOPICS for topic in STREAMS.values())


def test_nothing_else_spells_a_key() -> None:
    sources = (Path(__file__).parents[2] / "clients" / "frictus").glob("*.py")
    for source in sources:
        if source.name != "keys.py":
            assert "@v1" not in source.read_text(encoding="utf-8"), source.name


@pytest.mark.parametrize(
    ("client", "said"),
    [
        (None, "nobody"),
        ("local.page-0a1b2c", "a page"),
        ("ann.page-0a1b2c", "ann's page"),
        ("local.participant-0a1b2c", "the participant's page"),
        ("tablet.participant-0a1b2c", "the participant's page"),
        ("local.rest", "a REST client"),
        ("local.experiment-0a1b2c3d", "an experiment"),
        ("ann.b.calibration-0a1b2c3d", "ann.b's calibration"),
        ("lab-pc-7-4711-0a1b2c", "a program on lab-pc-7 (process 4711)"),
        ("linen-study", "'linen-study'"),
        ("ann", "'ann'"),
    ],
)
def test_a_client_has_a_name_that_people_know(client: str | None, said: str) -> None:
    assert spoken_name(client) == said
