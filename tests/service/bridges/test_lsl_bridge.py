"""A bridge between a real router and real LSL streams; the rig says what a test chooses."""

import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

import frictus
from frictus.keys import Topics
from frictus.messages import AuxChannel, FingerState, MarkerState
from frictus_service.bridges.lsl import BridgeReport, LslBridge
from frictus_service.bridges.lsl_outlets import channels_of

BLOCK = 100


def until(bridge: LslBridge, holds: Callable[[BridgeReport], bool]) -> None:
    """Turn a bridge until its report is as expected."""
    deadline_s = time.monotonic() + 20.0
    while not holds(bridge.report()):
        bridge.turn()
        assert time.monotonic() < deadline_s, f"in 20 s no more than {bridge.report()}"


@pytest.fixture
def bridge(lsl: Any, hand: Any, client: frictus.Client) -> Iterator[LslBridge]:
    with LslBridge(client, client.rig("hand"), ["force", "finger"]) as bridge:
        until(bridge, lambda report: report.markers_sent >= 3)
        yield bridge


def finger(hand: Any, sequence: int, **changes: Any) -> FingerState:
    fields: dict[str, Any] = {
        "sequence": sequence,
        "sample": sequence * BLOCK,
        "utc_ns": hand.utc_ns(sequence * BLOCK),
        "uncertainty_ns": 1_000,
        "x_mm": float(sequence),
        "y_mm": 30.0,
        "vx_mm_s": 60.0,
        "vy_mm_s": 0.0,
        "normal_force_n": 0.5,
        "in_contact": True,
        "source": "simulated",
        "age_ms": 20.0,
        "stale": False,
        "extrapolated": False,
    }
    return FingerState(**(fields | changes))


def test_streams_say_what_they_are(bridge: LslBridge, inlet: Any) -> None:
    info = inlet("hand-force").info(20.0)
    assert (info.type(), info.channel_count(), info.nominal_srate()) == ("Force", 3, 20_000.0)
    assert info.source_id() == "frictus/lab/hand/force"
    channel = info.desc().child("channels").child("channel")
    labels = []
    while not channel.empty():
        labels.append([channel.child_value(key) for key in ("label", "unit", "type")])
        channel = channel.next_sibling("channel")
    assert labels == [[axis, "N", "Force"] for axis in "xyz"]
    assert info.desc().child("synchronization").child_value("can_drop_samples") == "false"
    assert inlet("hand-finger").info(20.0).nominal_srate() == 200.0
    assert inlet("hand-markers").info(20.0).type() == "Markers"


def test_channels_have_labels_and_units(hand: Any) -> None:
    status = hand.status(aux=(AuxChannel(name="thermo", unit="degC"),))
    assert channels_of("aux", status) == (("thermo", "degC"),)
    assert channels_of("aux", hand.status()) == ()
    assert channels_of("voltage", status) == (("monitor", "V"),)
    assert channels_of("render", status)[3:] == (
        ("target", "N"),
        ("drive", ""),
        ("sensors", ""),
    )


def test_samples_come_as_they_are_with_their_time(
    bridge: LslBridge, hand: Any, inlet: Any, pull: Any
) -> None:
    stream = inlet("hand-force")
    sent = [hand.force(1, sequence) for sequence in range(50)]
    until(bridge, lambda report: report.sent["force"] == 50 * BLOCK)
    rows, stamps = pull(stream, 50 * BLOCK)
    assert np.array_equal(rows.T, np.concatenate(sent, axis=1))
    assert np.all(np.diff(stamps) > 0.0)
    import pylsl

    ahead_s = 1e-9 * time.time_ns() - pylsl.local_clock()
    due_s = 1e-9 * hand.began_ns - ahead_s + np.arange(50 * BLOCK) / 20_000.0
    assert np.max(np.abs(stamps - due_s)) < 1e-3


