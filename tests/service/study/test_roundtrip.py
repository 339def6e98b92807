"""What is written is what is read, bit for bit, and nothing is held that is not asked for."""

import tracemalloc
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from tests.full_disk import full_after

from frictus_service.errors import Exclusion, NotWrittenError, StudyError
from frictus_service.study.importers import open_study, read_all
from frictus_service.study.layout import ConverterStep, digest, duplicates
from frictus_service.study.reader import StudyReader
from frictus_service.study.trial import StudyInfo, Trial
from frictus_service.study.writer import StudyWriter

MakeTrial = Callable[..., Trial]
WriteStudy = Callable[..., Path]
ROOT = Path(__file__).parents[3]
FOREIGN = ROOT.parent / "shared" / "data" / "study_example" / "study.h5"
DATA = (
    "voltage_v",
    "force_n",
    "accel_m_s2",
    "skin_velocity_m_s",
    "position_mm",
    "position_t_s",
)
NO_VOLTAGE = {"voltage_v": None, "voltage_source": "command"}
STEPS = {
    "voltage_v": ConverterStep(0.0025),
    "force_n": ConverterStep((0.0004, 0.0005, 0.0006), (0.1, 0.0, -0.2)),
    "accel_m_s2": ConverterStep(0.01, -3.0),
}


def assert_same(read: Trial, written: Trial) -> None:
    assert read.info == written.info
    assert read.voltage_source == written.voltage_source
    assert (read.force_skew_s, read.skin_skew_s) == (written.force_skew_s, written.skin_skew_s)
    for name in DATA:
        was, found = getattr(written, name), getattr(read, name)
        assert (found is None) == (was is None), name
        if was is not None:
            assert found.dtype == np.float64
            np.testing.assert_array_equal(found, was, err_msg=name)


def test_a_study_that_came_meanwhile_is_not_replaced(
    tmp_path: Path, make_trial: MakeTrial
) -> None:
    path = tmp_path / "visit.h5"
    writer = StudyWriter(path, StudyInfo(rig="rig1", mount=None))
    writer.add(make_trial())
    with StudyWriter(path, StudyInfo(rig="rig2", mount=None)):  # of two at once, the first
        pass
    first = path.read_bytes()
    with pytest.raises(StudyError, match=r"visit\.h5 exists; choose another name"):
        writer.close()
    assert path.read_bytes() == first
    assert list(tmp_path.iterdir()) == [path]


def test_every_kind_of_trial_comes_back_exactly(
    make_trial: MakeTrial, write_study: WriteStudy, rng: np.random.Generator
) -> None:
    gap = rng.normal(0.4, 0.05, (400, 3))
    gap[40:90, 1] = np.nan
    short = rng.normal(0.0, 9.0, (400, 3)).astype(np.float32).astype(np.float64)
    trials = [
        make_trial("plain"),
        make_trial("gap", force_n=gap),
        make_trial("float32", accel_m_s2=short, voltage_source="command"),
        make_trial("skin", accel_m_s2=None, skin_velocity_m_s=rng.normal(0.0, 0.1, 400)),
        make_trial("blank", tones_hz=(), drive_vpp=0.0, **NO_VOLTAGE),
        make_trial("chord", tones_hz=(70.0, 130.0, 990.0), participant="Zoë-1"),
        make_trial("still", speed_mm_s=0.0),
        make_trial("long", n_samples=3001),
    ]
    with StudyReader(write_study(*trials)) as study:
        assert study.excluded == ()
        assert {info.id for info in study.trials} == {trial.info.id for trial in trials}
        for trial in trials:
            read = study.read(trial.info.id)
            assert_same(read, trial)
            assert read.sha256 == digest(trial) == digest(read)
            assert study.n_samples(trial.info.id) == len(trial.force_n)


def test_the_root_comes_back(make_trial: MakeTrial, write_study: WriteStudy) -> None:
    info = StudyInfo("r", 6500.0, 60.0, extras={"lab": "nord", "n": 3, "humidity": 0.4})
    with StudyReader(write_study(make_trial(), info=info)) as study:
        assert study.info == info
    document = '{"lateral": {"numerator": [2], "denominator": [0.01, 2], "dc": 1}, "y": {}}'
    info = replace(info, mount_json=document)
    with StudyReader(write_study(make_trial(), info=info, name="mount.h5")) as study:
        assert study.info.mount_json == document
        assert study.info.mount is not None
        assert study.info.mount.denominator == (0.01, 2.0)


def test_counts_of_a_converter_come_back_exactly_and_take_a_quarter(
    make_trial: MakeTrial, tmp_path: Path, rng: np.random.Generator
) -> None:
    counts = {
        "voltage_v": rng.integers(-30_000, 30_000, 20_000),
        "force_n": rng.integers(-2000, 2000, (20_000, 3)),
        "accel_m_s2": rng.integers(-32_768, 32_768, (20_000, 3)),
    }
    values: dict[str, Any] = {name: STEPS[name].values(raw) for name, raw in counts.items()}
    trial = make_trial(n_samples=20_000, **values)
    for name, steps in (("counts.h5", STEPS), ("floats.h5", {})):
        with StudyWriter(tmp_path / name, StudyInfo("r")) as writer:
            assert writer.add(trial, steps) == digest(trial)
        with StudyReader(tmp_path / name) as study:
            assert_same(study.read("a"), trial)
    with h5py.File(tmp_path / "counts.h5") as file:
        for name, raw in counts.items():
            assert file[f"trials/a/{name}"].dtype == np.int16
            np.testing.assert_array_equal(file[f"trials/a/{name}"][()], raw)
    sizes = [(tmp_path / name).stat().st_size for name in ("counts.h5", "floats.h5")]
    assert sizes[0] < 0.3 * sizes[1]


