"""The tracker over a study: the law that a rig would have learned live, from its trials."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from tests.service.identification.trials import LAW, STUDY, Made, trial
from typer.testing import CliRunner, Result

from frictus.messages import EstimateState
from frictus.model import FirstOrderSpeedLaw, Model
from frictus_service.calibration import coordinates
from frictus_service.calibration.coordinates import Prior
from frictus_service.cli.app import app
from frictus_service.cli.options import Exit
from frictus_service.errors import EstimateError
from frictus_service.study.reader import StudyReader
from frictus_service.study.trial import Trial
from frictus_service.study.writer import StudyWriter
from frictus_service.tracking.recorded import LEAST_RATE_HZ, _parts_of, follow_study
from frictus_service.tracking.windows import WindowCutter

TONES_HZ = tuple(np.geomspace(60.0, 1_500.0, 12).tolist())
SPEEDS_MM_S = (25.0, 60.0, 95.0)


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory, module_seed: int) -> Path:
    """Two participants, three speeds each, and a trial without drive."""
    rng = np.random.default_rng(module_seed)
    path = tmp_path_factory.mktemp("study") / "study.h5"
    silent = Made(tones_hz=(), noise_n=0.002)
    made = [Made(TONES_HZ, speed, noise_n=0.002) for speed in SPEEDS_MM_S]
    with StudyWriter(path, STUDY) as writer:
        for participant in ("P01", "P02"):
            for order, each in enumerate((*made, silent)):
                one = trial(each, rng)
                info = replace(
                    one.info,
                    id=f"{participant}-{order}",
                    participant=participant,
                    order=order,
                    drive_vpp=150.0 if each.tones_hz else 0.0,
                )
                writer.add(replace(one, info=info))
    return path


def test_each_participant_of_a_study_is_followed(study: Path) -> None:
    told: list[EstimateState] = []
    with StudyReader(study) as reader:
        assert not reader.excluded
        states = follow_study(reader, Prior.weak(), told.append)
    assert list(states) == ["P01", "P02"]
    assert [state.participant for state in told] == ["P01"] * 4 + ["P02"] * 4
    true = coordinates.from_law(LAW.gain_n, LAW.cutoff_0_hz, LAW.slope_hz_per_mm_s, 0.0)
    for state in states.values():
        assert state.refused["a trial without drive, or damaged"] == 1
        assert "samples are missing" not in state.refused
        law = state.law
        assert law is not None
        assert law.gain_n.value == pytest.approx(np.exp(true[2]), rel=0.02)
        for found, at in ((law.cutoff_20_hz, true[0]), (law.cutoff_100_hz, true[1])):
            assert found.value == pytest.approx(np.exp(at), rel=0.1)


@pytest.mark.parametrize("lowest_hz", [60.0, 63.0, 80.0])
def test_of_one_tone_after_the_other_nothing_is_believed_that_is_not_so(
    lowest_hz: float, tmp_path: Path, rng: np.random.Generator
) -> None:
    """Each tells no cutoff: what is left open is not linear in it."""
    with StudyWriter(tmp_path / "study.h5", STUDY) as writer:
        order = 0
        for speed in SPEEDS_MM_S:
            for tone_hz in np.geomspace(lowest_hz, 1_500.0, 9).tolist():
                one = trial(Made((tone_hz,), speed, noise_n=0.002), rng)
                info = replace(one.info, id=f"{order}", order=order, drive_vpp=150.0)
                writer.add(replace(one, info=info))
                order += 1
    with StudyReader(tmp_path / "study.h5") as reader:
        (state,) = follow_study(reader, Prior.weak(), lambda _: None).values()
    true = coordinates.from_law(LAW.gain_n, LAW.cutoff_0_hz, LAW.slope_hz_per_mm_s, 0.0)
    law = state.law
    assert law is not None
    assert state.new_fingers == 0
    assert "unlike what was felt before" not in state.refused
    found = (law.cutoff_20_hz, law.cutoff_100_hz, law.gain_n, law.delay_us)
    for interval, at in zip(found, (*np.exp(true[:3]), true[3]), strict=True):
        half = 0.5 * (interval.high - interval.low)
        assert abs(interval.value - at) < 1.5 * half
    assert law.cutoff_100_hz.value == pytest.approx(np.exp(true[1]), rel=0.1)


def test_trials_at_another_sample_rate_are_left_out_and_counted(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    """The first, too: others were taken to be at its rate, which makes their cutoffs wrong."""
    with StudyWriter(tmp_path / "study.h5", STUDY) as writer:
        for order, speed in enumerate((60.0, *SPEEDS_MM_S, *SPEEDS_MM_S)):
            one = trial(Made(TONES_HZ, speed, noise_n=0.002), rng)
            if order in (0, 6):
                one = _at_half_the_rate(one)
            info = replace(one.info, id=f"{order}", order=order, drive_vpp=150.0)
            writer.add(replace(one, info=info))
    with StudyReader(tmp_path / "study.h5") as reader:
        assert not reader.excluded
        (state,) = follow_study(reader, Prior.weak(), lambda _: None).values()
    assert state.refused["a trial at another sample rate than most of this person's"] == 2
    true = coordinates.from_law(LAW.gain_n, LAW.cutoff_0_hz, LAW.slope_hz_per_mm_s, 0.0)
    assert state.law is not None
    for found, at in ((state.law.cutoff_20_hz, true[0]), (state.law.cutoff_100_hz, true[1])):
        assert found.value == pytest.approx(np.exp(at), rel=0.1)


@pytest.mark.parametrize("rate_hz", [1e-300, 1.0, 50.0, 150.0])
def test_samples_that_are_too_slow_are_refused_in_words(
    rate_hz: float, rng: np.random.Generator
) -> None:
    slow = replace(trial(Made(TONES_HZ, 60.0), rng).info, sample_rate_hz=rate_hz)
    reader = cast(StudyReader, SimpleNamespace(trials=(slow,), info=STUDY))
    with pytest.raises(EstimateError, match=r"do not show how friction follows .* 200 Hz"):
        follow_study(reader, Prior.weak(), lambda _: None)


def test_the_slowest_samples_have_bands() -> None:
    assert WindowCutter(LEAST_RATE_HZ, STUDY.screen_peak_v, STUDY.mount).bands.lines.size


def _at_half_the_rate(one: Trial) -> Trial:
    assert one.voltage_v is not None
    pairs = one.voltage_v.size // 2
    return replace(
        one,
        info=replace(one.info, sample_rate_hz=one.info.sample_rate_hz / 2.0),
        voltage_v=np.sqrt(np.square(one.voltage_v).reshape(pairs, 2).mean(axis=1)),
        force_n=one.force_n.reshape(pairs, 2, 3).mean(axis=1),
        accel_m_s2=None,
        skin_velocity_m_s=None,
    )


def test_a_force_that_is_said_to_be_taken_later_is_no_delay(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    with StudyWriter(tmp_path / "study.h5", STUDY) as writer:
        for order, speed in enumerate(SPEEDS_MM_S):
            one = trial(Made(TONES_HZ, speed, noise_n=0.002), rng)
            info = replace(one.info, id=f"{order}", order=order, drive_vpp=150.0)
            a_sample_later = np.roll(one.force_n, -1, axis=0)
            later = replace(one, info=info, force_n=a_sample_later, force_skew_s=50e-6)
            writer.add(later)
    with StudyReader(tmp_path / "study.h5") as reader:
        (state,) = follow_study(reader, Prior.weak(), lambda _: None).values()
    assert state.law is not None
    assert abs(state.law.delay_us.value) < 3.0


def test_trials_of_the_same_place_in_two_sessions_are_not_joined(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    told: list[EstimateState] = []
    with StudyWriter(tmp_path / "study.h5", STUDY) as writer:
        for session in (1, 2):
            one = trial(Made(TONES_HZ, 60.0, noise_n=0.002), rng)
            info = replace(one.info, id=f"{session}", session=session, drive_vpp=150.0)
            writer.add(replace(one, info=info))
    with StudyReader(tmp_path / "study.h5") as reader:
        follow_study(reader, Prior.weak(), told.append)
    assert told[0].run != told[1].run


def test_the_last_windows_of_a_short_trial_are_used(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    with StudyWriter(tmp_path / "study.h5", STUDY) as writer:
        one = trial(Made(TONES_HZ, 60.0, noise_n=0.002, seconds=1.0), rng)
        writer.add(replace(one, info=replace(one.info, drive_vpp=150.0)))
    with StudyReader(tmp_path / "study.h5") as reader:
        (state,) = follow_study(reader, Prior.weak(), lambda _: None).values()
    assert state.windows + sum(state.refused.values()) == 19
    assert state.windows > 3


def test_a_trial_of_many_reports_is_used_from_its_beginning(rng: np.random.Generator) -> None:
    one = trial(Made(TONES_HZ, 60.0, noise_n=0.002), rng)
    dense = np.arange(0.0, 2.0, 1.0 / 2_000.0)
    place = [np.interp(dense, one.position_t_s, axis) for axis in one.position_mm.T]
    seen = replace(one, position_mm=np.column_stack(place), position_t_s=dense)
    begins = next(_parts_of(seen, 0)).data["render"][2]
    assert np.median(begins) == pytest.approx(60.0, rel=0.1)


@pytest.mark.parametrize(("tones_hz", "said"), [((200.0,), True), (TONES_HZ, False)])
def test_of_single_tones_it_says_who_knows_more(
    tones_hz: tuple[float, ...], said: bool, tmp_path: Path, rng: np.random.Generator
) -> None:
    path = tmp_path / "study.h5"
    with StudyWriter(path, STUDY) as writer:
        writer.add(trial(Made(tones_hz, 60.0, noise_n=0.002), rng))
    told = CliRunner().invoke(app, ["track", str(path)])
    assert told.exit_code == Exit.OK, told.output
    assert ("frictus identify" in told.stderr) == said


def test_a_study_with_a_turned_force_is_not_followed(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    """As identify and discover refuse it: a law of it would be nonsense."""
    path = tmp_path / "study.h5"
    with StudyWriter(path, STUDY) as writer:
        one = trial(Made(TONES_HZ, 60.0, noise_n=0.002), rng)
        writer.add(replace(one, force_n=one.force_n * np.array([-1.0, 1.0, 1.0])))
    told = CliRunner().invoke(app, ["track", str(path)])
    assert told.exit_code == Exit.USAGE
    assert "friction falls when the drive rises" in told.stderr


def test_a_study_has_its_own_mount_and_another_is_refused(study: Path) -> None:
    told = CliRunner().invoke(app, ["track", str(study), "--mount", "none"])
    assert told.exit_code == Exit.USAGE
    assert "says which mount it has" in " ".join(told.stderr.replace("│", "").split())


def test_the_command_writes_the_model_of_the_one_that_is_named(
    study: Path, tmp_path: Path
) -> None:
    out = tmp_path / "P02.json"

    def run(*more: str) -> Result:
        return CliRunner().invoke(app, ["track", str(study), "--out", str(out), *more])

    unnamed = run()
    assert unnamed.exit_code == Exit.CHECK_FAILED
    assert "P01, P02: name one with --participant" in unnamed.stderr
    assert not out.exists()
    assert '"participant":"P01"' not in unnamed.stdout  # nobody was followed for nothing
    named = run("--participant", "P02", "--json")
    assert named.exit_code == Exit.OK
    assert '"participant":"P01"' not in named.stdout
    model = Model.model_validate_json(out.read_bytes())
    assert (model.participant, model.provenance["source"]) == ("P02", "live")
    assert isinstance(model.base, FirstOrderSpeedLaw)
    assert model.base.gain_n == pytest.approx(LAW.gain_n, rel=0.02)
