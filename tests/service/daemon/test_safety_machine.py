"""No reachable state of a rig drives the screen without owner, finger and sensors."""

import pytest

from .safety_events import EVENTS, GROUPS
from .safety_model import search
from .time_to_zero import CAUSES, LIMITS_MS, time_to_zero_ms


@pytest.mark.parametrize("group", ["owner", "finger", "model"])
def test_no_order_of_events_drives_the_screen_without_a_right_to(group: str) -> None:
    found = search(GROUPS[group])
    assert not found.wrong, found.wrong[:3]
    assert found.complete
    assert found.zero_after_ms, "nothing was ever driven"


@pytest.mark.parametrize("cause", sorted(CAUSES))
def test_output_is_zero_within_two_blocks_lead_and_ramp(cause: str) -> None:
    two_blocks_lead_ramp_ms = 10.0 + 20.0 + 20.0
    report_ms = 1e3 / 60.0
    bound_ms = LIMITS_MS.get(cause, 0.0) + two_blocks_lead_ramp_ms
    if cause == "no touch report any more":
        bound_ms += report_ms  # the last one may have been about to come
    assert time_to_zero_ms(cause, phase=3) <= bound_ms


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
