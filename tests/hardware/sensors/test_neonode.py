"""The touchpad as a state machine: set-up, restarts, one finger, staleness, reconnection."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.hardware.sensors.frames import (
    BOOT,
    DOWN,
    ENABLED,
    MODE_SET,
    MOVE,
    UP,
    touch,
    touch_frame,
)

from frictus_hardware.errors import ConfigError
from frictus_hardware.sensors.neonode import (
    Action,
    FingerLost,
    NeonodeReport,
    Reconnect,
    ScreenFrame,
    Send,
    SensorAxis,
    Touchpad,
)
from frictus_hardware.sensors.zforce import DETECTION_MODE, ENABLE


def ready(touchpad: Touchpad | None = None, now_s: float = 0.0) -> Touchpad:
    touchpad = Touchpad() if touchpad is None else touchpad
    assert touchpad.connected(now_s) == (Send(DETECTION_MODE),)
    assert touchpad.received(MODE_SET, now_s) == (Send(ENABLE),)
    assert touchpad.received(ENABLED, now_s) == ()
    assert touchpad.fault is None
    return touchpad


def test_requests_follow_one_another_and_only_then_is_it_ready() -> None:
    touchpad = Touchpad()
    assert touchpad.fault == "the touch sensor is not connected"
    assert touchpad.connected(0.0) == (Send(DETECTION_MODE),)
    assert touchpad.received(ENABLED, 0.1) == ()  # not what was asked
    assert touchpad.received(MODE_SET, 0.1) == (Send(ENABLE),)
    assert touchpad.received(b"\xef\x08\x40\x02\x02\x00\x65\x02\x80\x00", 0.1) == ()
    assert touchpad.fault is not None
    touchpad.received(ENABLED, 0.2)
    assert touchpad.fault is None
    assert touchpad.tick(100.0) == ()


def test_a_request_without_response_is_repeated_then_the_transport_reopened() -> None:
    touchpad = Touchpad(response_s=0.5, reconnect_s=1.0)
    touchpad.connected(0.0)
    assert touchpad.tick(0.4) == ()
    assert touchpad.tick(0.5) == (Send(DETECTION_MODE),)
    assert touchpad.tick(1.0) == (Send(DETECTION_MODE),)
    assert touchpad.tick(1.5) == ()
    assert touchpad.fault == "the touch sensor did not respond to 3 requests"
    assert touchpad.tick(2.4) == ()
    assert touchpad.tick(2.5) == (Reconnect(),)
    assert touchpad.tick(9.9) == ()
    assert touchpad.counts.repeated_requests == 2
    assert touchpad.counts.reconnects == 1
    ready(touchpad, 10.0)


def test_a_finger_from_down_to_up() -> None:
    touchpad = ready()
    (down,) = touchpad.received(touch(DOWN, 300, ticks=65530), 1.00)
    (move,) = touchpad.received(touch(MOVE, 310, ticks=322), 1.01)
    (up,) = touchpad.received(touch(UP, 320, ticks=650), 1.02)
    assert down == NeonodeReport(30.0, 20.0, True, 1.00, 0.0)
    assert isinstance(move, NeonodeReport)
    assert isinstance(up, NeonodeReport)
    assert (move.x_mm, move.in_contact, up.x_mm, up.in_contact) == (31.0, True, 32.0, False)
    assert move.sensor_s == pytest.approx(0.01, abs=1e-4)
    assert up.sensor_s == pytest.approx(0.02, abs=1e-4)
    assert touchpad.tick(60.0) == ()
    assert touchpad.fault is None
    assert touchpad.counts.reports == 3


def test_a_second_finger_is_counted_not_followed() -> None:
    touchpad = ready()
    touchpad.received(touch(DOWN, 300, finger=1), 1.0)
    assert touchpad.received(touch(DOWN, 100, finger=2), 1.0) == ()
    both = touch_frame([(2, MOVE, 110, 200), (1, MOVE, 305, 200)])
    (report,) = touchpad.received(both, 1.01)
    assert isinstance(report, NeonodeReport)
    assert (report.x_mm, report.sensor_s) == (30.5, None)
    touchpad.received(touch(UP, 305, finger=1), 1.02)
    (report,) = touchpad.received(touch(MOVE, 120, finger=2), 1.03)
    assert isinstance(report, NeonodeReport)
    assert report.x_mm == 12.0
    assert touchpad.counts.other_fingers == 2


def test_a_finger_of_which_nothing_comes_is_lost_once_until_it_is_told_of_again() -> None:
    touchpad = ready(Touchpad(stale_s=0.1))
    touchpad.received(touch(DOWN, 300), 1.0)
    assert touchpad.tick(1.1) == ()
    (lost,) = touchpad.tick(1.11)
    assert isinstance(lost, FingerLost)
    assert touchpad.fault == lost.why == "no touch report for more than 0.1 s"
    assert touchpad.tick(5.0) == ()
    touchpad.received(touch(MOVE, 300), 6.0)
    assert touchpad.fault is None
    assert touchpad.counts.stale == 1


def test_a_restart_loses_the_finger_and_sets_up_again() -> None:
    touchpad = ready()
    touchpad.received(touch(DOWN, 300, ticks=9000), 1.0)
    lost, send = touchpad.received(BOOT, 1.01)
    assert isinstance(lost, FingerLost)
    assert send == Send(DETECTION_MODE)
    assert touchpad.fault is not None
    assert touchpad.received(touch(DOWN, 300, ticks=0), 1.02) != ()
    assert touchpad.fault is not None
    touchpad.received(MODE_SET + ENABLED, 1.03)
    assert touchpad.fault is None
    assert (touchpad.counts.restarts, touchpad.counts.time_jumps) == (1, 0)


def test_a_jump_of_the_counter_is_counted() -> None:
    touchpad = ready()
    touchpad.received(touch(DOWN, 300, ticks=9000), 1.0)
    (report,) = touchpad.received(touch(MOVE, 300, ticks=50000), 1.01)
    assert isinstance(report, NeonodeReport)
    assert report.sensor_s == pytest.approx(0.01)
    assert touchpad.counts.time_jumps == 1


def test_an_unplugged_sensor_is_asked_for_until_it_is_back() -> None:
    touchpad = ready(Touchpad(reconnect_s=1.0))
    touchpad.received(touch(DOWN, 300), 1.0)
    touchpad.received(touch(DOWN, 300)[:5], 1.0)  # of no use to the next connection
    assert touchpad.disconnected("pulled", 1.1) == (FingerLost("pulled"),)
    assert touchpad.fault == "pulled"
    assert touchpad.received(touch(DOWN, 300), 1.2) == ()
    assert touchpad.tick(2.2) == (Reconnect(),)
    assert touchpad.disconnected("still gone", 2.3) == ()
    assert touchpad.tick(3.0) == ()
    assert touchpad.tick(3.3) == (Reconnect(),)
    ready(touchpad, 3.4)
    assert touchpad.counts.reconnects == 2


def test_unknown_and_damaged_frames_are_counted_not_fatal() -> None:
    touchpad = ready()
    assert touchpad.received(touch_frame([(1, 4, 1, 1)]), 1.0) == ()
    assert touchpad.received(b"\x17\x18" + ENABLED, 1.0) == ()
    assert touchpad.received(touch(DOWN, 300)[:9], 1.0) == ()
    assert touchpad.tick(1.05) == ()
    assert touchpad.tick(1.2) == ()
    assert (touchpad.counts.unknown, touchpad.counts.malformed) == (1, 2)
    assert touchpad.received(touch(DOWN, 300), 1.3) != ()


@pytest.mark.parametrize(
    ("x_along", "y_along", "expected"),
    [
        ("+x", "+y", (101.0, 52.0)),
        ("-x", "+y", (99.0, 52.0)),
        ("+y", "-x", (102.0, 49.0)),
        ("-y", "-x", (98.0, 49.0)),
    ],
)
def test_how_the_sensor_lies_on_the_screen(
    x_along: SensorAxis, y_along: SensorAxis, expected: tuple[float, float]
) -> None:
    frame = ScreenFrame(x_along, y_along, origin_mm=(100.0, 50.0), mm_per_count=0.1)
    assert frame.on_screen_mm(10, 20) == pytest.approx(expected)


@pytest.mark.parametrize(
    "settings", [{"x_along": "+y"}, {"x_along": "x"}, {"mm_per_count": 0.0}]
)
def test_what_is_no_frame(settings: dict[str, object]) -> None:
    with pytest.raises(ConfigError):
        ScreenFrame(**settings)  # type: ignore[arg-type]


events = st.one_of(
    st.just("connect"),
    st.just("disconnect"),
    st.sampled_from([MODE_SET, ENABLED, BOOT]),
    st.binary(max_size=40),
    st.builds(touch, st.sampled_from([DOWN, MOVE, UP]), st.integers(0, 700), st.integers(0, 2)),
)


@given(st.lists(st.tuples(events, st.floats(0.0, 0.3)), max_size=60))
def test_whatever_happens_contact_is_known_or_lost(
    sequence: list[tuple[str | bytes, float]],
) -> None:
    """After a report in contact comes another within `stale_s`, or `FingerLost`, or none."""
    touchpad = Touchpad(stale_s=0.1)
    now_s, contact_s = 0.0, None
    for event, wait_s in sequence:
        actions: tuple[Action, ...]
        if event == "connect":
            actions = touchpad.connected(now_s)
        elif event == "disconnect":
            actions = touchpad.disconnected("gone", now_s)
        else:
            assert isinstance(event, bytes)
            actions = touchpad.received(event, now_s)
        contact_s = latest_contact_s(contact_s, actions)
        now_s += wait_s
        contact_s = latest_contact_s(contact_s, touchpad.tick(now_s))
        assert contact_s is None or now_s <= contact_s + 0.1


def latest_contact_s(contact_s: float | None, actions: tuple[Action, ...]) -> float | None:
    for action in actions:
        if isinstance(action, NeonodeReport):
            contact_s = action.arrival_s if action.in_contact else None
        if isinstance(action, FingerLost):
            contact_s = None
    return contact_s