def test_a_loss_is_nan_and_a_marker_and_a_long_one_a_jump(
    bridge: LslBridge, hand: Any, inlet: Any, pull: Any
) -> None:
    stream, markers = inlet("hand-force"), inlet("hand-markers")
    for sequence in (0, 1, 4, 500, 501):
        hand.force(1, sequence)
    until(bridge, lambda report: report.sent["force"] == 5 * BLOCK)
    rows, stamps = pull(stream, 7 * BLOCK)
    lost = np.isnan(rows).all(axis=1)
    assert np.array_equal(np.flatnonzero(lost), np.arange(2 * BLOCK, 4 * BLOCK))
    steps = np.diff(stamps)
    assert np.all(steps > 0.0)
    long = steps > 1.0
    assert np.flatnonzero(long).tolist() == [5 * BLOCK - 1]
    assert np.allclose(steps[~long], 5e-5, rtol=0.01)
    told, at_s = pull(markers, 2)
    assert [text.decode() for text in told.ravel()] == [
        "gap force 200 lost",
        "gap force 49500 lost",
    ]
    assert at_s[0] == pytest.approx(stamps[2 * BLOCK], abs=1e-4), "it stands where it was lost"
    assert bridge.report().filled == {"force": 2 * BLOCK, "finger": 0}


def test_a_rig_that_starts_anew_goes_on_in_time(
    bridge: LslBridge, hand: Any, inlet: Any, pull: Any
) -> None:
    stream, markers = inlet("hand-force"), inlet("hand-markers")
    hand.force(1, 0)
    hand.force(1, 1)
    hand.began_ns += 2_000_000_000
    hand.force(2, 0)
    hand.say(Topics.TIME, hand.fit(2, 0))
    hand.say(Topics.STATUS, hand.status(run=2))
    hand.force(2, 1)
    until(bridge, lambda report: report.sent["force"] == 4 * BLOCK)
    until(bridge, lambda report: report.markers_sent >= 5)
    _, stamps = pull(stream, 4 * BLOCK)
    steps = np.diff(stamps)
    assert np.all(steps > 0.0)
    assert steps.max() == pytest.approx(2.0 - 2 * BLOCK / 20_000.0, abs=1e-3)
    told, _ = pull(markers, 2)
    assert {text.decode().split()[0] for text in told.ravel()} == {"gap", "run"}


def test_the_finger_is_sent_and_what_is_of_another_run_is_not(
    bridge: LslBridge, hand: Any, inlet: Any, pull: Any
) -> None:
    stream = inlet("hand-finger")
    for sequence in (0, 1, 3):
        hand.say(Topics.FINGER, finger(hand, sequence))
    hand.say(Topics.FINGER, finger(hand, 0, utc_ns=hand.utc_ns(0) + 10**10))
    until(bridge, lambda report: report.sent["finger"] == 3 and report.refused == 1)
    rows, stamps = pull(stream, 4)
    assert np.array_equal(rows[[0, 1, 3], 0], [0.0, 1.0, 3.0])
    assert np.all(np.isnan(rows[2]))
    assert np.allclose(rows[3], [3.0, 30.0, 60.0, 0.0, 0.5, 1.0])
    assert np.allclose(np.diff(stamps), 5e-3, atol=1e-6)


@pytest.mark.parametrize(
    "changes",
    [
        {"data": np.zeros((2, BLOCK), np.float32)},
        {"sample_rate_hz": 10_000.0},
        {"first_sample": 2**63},
        {"first_sample": 20_000 * 90_000},
    ],
)
def test_a_block_that_does_not_fit_costs_itself_alone(
    bridge: LslBridge, hand: Any, inlet: Any, pull: Any, changes: dict[str, Any]
) -> None:
    stream = inlet("hand-force")
    hand.force(1, 0)
    hand.force(1, 1, **changes)
    hand.force(1, 2)
    until(bridge, lambda report: report.sent["force"] == 2 * BLOCK)
    assert bridge.report().refused == ("first_sample" not in changes)  # that never came so far
    _, stamps = pull(stream, 3 * BLOCK)
    assert np.all(np.diff(stamps) > 0.0)


@pytest.mark.parametrize("changes", [{"ns_per_sample": -1e308}, {"ns_per_sample": 1e308}])
def test_a_fit_that_no_clock_has_costs_itself_alone(
    bridge: LslBridge, hand: Any, changes: dict[str, Any]
) -> None:
    hand.say(Topics.TIME, hand.fit(1, 0).model_copy(update=changes))
    hand.say(Topics.STATUS, hand.status(run=2))  # on the way after it
    until(bridge, lambda report: report.markers_sent >= 4)
    hand.say(Topics.FINGER, finger(hand, 3))
    until(bridge, lambda report: report.sent["finger"] == 1)


