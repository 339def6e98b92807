"""Names of folders, files and groups say who was measured, and what was asked."""

from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.io import savemat
from tests.service.data_import.test_recordings_in_file import (
    RATE_HZ,
    TRIALS,
    as_cell_of_structs_of_level_73,
    as_groups,
    in_cell,
)
from typer.testing import CliRunner

from frictus_service.cli.app import app
from frictus_service.data_import.column_map import load_map, map_beside
from frictus_service.data_import.formats.read import read_columns
from frictus_service.data_import.mapped_study import ONE_PERSON, MappedStudy
from frictus_service.data_import.proposal import propose
from frictus_service.data_import.recording_names import check_template, people_in, said_by
from frictus_service.errors import FieldError
from frictus_service.study.importers import open_study


def imported(out: Path, files: list[Path], *options: str, code: int = 0) -> str:
    """Return what an import says."""
    words = ["study", "import", *map(str, files), str(out), *options]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == code, done.output
    return done.output


def people_of(study: Path) -> list[tuple[str, int, float, float]]:
    with open_study(study) as opened:
        return [
            (each.participant, each.session, round(each.speed_mm_s, 3), round(each.force_n, 3))
            for each in opened.trials
        ]


@pytest.mark.parametrize(
    ("template", "place", "said"),
    [
        ("{participant}", "/data/KM.h5/AB", {"participant": "AB"}),
        ("{participant}/{}", "/data/P3/trial(2)", {"participant": "P3"}),
        ("{participant}_{}", "sub-03_day1_2", {"participant": "sub-03"}),
        (
            "{participant}/s{session}_{speed_mm_s}mms_{force_n}N{}",
            "x/P03/S02_80mms_0p5N_again",
            {"participant": "P03", "session": 2, "speed_mm_s": 80.0, "force_n": 0.5},
        ),
        ("{}_{force_n}", "a_b_1,25", {"force_n": 1.25}),
    ],
)
def test_a_template_reads_a_name(template: str, place: str, said: dict[str, object]) -> None:
    check_template(template)
    assert said_by(template, place) == said


@pytest.mark.parametrize("name", ["P03", "P03_80", "80", "P03_80mms_x", "a" * 10_000])
def test_a_name_of_another_form_is_refused(name: str) -> None:
    with pytest.raises(FieldError, match=r"names: is '.*the recording is called.*accepted"):
        said_by("{participant}_{speed_mm_s}mms", name)


@pytest.mark.parametrize(
    ("template", "reason"),
    [
        ("{person}_{}", "{person}; accepted: participant, session"),
        ("trial", "is a template such as"),
        ("{}", "is a template such as"),
        ("{participant", "is a template such as"),
        ("{participant}{session}", "nothing between"),
        ("{participant}_{participant}", "an entry twice"),
        ("{}a{}b{}c{}d{participant}", "more than 3 times"),
    ],
)
def test_what_is_no_template_is_refused(template: str, reason: str) -> None:
    with pytest.raises(ValueError, match=r"names (is|has)") as refused:
        check_template(template)
    assert reason in str(refused.value)


@pytest.mark.timeout(60)
def test_the_most_ambiguous_name_is_read_at_once() -> None:
    """Else a map would hold up who opens a file under it."""
    template = "{}a{}a{}a{participant}"
    check_template(template)
    with pytest.raises(FieldError):
        said_by(template, f"{'a' * 199}/")


@pytest.mark.parametrize(
    ("places", "template"),
    [
        (["x/P01/t1", "x/P01/t2", "x/P02/t1"], "{participant}/{}"),
        (["x/P01_1", "x/P02_1"], "{participant}_{}"),
        (["x/day1-sub2", "x/day2-sub1"], "{}-{participant}"),
        (["P07/day1"], "{participant}/{}"),
        (["x/trial_1", "x/trial_2"], None),
        (["x/s1", "x/s2"], None),
        (["x/P01", "x/blank"], None),
        (["x/step1", "x/step2"], None),
        ([""], None),
    ],
)
def test_people_are_found_where_names_call_them(
    places: list[str], template: str | None
) -> None:
    assert people_in(places) == template
    for place in places if template else []:
        said_by(str(template), place)


def grouped(path: Path) -> Path:
    """Write two trials of each of two people into one file, by person."""
    with h5py.File(path, "w") as file:
        file.attrs["sample_rate_hz"] = RATE_HZ
        for number, held in enumerate(TRIALS):
            group = file.create_group(f"P{number // 2 + 1:02d}/trial_{number}")
            for name in held:
                group[name] = held[name]
    return path


def test_a_file_of_several_people_is_a_study_of_several_people(tmp_path: Path) -> None:
    path = grouped(tmp_path / "all.h5")
    told = imported(tmp_path / "out.h5", [path], "--yes")
    assert "participants are read by names {participant}/{}: P01, P02" in told
    assert ONE_PERSON not in told
    assert [one[0] for one in people_of(tmp_path / "out.h5")] == ["P01", "P01", "P02", "P02"]
    with open_study(path) as beside:  # by the map that was saved
        assert {one.participant for one in beside.trials} == {"P01", "P02"}


