"""No reachable state of a rig drives the screen without owner, finger and sensors."""

import pytest

from .safety_model import EVENTS, GROUPS, search


@pytest.mark.parametrize("group", ["owner", "finger"])
def test_no_order_of_events_drives_the_screen_without_a_right_to(group: str) -> None:
    found = search(GROUPS[group])
    assert not found.wrong, found.wrong[:3]
    assert found.complete
    assert found.zero_after_ms, "nothing was ever driven"


@pytest.mark.campaign
@pytest.mark.parametrize("group", sorted(GROUPS))
def test_no_order_of_any_group_does(group: str) -> None:
    found = search(GROUPS[group])
    assert not found.wrong, found.wrong[:3]
    assert found.complete


@pytest.mark.campaign
def test_no_short_order_of_all_events_does() -> None:
    found = search(EVENTS, most_states=5_000)
    assert not found.wrong, found.wrong[:3]
