"""Recordings become studies: guided trials, a declared one, and what is left out."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from tests.rig_status import rig_status

from frictus.block import Block, Flag
from frictus.keys import Topic, Topics
from frictus.messages import (
    Applied,
    Excitation,
    GuidanceState,
    SceneState,
    Tone,
    TouchState,
)
from frictus.textures import Scene
from frictus_hardware.physics.linear import Mount
from frictus_service.errors import ExportError
from frictus_service.recording import export as recording_export
from frictus_service.recording.export import Exported, export_study
from frictus_service.recording.records import GapNote
from frictus_service.recording.segments import TrialDeclaration
from frictus_service.recording.writer import RecordingWriter
from frictus_service.study.reader import StudyReader
from frictus_service.study.trial import Trial

RATE_HZ = 2_000.0
BLOCK = 10
UTC_NS = 1_795_000_000_000_000_000
CHANNELS = {1: 3, 2: 3, 3: 1}
APPLIED = Applied(
    gain=1.0,
    feasible_gain=1.0,
    bias=0.5,
    bias_n=0.1,
    scaled=False,
    speed_range_mm_s=(0.0, 100.0),
)
WHOLE = TrialDeclaration("p1", 2, 60.0, 0.4, (100.0,))
UNDECLARED = TrialDeclaration()
STATUS = rig_status(
    utc_ns=UTC_NS,
    sample_rate_hz=RATE_HZ,
    block_samples=BLOCK,
    screen_mm=(70.0, 35.0),
    screen_peak_v=60.0,
    model_placeholder=True,
)


def value(stream: int, first: int, n: int) -> NDArray[np.float32]:
    index = np.arange(first, first + n)
    rows = [np.sin(0.01 * index * (channel + stream)) for channel in range(CHANNELS[stream])]
    return np.array(rows, dtype=np.float32)


class Tape:
    """Writes a recording by the second of its own clock."""

    def __init__(self, writer: RecordingWriter) -> None:
        self._writer = writer
        self.run = 1
        self.sample = 0
        self.sequence = 0
        self.utc_ns = UTC_NS
        self.rate_hz = RATE_HZ

    def play(self, seconds: float) -> None:
        """Publish all streams and 100 touch reports a second."""
        for _ in range(round(seconds * self.rate_hz / BLOCK)):
            for stream in CHANNELS:
                self._writer.block(
                    Block(
                        stream,
                        self.run,
                        self.sequence,
                        self.sample,
                        self.utc_ns,
                        100,
                        self.rate_hz,
                        Flag.SIMULATED,
                        value(stream, self.sample, BLOCK),
                    )
                )
            if self.sequence % 2 == 0:
                self.say(Topics.TOUCH, self._touch())
            self._advance()

    def _touch(self) -> TouchState:
        return TouchState(
            run=self.run,
            sample=self.sample - 5.5,
            x_mm=0.01 * self.sample,
            y_mm=10.0,
            in_contact=True,
            source="simulated",
        )

    def _advance(self, blocks: int = 1) -> None:
        self.sample += blocks * BLOCK
        self.sequence += blocks
        self.utc_ns += round(1e9 * blocks * BLOCK / self.rate_hz)

    def lose(self, blocks: int) -> None:
        """Lose blocks of every stream."""
        for stream in ("force", "accel", "voltage"):
            self._writer.gap(
                GapNote(
                    utc_ns=self.utc_ns,
                    stream=stream,
                    run=self.run,
                    first_missing_sequence=self.sequence,
                    missing_blocks=blocks,
                    missing_samples=blocks * BLOCK,
                    reason="lost",
                )
            )
        self._advance(blocks)

    def restart(self) -> None:
        """Begin a new run."""
        self.run, self.sample, self.sequence = self.run + 1, 0, 0

    def say(self, topic: Topic, message: Any) -> None:
        self._writer.state(topic, message.to_json(), self.utc_ns)

    def excite(self, *tones_hz: float) -> None:
        tones = [Tone(hz=hz, amplitude=0.1) for hz in tones_hz]
        self.say(
            Topics.SCENE,
            SceneState(
                etag="e",
                scene=Scene(),
                applied=APPLIED,
                source="excitation",
                excitation=Excitation(tones=tones),
            ),
        )

    def guide(self, phase: Any, trial: int, speed_mm_s: float = 60.0) -> None:
        self.say(
            Topics.GUIDANCE,
            GuidanceState(
                utc_ns=self.utc_ns,
                participant="p3",
                phase=phase,
                trial=trial,
                seconds_left=1.0,
                target_speed_mm_s=speed_mm_s,
                target_force_n=0.5,
                reference_x_mm=1.0,
                span_mm=(5.0, 65.0),
            ),
        )


Export = Callable[..., Exported]


@pytest.fixture
def export(tmp_path: Path, known: Any) -> Export:
    """Write a tape, export it, and return what came of it; the study is `study.h5`."""

    def make(play: Callable[[Tape], None], declared: TrialDeclaration = UNDECLARED) -> Exported:
        path = tmp_path / "tape.mcap"
        path.unlink(missing_ok=True)
        attached = {"status.json": STATUS.to_json()}
        with RecordingWriter(path, known.info("tape"), attached, lambda: 0.0) as writer:
            play(Tape(writer))
            writer.end("asked for", UTC_NS)
        return export_study(path, tmp_path / "study.h5", declared, Mount().lateral)

    return make


def trials_of(folder: Path) -> list[Trial]:
    with StudyReader(folder / "study.h5") as study:
        assert study.excluded == ()
        return [study.read(info.id) for info in study.trials]


def test_declared_trial_holds_every_sample(export: Export, tmp_path: Path) -> None:
    done = export(lambda tape: tape.play(3.0), WHOLE)
    assert done.excluded == ()
    assert done.ending.complete
    (trial,) = trials_of(tmp_path)
    assert trial.force_n == pytest.approx(value(1, 0, 6_000).T)
    assert trial.accel_m_s2 == pytest.approx(value(2, 0, 6_000).T)
    assert trial.voltage_v == pytest.approx(value(3, 0, 6_000)[0])
    assert trial.voltage_source == "monitor"
    assert trial.position_t_s[:3] == pytest.approx((np.array([0, 20, 40]) - 5.5) / RATE_HZ)
    assert trial.position_mm[:3, 0] == pytest.approx([0.0, 0.2, 0.4])
    info = trial.info
    assert (info.participant, info.session, info.speed_mm_s) == ("p1", 2, 60.0)
    assert (info.force_n, info.tones_hz) == (0.4, (100.0,))
    assert info.drive_vpp == pytest.approx(np.ptp(value(3, 0, 6_000)), abs=1e-3)
    assert info.started_utc.startswith("2026-")
    with StudyReader(tmp_path / "study.h5") as study:
        assert study.info.screen_peak_v == 60.0
        assert study.info.mount is not None


def test_part_of_a_recording(export: Export, tmp_path: Path) -> None:
    export(lambda tape: tape.play(3.0), TrialDeclaration("p", 1, 60.0, 0.4, (), 1.0, 2.0))
    (trial,) = trials_of(tmp_path)
    assert trial.force_n == pytest.approx(value(1, 2_000, 2_000).T)
    assert trial.info.tones_hz == ()
    assert trial.info.drive_vpp == 0.0


def test_lost_samples_are_missing_not_made_up(export: Export, tmp_path: Path) -> None:
    def play(tape: Tape) -> None:
        tape.play(1.0)
        tape.lose(7)
        tape.play(2.0)

    export(play, WHOLE)
    (trial,) = trials_of(tmp_path)
    missing = np.isnan(trial.force_n[:, 0])
    assert np.flatnonzero(missing).tolist() == list(range(2_000, 2_070))
    whole = value(1, 0, trial.force_n.shape[0]).T
    assert trial.force_n[~missing] == pytest.approx(whole[~missing])


def test_a_texture_is_no_blank_trial(export: Export, tmp_path: Path) -> None:
    export(lambda tape: tape.play(3.0), TrialDeclaration("p", 1, 60.0, 0.4, texture=True))
    (trial,) = trials_of(tmp_path)
    assert trial.info.tones_hz == ()
    assert trial.info.drive_vpp == pytest.approx(np.ptp(value(3, 0, 6_000)), abs=1e-3)
    assert trial.voltage_v == pytest.approx(value(3, 0, 6_000)[0])


@pytest.mark.parametrize(
    ("declared", "words"),
    [
        (TrialDeclaration(), "--participant, --speed, --force, --tone"),
        (TrialDeclaration("p", 1, 60.0, 0.4), "--tone"),
        (TrialDeclaration("p", 1, 60.0, 0.4, (), 5.0), "no samples"),
    ],
)
def test_what_has_to_be_said(
    export: Export, tmp_path: Path, declared: TrialDeclaration, words: str
) -> None:
    with pytest.raises(ExportError, match=words):
        export(lambda tape: tape.play(1.0), declared)
    assert not (tmp_path / "study.h5").exists()


def test_a_trial_is_of_one_run(export: Export, tmp_path: Path) -> None:
    def play(tape: Tape) -> None:
        tape.play(1.0)
        tape.restart()
        tape.play(2.0)

    with pytest.raises(ExportError, match="started anew"):
        export(play, WHOLE)
    export(play, TrialDeclaration("p", 1, 60.0, 0.4, (), 1.5))
    (trial,) = trials_of(tmp_path)
    assert trial.force_n == pytest.approx(value(1, 1_000, 3_000).T)


@pytest.mark.parametrize("part", [(float("inf"), None), (0.0, float("nan")), (-1.0, 1.0)])
def test_a_part_of_no_time_is_refused(
    export: Export, part: tuple[float | None, float | None]
) -> None:
    with pytest.raises(ExportError, match="a part begins and ends at 0 to"):
        export(lambda tape: tape.play(1.0), TrialDeclaration("p", 1, 60.0, 0.4, (), *part))


def test_a_trial_has_the_rate_of_its_own_run(export: Export, tmp_path: Path) -> None:
    def play(tape: Tape) -> None:
        tape.play(1.0)
        tape.restart()
        tape.rate_hz = 2.0 * RATE_HZ
        tape.play(2.0)

    export(play, TrialDeclaration("p", 1, 60.0, 0.4, (), 1.5))
    (trial,) = trials_of(tmp_path)
    assert trial.info.sample_rate_hz == 2.0 * RATE_HZ
    assert trial.force_n == pytest.approx(value(1, 2_000, 6_000).T)


@pytest.mark.parametrize("step_s", [-3_600, -1, 3_600])
def test_a_clock_that_is_set_cuts_nothing_elsewhere(
    export: Export, tmp_path: Path, step_s: int
) -> None:
    def play(tape: Tape) -> None:
        guided(tape, 1, (100.0,), 40.0)
        tape.utc_ns += step_s * 1_000_000_000
        guided(tape, 2, (100.0,), 60.0)

    assert export(play).excluded == ()
    for number, trial in enumerate(trials_of(tmp_path)):
        first = round((0.3 + 1.4 * number) * RATE_HZ)
        assert trial.force_n == pytest.approx(value(1, first, 2_000).T)

    def unguided(tape: Tape) -> None:
        tape.play(1.0)
        tape.utc_ns += step_s * 1_000_000_000
        tape.play(2.0)

    (tmp_path / "study.h5").unlink()
    export(unguided, TrialDeclaration("p", 1, 60.0, 0.4, (), 0.5, 2.5))
    (trial,) = trials_of(tmp_path)
    assert trial.force_n == pytest.approx(value(1, 1_000, 4_000).T)


def guided(tape: Tape, trial: int, tones_hz: tuple[float, ...], speed_mm_s: float) -> None:
    tape.excite(*tones_hz)
    for phase, seconds in (("approach", 0.3), ("record", 1.0), ("analyse", 0.1)):
        for _ in range(round(10 * seconds)):
            tape.guide(phase, trial, speed_mm_s)
            tape.play(0.1)


def test_guided_trials(export: Export, tmp_path: Path) -> None:
    def play(tape: Tape) -> None:
        for trial, (tones, speed) in enumerate(
            (((100.0,), 40.0), ((50.0, 75.0), 80.0), ((), 20.0))
        ):
            guided(tape, trial + 1, tones, speed)
        tape.guide("done", 3)

    done = export(play, TrialDeclaration(session=4))
    assert done.excluded == ()
    trials = trials_of(tmp_path)
    assert [trial.info.order for trial in trials] == [0, 1, 2]
    assert [trial.info.speed_mm_s for trial in trials] == [40.0, 80.0, 20.0]
    assert [trial.info.tones_hz for trial in trials] == [(100.0,), (50.0, 75.0), ()]
    assert {(trial.info.participant, trial.info.session) for trial in trials} == {("p3", 4)}
    for number, trial in enumerate(trials):
        first = round((0.3 + 1.4 * number) * RATE_HZ)
        assert trial.force_n == pytest.approx(value(1, first, 2_000).T)


def test_what_was_driven_is_no_blank_trial(
    export: Export, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recording_export, "MOST_BLANK_SWING_V", 0.01)

    def play(tape: Tape) -> None:
        guided(tape, 1, (100.0,), 40.0)
        guided(tape, 2, (), 40.0)

    done = export(play, TrialDeclaration())
    (left_out,) = done.excluded
    assert left_out.field == "tone_hz"
    assert re.search(r"driven with \d+ V peak to peak: a blank trial", left_out.reason)
    assert [trial.info.order for trial in trials_of(tmp_path)] == [0]


def test_a_blank_trial_that_was_driven_is_told_with_what_is_wrong(
    export: Export, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recording_export, "MOST_BLANK_SWING_V", 0.01)
    with pytest.raises(ExportError, match="t0000, tone_hz: is 0, but the screen was driven"):
        export(lambda tape: guided(tape, 1, (), 40.0), TrialDeclaration())


def test_guided_trials_that_cannot_be_used_are_named(export: Export, tmp_path: Path) -> None:
    def play(tape: Tape) -> None:
        guided(tape, 1, (100.0,), 40.0)
        tape.guide("record", 2)
        tape.play(0.5)
        tape.restart()
        tape.play(0.5)
        tape.guide("record", 3)
        tape.play(0.5)
        tape.lose(50)
        tape.play(0.5)
        tape.guide("break", 4)

    done = export(play)
    assert done.trials == ("t0000",)
    assert [(one.trial, one.field) for one in done.excluded] == [
        ("t0001", "guidance"),
        ("t0002", "samples"),
    ]
    assert "started anew" in done.excluded[0].reason
    assert len(trials_of(tmp_path)) == 1
