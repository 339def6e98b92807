"""The catalogue: every cause has its equation, words for people, and its experiments."""

from pathlib import Path

import pytest

from frictus_hardware.physics.effects import EFFECTS
from frictus_service.discovery.catalogue.causes import (
    CAUSES,
    cause_of,
    confusable_with,
    separating_experiment,
)
from frictus_service.discovery.catalogue.page import catalogue
from frictus_service.errors import UnknownCauseError

REQUIRED_PAIRS = (
    ("fractional_rolloff", "channel_delay"),
    ("cutoff_drift", "speed_dependent_cutoff"),
    ("gain_drift", "speed_dependent_gain"),
    ("stick_slip", "speed_dependent_gain"),
)


def test_causes_and_effects_join_one_to_one() -> None:
    assert set(CAUSES) == set(EFFECTS)
    for id_, cause in CAUSES.items():
        assert cause.id == EFFECTS[id_].id == id_
        assert cause.response == EFFECTS[id_].response, id_


@pytest.mark.parametrize("id_", CAUSES)
def test_a_cause_says_everything(id_: str) -> None:
    cause = CAUSES[id_]
    said = (cause.statement, cause.literature, cause.next_experiment, cause.visible_with)
    for text in (*said, *(experiment for _, experiment in cause.confusable)):
        assert text.endswith("."), text
        assert text[0].isupper(), text
        assert "  " not in text, text


def test_confusable_pairs_stand_once_and_are_read_both_ways() -> None:
    seen = set()
    for cause in CAUSES.values():
        for other, experiment in cause.confusable:
            assert other in CAUSES
            assert other != cause.id
            pair = frozenset((cause.id, other))
            assert pair not in seen
            seen.add(pair)
            assert confusable_with(other)[cause.id] == experiment
            assert separating_experiment(other, cause.id) == experiment
    assert {frozenset(pair) for pair in REQUIRED_PAIRS} <= seen


def test_only_causes_of_one_response_are_confused() -> None:
    for cause in CAUSES.values():
        for other in confusable_with(cause.id):
            assert "both" in (cause.response, CAUSES[other].response) or (
                cause.response == CAUSES[other].response
            )


def test_a_pair_that_nobody_thought_of_gets_both_experiments() -> None:
    first, second = CAUSES["stick_slip"], CAUSES["mount_resonance_shift"]
    assert second.id not in confusable_with(first.id)
    told = separating_experiment(first.id, second.id)
    assert first.next_experiment in told
    assert second.next_experiment in told


def test_unknown_causes_are_refused_with_those_there_are() -> None:
    for call in (cause_of, confusable_with):
        with pytest.raises(UnknownCauseError, match=r"no cause 'magic': known are amplitude_"):
            call("magic")
    with pytest.raises(KeyError):
        separating_experiment("stick_slip", "magic")


def test_the_manual_is_the_catalogue() -> None:
    manual = Path(__file__).parents[4] / "docs" / "causes.md"
    again = "uv run python bench/causes.py --out docs/causes.md"
    assert manual.read_text("utf-8") == catalogue(), f"make it again: {again}"