def test_between_two_counts_the_nearest_is_stored_and_hashed(
    make_trial: MakeTrial, tmp_path: Path
) -> None:
    trial = make_trial()
    with StudyWriter(tmp_path / "s.h5", StudyInfo("r")) as writer:
        sha256 = writer.add(trial, STEPS)
    with StudyReader(tmp_path / "s.h5") as study:
        read = study.read("a")
    assert read.sha256 == sha256 != digest(trial)
    assert trial.voltage_v is not None
    assert read.voltage_v is not None
    assert np.max(np.abs(read.voltage_v - trial.voltage_v)) <= 0.00125 * (1 + 1e-9)


def test_missing_samples_survive_a_step(make_trial: MakeTrial, tmp_path: Path) -> None:
    trial = make_trial()
    trial.force_n[7] = np.nan
    with StudyWriter(tmp_path / "s.h5", StudyInfo("r")) as writer:
        writer.add(trial, {"force_n": ConverterStep(0.0005)})
    with StudyReader(tmp_path / "s.h5") as study:
        np.testing.assert_array_equal(study.read("a").force_n, trial.force_n)


def test_trials_are_listed_by_participant_session_and_order(
    make_trial: MakeTrial, write_study: WriteStudy, rng: np.random.Generator
) -> None:
    places = [(who, session, order) for who in "ab" for session in (0, 2) for order in (0, 9)]
    trials = [
        make_trial(f"{rng.integers(1 << 40):x}", participant=who, session=session, order=order)
        for who, session, order in places
    ]
    shuffled = [trials[index] for index in rng.permutation(len(trials))]
    with StudyReader(write_study(*shuffled)) as study:
        listed = [(info.participant, info.session, info.order) for info in study.trials]
    assert listed == places


def test_the_hash_is_of_the_content(
    make_trial: MakeTrial, tmp_path: Path, write_study: WriteStudy, rng: np.random.Generator
) -> None:
    trial = make_trial()
    renamed = replace(trial, info=replace(trial.info, id="other"))
    assert digest(renamed) == digest(trial)
    path = write_study(trial)
    with h5py.File(path, "r+") as file:  # as another program stores it
        group = file["trials/a"]
        voltage = group["voltage_v"][()]
        source = group["voltage_v"].attrs["source"]
        del group["voltage_v"]
        packed = group.create_dataset("voltage_v", data=voltage[None], compression="gzip")
        packed.attrs["source"] = source
        group.attrs["session"] = 0.0
        file.move("trials/a", "trials/b")
    with StudyReader(path) as study:
        assert study.read("b").sha256 == digest(trial)
    others = [trial]
    for name in DATA:
        values = getattr(trial, name)
        if values is not None:
            changed = values.copy()
            at = tuple(rng.integers(changed.shape))
            changed[at] = np.nextafter(changed[at], np.inf)
            others.append(replace(trial, **{name: changed}))
    infos: list[dict[str, Any]] = [{name: "x"} for name in ("participant", "started_utc")]
    infos += [{name: 7} for name in ("session", "order", "speed_mm_s", "force_n")]
    infos += [{"drive_vpp": 7.0}, {"sample_rate_hz": 7.0}, {"tones_hz": (250.0, 7.0)}]
    others += [replace(trial, info=replace(trial.info, **changed)) for changed in infos]
    others += [replace(trial, force_skew_s=0.0), replace(trial, skin_skew_s=0.0)]
    others += [replace(trial, voltage_source="command"), replace(trial, voltage_v=None)]
    assert len({digest(other) for other in others}) == len(others)


def test_a_copy_is_found_under_another_id_and_place(
    make_trial: MakeTrial, write_study: WriteStudy
) -> None:
    trial = make_trial("one", order=3)
    copy = replace(trial, info=replace(trial.info, id="two"))
    with StudyReader(write_study(trial, copy)) as study:
        assert [info.id for info in study.trials] == ["one"]
        assert study.excluded[0].trial == "two"
        assert "is trial one too" in study.excluded[0].reason
    found = duplicates([("one", "x"), ("three", "y"), ("two", "x"), ("four", "x")])
    assert [(one.trial, "trial one" in one.reason) for one in found] == [
        ("two", True),
        ("four", True),
    ]


def test_two_trials_in_one_place_leave_the_first(
    make_trial: MakeTrial, write_study: WriteStudy
) -> None:
    late = make_trial("a", order=3, started_utc="2026-03-01T10:05:00Z")
    early = make_trial("b", order=3, started_utc="2026-03-01T10:00:00Z")
    with StudyReader(write_study(late, early)) as study:
        assert [info.id for info in study.trials] == ["b"]
        assert study.excluded[0].trial == "a"
        assert study.excluded[0].field == "order"