def as_attributes(path: Path, people: list[object]) -> Path:
    path = as_groups(path)
    with h5py.File(path, "r+") as file:
        for number, person in enumerate(people):
            file[f"trials/trial_{number:04d}"].attrs["subject"] = person
    return path


def as_attributes_of_holders(path: Path, people: list[object]) -> Path:
    with h5py.File(path := path.with_suffix(".h5"), "w") as file:
        for number, (held, person) in enumerate(zip(TRIALS, people, strict=True)):
            holder = file.create_group(f"{number}")
            holder.attrs["Participant_ID"] = person
            group = holder.create_group("run")
            group.attrs["fs"] = RATE_HZ
            for name in held:
                group[name] = held[name]
    return path


def as_fields(path: Path, people: list[object]) -> Path:
    structs = [{**held, "subject": person} for held, person in zip(TRIALS, people, strict=True)]
    savemat(path := path.with_suffix(".mat"), {"trial": in_cell([*structs]), "fs": RATE_HZ})
    return path


def as_fields_of_level_73(path: Path, people: list[object]) -> Path:
    path = as_cell_of_structs_of_level_73(path)
    with h5py.File(path, "r+") as file:
        for number, person in enumerate(people):
            codes = np.array([list(map(ord, str(person)))], np.uint16).T
            letters = file.create_dataset(f"#refs#/{number}/subject", data=codes)
            letters.attrs["MATLAB_class"] = np.bytes_("char")
    return path


@pytest.mark.parametrize(
    "written", [as_attributes, as_attributes_of_holders, as_fields, as_fields_of_level_73]
)
@pytest.mark.parametrize(
    "people", [["AB", "AB", "KM", "KM"], [7, 7, 12, 12]], ids=["text", "number"]
)
def test_what_recordings_say_of_their_person_is_read(
    written: Callable[[Path, list[object]], Path], people: list[object], tmp_path: Path
) -> None:
    path = written(tmp_path / "all", people)
    told = imported(tmp_path / "out.h5", [path], "--yes")
    assert "participants are read by participant_field" in told
    assert [one[0] for one in people_of(tmp_path / "out.h5")] == sorted(map(str, people))
    out = tmp_path / "another.h5"
    imported(out, [path], "--participant", "XY")
    assert {one[0] for one in people_of(out)} == {"XY"}


@pytest.mark.parametrize(
    ("says", "reason"),
    [("x", "is 'x'; accepted: a field of the recording, which has"), ("note", "control or")],
)
def test_a_field_that_says_nobody_is_refused(says: str, reason: str, tmp_path: Path) -> None:
    path = as_attributes(tmp_path / "all", ["AB"] * 4)
    with h5py.File(path, "r+") as file:
        file.attrs["note"] = "a\nb"
    imported(tmp_path / "out.h5", [path], "--yes")
    told = imported(tmp_path / "no.h5", [path], "--set", f"participant_field={says}", code=2)
    assert reason in " ".join(told.split())


def test_who_says_whose_they_are_is_right(tmp_path: Path) -> None:
    path = grouped(tmp_path / "all.h5")
    imported(tmp_path / "out.h5", [path], "--yes", "--participant", "KM")
    assert {one[0] for one in people_of(tmp_path / "out.h5")} == {"KM"}
    assert load_map(map_beside(path)).names == ""


def test_files_of_several_people_are_told_by_one_map(tmp_path: Path) -> None:
    files = []
    for person, speed in (("AB", 50), ("KM", 50), ("KM", 80)):
        (folder := tmp_path / person).mkdir(exist_ok=True)
        held = TRIALS[1] | {"speed_mm_s": np.full(round(RATE_HZ), float(speed))}
        path = folder / f"S2_{speed}mms_1p0N.csv"
        rows = np.column_stack(list(held.values()))
        np.savetxt(path, rows, "%.6f", ",", header=",".join(held), comments="")
        files.append(path)
    alone = imported(tmp_path / "one.h5", files, "--yes")
    assert ONE_PERSON in alone
    template = "names={participant}/S{session}_{speed_mm_s}mms_{force_n}N"
    told = imported(tmp_path / "out.h5", files, "--set", template)
    assert ONE_PERSON not in told
    assert "no targets were given" not in told
    assert people_of(tmp_path / "out.h5") == [
        ("AB", 2, 50.0, 1.0),
        ("KM", 2, 50.0, 1.0),
        ("KM", 2, 80.0, 1.0),
    ]
    refused = imported(tmp_path / "no.h5", files, "--set", "names={participant}_x", code=2)
    assert "the recording is called 'S2_50mms_1p0N'" in " ".join(refused.split())


def test_recordings_of_nobody_are_told_to_be_of_one_person(tmp_path: Path) -> None:
    path = as_groups(tmp_path / "session")
    column_map = propose(read_columns(path)).column_map
    with MappedStudy(path, column_map) as study:
        assert ONE_PERSON in str(study.info.extras["import_notes"])


def test_recordings_that_are_called_otherwise_are_told(tmp_path: Path) -> None:
    path = as_groups(tmp_path / "session")
    with h5py.File(path, "r+") as file:
        file.copy("trials/trial_0000", "more/trial_0000")
    told = "; ".join(propose(read_columns(path)).reasons)
    assert "1 more are called otherwise and left out, as more.trial_0000" in told
