"""The course of a recording: extremes where they were, events when they were, no more."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.service.recording.test_export import RATE_HZ, STATUS, UTC_NS, Tape, guided, value

from frictus.keys import Topics
from frictus.messages import Fault, FingerState
from frictus_service.errors import RecordingError
from frictus_service.recording import course
from frictus_service.recording.course import COLUMNS, Course, course_of
from frictus_service.recording.writer import RecordingWriter

Look = Callable[[Callable[[Tape], None], float], Course]


@pytest.fixture
def look(tmp_path: Path, known: Any) -> Look:
    """Write a tape and return its course; its length is what its summary would say."""

    def seen(play: Callable[[Tape], None], length_s: float) -> Course:
        path = tmp_path / "tape.mcap"
        path.unlink(missing_ok=True)
        with RecordingWriter(path, known.info("tape"), {}, lambda: 0.0) as writer:
            play(Tape(writer))
            writer.end("asked for", UTC_NS)
        return course_of(path, length_s)

    return seen


def finger(tape: Tape, vx_mm_s: float, vy_mm_s: float, in_contact: bool = True) -> None:
    tape.say(
        Topics.FINGER,
        FingerState(
            sequence=0,
            sample=tape.sample,
            utc_ns=tape.utc_ns,
            uncertainty_ns=0,
            x_mm=1.0,
            y_mm=1.0,
            vx_mm_s=vx_mm_s,
            vy_mm_s=vy_mm_s,
            normal_force_n=0.4,
            in_contact=in_contact,
            source="simulated",
            age_ms=1.0,
            stale=False,
            extrapolated=False,
        ),
    )


def test_each_column_has_the_extremes_of_its_samples(look: Look) -> None:
    seen = look(lambda tape: tape.play(4.0), 4.0)
    assert seen.column_s == pytest.approx(4.0 / COLUMNS)
    assert seen.ending.startswith("complete: 4.00 s")
    n = int(4.0 * RATE_HZ)
    for name, stream, channel in (
        ("lateral_force", 1, 0),
        ("normal_force", 1, 2),
        ("screen_voltage", 3, 0),
    ):
        columns = value(stream, 0, n)[channel].reshape(COLUMNS, -1)
        # A time stamp is an integer of ns: a sample may fall into the column beside it.
        np.testing.assert_allclose(seen.low[name], columns.min(axis=1), atol=0.03)
        np.testing.assert_allclose(seen.high[name], columns.max(axis=1), atol=0.03)
    assert np.isnan(seen.low["speed"]).all()
    assert seen.events == ()


def test_speed_is_that_of_a_finger_that_touches(look: Look) -> None:
    def play(tape: Tape) -> None:
        tape.play(1.0)
        finger(tape, 30.0, -40.0)
        tape.play(1.0)
        finger(tape, 600.0, 0.0, in_contact=False)
        tape.play(2.0)

    seen = look(play, 4.0)
    known = np.flatnonzero(~np.isnan(seen.high["speed"]))
    assert known.tolist() == [COLUMNS // 4]
    assert seen.low["speed"][known] == seen.high["speed"][known] == 50.0


def test_what_happened_stands_at_its_time_and_what_is_missing_is_no_line(look: Look) -> None:
    fault = Fault(kind="safety", reason="too much force", utc_ns=1, action="look")

    def play(tape: Tape) -> None:
        for state, owner in (("disarmed", None), ("armed", "ann"), ("tripped", None)):
            changes = {"state": state, "owner": owner, "utc_ns": tape.utc_ns}
            told = fault if state == "tripped" else None
            tape.say(Topics.STATUS, STATUS.model_copy(update={**changes, "fault": told}))
            tape.play(1.0)
        tape.lose(200)
        tape.play(1.0)

    seen = look(play, 5.0)
    told = [(round(one.at_s, 2), one.what) for one in seen.events]
    lost = [(3.0, f"200 of {name} are missing: lost") for name in ("force", "accel", "voltage")]
    assert told == [(1.0, "armed by ann"), (2.0, "tripped: too much force"), *lost]
    missing = np.isnan(seen.low["normal_force"])
    assert missing.sum() == pytest.approx(COLUMNS / 5, abs=2)
    assert missing[int(3.1 / seen.column_s) : int(3.9 / seen.column_s)].all()


@pytest.mark.parametrize("step_s", [-3_600, 3_600])
def test_a_clock_that_is_set_moves_nothing(look: Look, step_s: int) -> None:
    def play(tape: Tape) -> None:
        tape.play(2.0)
        tape.utc_ns += step_s * 1_000_000_000
        tape.play(1.0)
        changes = {"state": "armed", "owner": "ann", "utc_ns": tape.utc_ns}
        tape.say(Topics.STATUS, STATUS.model_copy(update=changes))
        tape.play(1.0)

    seen = look(play, 4.0)
    assert not np.isnan(seen.low["normal_force"]).any()
    assert [(round(one.at_s, 2), one.what) for one in seen.events] == [(3.0, "armed by ann")]
    assert seen.ending.startswith("complete")


def test_a_rig_that_began_anew_goes_on_when_it_did(look: Look) -> None:
    def play(tape: Tape) -> None:
        tape.play(1.0)
        tape.restart()
        tape.utc_ns += 2_000_000_000
        tape.play(1.0)

    missing = np.isnan(look(play, 4.0).low["normal_force"])
    assert missing.tolist() == [COLUMNS // 4 <= n < 3 * COLUMNS // 4 for n in range(COLUMNS)]


def test_of_a_long_one_the_beginning_is_shown_and_that_is_said(
    look: Look, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(course, "MOST_S", 2.0)
    seen = look(lambda tape: tape.play(5.0), 5.0)
    assert seen.ending == "the first 2 of 5 s are shown"
    assert not np.isnan(seen.low["normal_force"]).any()
    assert seen.column_s * COLUMNS == pytest.approx(2.0)


def test_trials_that_somebody_was_guided_in_are_counted(look: Look) -> None:
    def play(tape: Tape) -> None:
        for trial in (1, 2, 2, 1):  # the second is recorded again; then another calibration
            guided(tape, trial, (100.0,), 40.0)

    assert look(play, 6.0).guided_trials == 4
    assert look(lambda tape: tape.play(1.0), 1.0).guided_trials == 0


def test_events_are_bounded(look: Look, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(course, "MOST_EVENTS", 4)

    def play(tape: Tape) -> None:
        tape.play(0.1)
        for _ in range(3):
            tape.lose(1)

    seen = look(play, 0.2)
    assert (len(seen.events), seen.left_out) == (4, 5)


def test_what_is_no_recording_is_refused(tmp_path: Path) -> None:
    (tmp_path / "noise.mcap").write_bytes(b"\x07" * 300)
    with pytest.raises(RecordingError):
        course_of(tmp_path / "noise.mcap", 1.0)