def test_memory_does_not_grow_with_the_study(make_trial: MakeTrial, tmp_path: Path) -> None:
    trial = make_trial(n_samples=20_000)
    with StudyWriter(tmp_path / "s.h5", StudyInfo("r")) as writer:
        for order in range(40):
            info = replace(trial.info, id=f"t{order}", order=order)
            writer.add(replace(trial, info=info), STEPS)

    def peak_of(n_trials: int) -> int:
        with StudyReader(tmp_path / "s.h5") as study:
            assert len(study.trials) == 40
            tracemalloc.start()
            for info in study.trials[:n_trials]:
                study.read(info.id)
            peak = tracemalloc.get_traced_memory()[1]
            tracemalloc.stop()
        return peak

    assert peak_of(40) < 1.2 * peak_of(4)


def test_an_unfinished_study_does_not_appear(make_trial: MakeTrial, tmp_path: Path) -> None:
    with pytest.raises(KeyError), StudyWriter(tmp_path / "s.h5", StudyInfo("r")) as writer:  # noqa: PT012
        writer.add(make_trial())
        raise KeyError
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_is_said_and_leaves_nothing(make_trial: MakeTrial, tmp_path: Path) -> None:
    path, trials = tmp_path / "s.h5", [make_trial(name, 20_000) for name in "ab"]

    def write() -> None:
        with full_after(2_000_000), StudyWriter(path, StudyInfo(rig="rig1")) as writer:
            for trial in trials:
                writer.add(trial)

    with pytest.raises(NotWrittenError, match=r"s\.h5 cannot be written: File too large"):
        write()
    assert not list(tmp_path.iterdir())


def test_a_full_disk_is_said_when_all_is_written(make_trial: MakeTrial, tmp_path: Path) -> None:
    def write() -> None:
        with StudyWriter(tmp_path / "s.h5", StudyInfo(rig="rig1")) as writer:
            writer.add(make_trial("a"))
            with full_after(0):  # what HDF5 holds back until the end
                writer.close()

    with pytest.raises(NotWrittenError, match=r"s\.h5 cannot be written: File too large"):
        write()
    assert not list(tmp_path.iterdir())


def test_a_folder_that_is_none_is_said(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(NotWrittenError, match=r"cannot be written: .* folder that this"):
        StudyWriter(tmp_path / "file" / "s.h5", StudyInfo(rig="rig1"))


def test_what_cannot_be_written_is_refused(make_trial: MakeTrial, tmp_path: Path) -> None:
    (tmp_path / "old.h5").write_bytes(b"precious")
    with pytest.raises(StudyError, match="exists"):
        StudyWriter(tmp_path / "old.h5", StudyInfo("r"))
    assert (tmp_path / "old.h5").read_bytes() == b"precious"
    with StudyWriter(tmp_path / "new.h5", StudyInfo("r")) as writer:
        writer.add(make_trial("a"))
        for name in ("a", "", "a/b", "."):
            with pytest.raises(StudyError, match="id of its own"):
                writer.add(make_trial(name))
        with pytest.raises(StudyError, match=r"b, force_n: has shape \(3, 400\).*transpose"):
            writer.add(make_trial("b", force_n=np.zeros((3, 400))))
        with pytest.raises(StudyError, match=r"trial b, accel_m_s2: has 7 rows"):
            writer.add(make_trial("b", accel_m_s2=np.zeros((7, 3))))
        with pytest.raises(StudyError, match="voltage_v: reaches more than 32 bits"):
            writer.add(make_trial("b"), {"voltage_v": ConverterStep(1e-12)})
    with StudyReader(tmp_path / "new.h5") as study:
        assert [info.id for info in study.trials] == ["a"]


@pytest.mark.skipif(not FOREIGN.exists(), reason=f"{FOREIGN} is not there")
def test_a_file_of_another_program_is_read(write_study: WriteStudy) -> None:
    with open_study(FOREIGN) as study:
        assert study.excluded == ()
        assert len(study.trials) == 40
        assert study.info.mount is not None
        assert study.info.mount.frequency_response(np.zeros(1))[0] == pytest.approx(
            1.1602, 1e-4
        )
        assert study.info.extras == {"drive_hold_s": 5e-05}
        trials = [trial for trial in read_all(study) if not isinstance(trial, Exclusion)]
        info = study.info
    with h5py.File(FOREIGN) as file:
        for trial in trials:
            stored = file["trials"][trial.info.id]["force_n"]
            scale, offset = stored.attrs["scale"], stored.attrs["offset"]
            np.testing.assert_array_equal(trial.force_n, stored[()] * scale + offset)
            assert (trial.voltage_v is None) == (trial.info.tones_hz == ())
    with StudyReader(write_study(*trials, info=info)) as study:
        again = [trial for trial in read_all(study) if not isinstance(trial, Exclusion)]
    assert [trial.sha256 for trial in again] == [trial.sha256 for trial in trials]