def say_runs_that_no_rig_had(hand: Any, stream: int = 1) -> None:
    """Say blocks of runs above the rig's, enough of each to be believed."""
    for run in (2**32 - 2, 2**32 - 1):
        for sequence in (0, 1):
            hand.force(run, sequence, stream=stream)


def test_runs_that_no_rig_had_cost_the_finger_nothing(bridge: LslBridge, hand: Any) -> None:
    say_runs_that_no_rig_had(hand)
    until(bridge, lambda report: report.sent["force"] == 4 * BLOCK)
    hand.say(Topics.FINGER, finger(hand, 3))
    until(bridge, lambda report: report.sent["finger"] == 1)


def test_runs_above_that_of_the_rig_do_not_mute_it(
    bridge: LslBridge, hand: Any, inlet: Any, pull: Any
) -> None:
    stream = inlet("hand-force")
    hand.force(1, 0)
    say_runs_that_no_rig_had(hand)
    for sequence in (1, 2):
        hand.force(1, sequence)
    until(bridge, lambda report: report.sent["force"] == 7 * BLOCK)
    rows, stamps = pull(stream, 7 * BLOCK)
    assert np.all(np.diff(stamps) > 0.0)
    assert np.array_equal(rows[-2 * BLOCK :, 0], np.arange(BLOCK, 3 * BLOCK))


def test_counts_far_ahead_of_the_rig_do_not_mute_it(
    bridge: LslBridge, hand: Any, inlet: Any, pull: Any
) -> None:
    force, fingers = inlet("hand-force"), inlet("hand-finger")
    for sequence in (0, 50_000, 50_001, 1, 2):  # two in a row are believed
        hand.force(1, sequence)
    hand.say(Topics.FINGER, finger(hand, 0))
    hand.say(Topics.FINGER, finger(hand, 1).model_copy(update={"sequence": 2**40}))
    hand.say(Topics.FINGER, finger(hand, 2))
    until(bridge, lambda report: report.sent == {"force": 5 * BLOCK, "finger": 3})
    rows, stamps = pull(force, 5 * BLOCK)
    assert np.array_equal(rows[3 * BLOCK :, 0], np.arange(BLOCK, 3 * BLOCK))
    assert stamps[-1] - stamps[0] == pytest.approx((3 * BLOCK - 1) / 20_000.0, abs=1e-3)
    rows, _ = pull(fingers, 3)
    assert rows[:, 0].tolist() == [0.0, 1.0, 2.0]


def test_runs_that_no_rig_had_cost_a_gap_of_another_stream_nothing(
    lsl: Any, hand: Any, client: frictus.Client
) -> None:
    with LslBridge(client, client.rig("hand"), ["force", "accel"]) as bridge:
        until(bridge, lambda report: report.markers_sent >= 3)
        hand.force(1, 0)
        until(bridge, lambda report: report.sent["force"] == BLOCK)
        say_runs_that_no_rig_had(hand, stream=2)
        until(bridge, lambda report: report.sent["accel"] == 4 * BLOCK)
        before = bridge.report().markers_sent
        hand.force(1, 3)
        until(bridge, lambda report: report.sent["force"] == 2 * BLOCK)
        assert bridge.report().markers_sent > before


def test_markers_of_others_are_published_with_their_time(
    lsl: Any, hand: Any, client: frictus.Client
) -> None:
    import pylsl

    info = pylsl.StreamInfo("psychopy", "Markers", 1, 0.0, "string", "psychopy-1")
    outlet = pylsl.StreamOutlet(info)
    rig = client.rig("hand")
    with (
        rig.watch(Topics.MARKER, timeout_s=20.0) as heard,
        LslBridge(client, rig, [], inlet="psychopy") as bridge,
    ):
        assert outlet.wait_for_consumers(20.0)
        said_ns = time.time_ns()
        for text in (b"trial 1", b"\xff" + 2_000 * b"x"):
            outlet.push_sample([text])
        first, second = next(heard), next(heard)
        assert isinstance(first, MarkerState)
        assert isinstance(second, MarkerState)
        assert (first.source, first.text) == ("lsl: psychopy", "trial 1")
        assert abs(first.utc_ns - said_ns) < 5_000_000
        assert len(second.text) == 1_000
        outlet.push_sample(["never"], float("inf"))
        outlet.push_sample(["after"])
        third = next(heard)
        assert isinstance(third, MarkerState)
        assert third.text == "after"
        until(bridge, lambda report: report.markers_received == 3)
