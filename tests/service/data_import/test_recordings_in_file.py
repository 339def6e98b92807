"""A file may hold several recordings: groups, structs, or a clock that begins anew."""

from collections.abc import Callable, Mapping
from pathlib import Path

import h5py
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.io import savemat
from typer.testing import CliRunner

from frictus_hardware.arrays import FloatArray
from frictus_service.cli.app import app
from frictus_service.data_import.column_map import ColumnMap, parse_map
from frictus_service.data_import.formats.columns import Column, Columns
from frictus_service.data_import.formats.read import read_columns
from frictus_service.data_import.mapped_study import MappedStudy
from frictus_service.data_import.proposal import propose, with_signs
from frictus_service.data_import.recordings_in_file import groups_of, mapped_recordings
from frictus_service.errors import FieldError, StudyError

RATE_HZ = 5000.0
SPEEDS_MM_S = (20.0, 50.0, 80.0, 50.0)
Trial = Mapping[str, FloatArray]


def trial(speed_mm_s: float) -> dict[str, FloatArray]:
    """Return 1 s of a slide at a speed, under 1 N."""
    samples = np.arange(round(RATE_HZ))
    return {
        "t": samples / RATE_HZ,
        "fx": 0.3 + 0.02 * np.sin(samples),
        "fz": np.ones(samples.size),
        "speed_mm_s": np.full(samples.size, speed_mm_s),
    }


TRIALS = tuple(trial(speed) for speed in SPEEDS_MM_S)


def as_groups(path: Path, trials: tuple[Trial, ...] = TRIALS) -> Path:
    with h5py.File(path := path.with_suffix(".h5"), "w") as file:
        for number, held in enumerate(trials):
            group = file.create_group(f"trials/trial_{number:04d}")
            group.attrs["sample_rate_hz"] = RATE_HZ
            for name in held:
                group.create_dataset(name, data=held[name])
    return path


def as_structs(path: Path) -> Path:
    structs = np.empty(len(TRIALS), dtype=[(name, object) for name in TRIALS[0]])
    for number, held in enumerate(TRIALS):
        structs[number] = tuple(held.values())
    savemat(path := path.with_suffix(".mat"), {"trial": structs, "fs": RATE_HZ})
    return path


def as_structs_of_level_73(path: Path) -> Path:
    """Write what MATLAB does with -v7.3: fields are references, their values lie elsewhere."""
    with h5py.File(path := path.with_suffix(".mat"), "w", userblock_size=512) as file:
        file["fs"] = [[RATE_HZ]]
        struct = file.create_group("trial")
        struct.attrs["MATLAB_class"] = np.bytes_("struct")
        for name in TRIALS[0]:
            references = []
            for number, held in enumerate(TRIALS):
                values = file.create_dataset(f"#refs#/{name}{number}", data=[held[name]])
                values.attrs["MATLAB_class"] = np.bytes_("double")
                references.append([values.ref])
            struct.create_dataset(name, data=references, dtype=h5py.ref_dtype)
    with path.open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file")
    return path


def in_cell(values: list[object]) -> NDArray[np.object_]:
    cell = np.empty((1, len(values)), dtype=object)
    for number, value in enumerate(values):
        cell[0, number] = value
    return cell


def as_cell_of_structs(path: Path) -> Path:
    cell = in_cell([dict(held) for held in TRIALS])
    savemat(
        path := path.with_suffix(".mat"), {"trial": cell, "fs": RATE_HZ, "note": in_cell(["x"])}
    )
    return path


def as_cells(path: Path) -> Path:
    cells = {name: in_cell([held[name] for held in TRIALS]) for name in TRIALS[0]}
    savemat(path := path.with_suffix(".mat"), {"run": cells, "fs": RATE_HZ})
    return path


def as_variables_that_are_cells(path: Path) -> Path:
    cells = {name: in_cell([held[name] for held in TRIALS]) for name in TRIALS[0]}
    savemat(path := path.with_suffix(".mat"), cells | {"fs": RATE_HZ})
    return path


def of_level_73(path: Path, cells: Mapping[str, list[h5py.Reference]]) -> None:
    with h5py.File(path, "r+") as file:
        file["fs"] = [[RATE_HZ]]
        for name, references in cells.items():
            column = [[reference] for reference in references]
            cell = file.create_dataset(name, data=column, dtype=h5py.ref_dtype)
            cell.attrs["MATLAB_class"] = np.bytes_("cell")
    with path.open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file")


def as_cell_of_structs_of_level_73(path: Path) -> Path:
    with h5py.File(path := path.with_suffix(".mat"), "w", userblock_size=512) as file:
        references = []
        for number, held in enumerate(TRIALS):
            struct = file.create_group(f"#refs#/{number}")
            struct.attrs["MATLAB_class"] = np.bytes_("struct")
            for name in held:
                struct.create_dataset(name, data=[held[name]])
            references.append(struct.ref)
    of_level_73(path, {"trial": references})
    return path


def as_cells_of_level_73(path: Path) -> Path:
    with h5py.File(path := path.with_suffix(".mat"), "w", userblock_size=512) as file:
        cells = {
            f"run/{name}": [
                file.create_dataset(f"#refs#/{name}{number}", data=[held[name]]).ref
                for number, held in enumerate(TRIALS)
            ]
            for name in TRIALS[0]
        }
    of_level_73(path, cells)
    return path


def as_rows(path: Path) -> Path:
    rows = np.concatenate([np.column_stack(list(held.values())) for held in TRIALS])
    path = path.with_suffix(".csv")
    np.savetxt(path, rows, "%.6f", ",", header=",".join(TRIALS[0]), comments="")
    return path


@pytest.mark.parametrize(
    "written",
    [
        as_groups,
        as_structs,
        as_structs_of_level_73,
        as_cell_of_structs,
        as_cell_of_structs_of_level_73,
        as_cells,
        as_cells_of_level_73,
        as_variables_that_are_cells,
        as_rows,
    ],
)
def test_each_is_proposed_and_becomes_a_trial(
    written: Callable[[Path], Path], tmp_path: Path
) -> None:
    path = written(tmp_path / "session")
    columns = read_columns(path)
    proposal = with_signs(columns, propose(columns))
    assert not proposal.questions
    with MappedStudy(path, proposal.column_map) as study:
        assert [found.speed_mm_s for found in study.trials] == pytest.approx(SPEEDS_MM_S)
        starts = [np.datetime64(found.started_utc[:-6], "ms") for found in study.trials]
        np.testing.assert_allclose(np.diff(starts).astype(float), 1e3, atol=5.0)
        assert study.recorded_s == pytest.approx(4.0)
        assert "4 recordings of the file are taken to follow each other" in str(
            study.info.extras["import_notes"]
        )


def test_one_that_the_map_does_not_fit_is_left_out_and_named(tmp_path: Path) -> None:
    broken = {name: values for name, values in TRIALS[1].items() if name != "speed_mm_s"}
    path = as_groups(tmp_path / "session", (TRIALS[0], broken, *TRIALS[2:]))
    told = CliRunner().invoke(
        app, ["study", "import", str(path), str(tmp_path / "out.h5"), "--yes", "--json"]
    )
    assert told.exit_code == 0, told.output
    assert "4 recordings, trials.trial_0000 to trials.trial_0003" in told.stderr
    assert '"trials": 3' in told.stdout
    assert '"trial": "trials.trial_0001", "field": "velocity_x"' in told.stdout
    shown = CliRunner().invoke(app, ["study", "show", "--friction", str(path)])
    assert "left out: trials.trial_0001, velocity_x: there is no column" in shown.stderr


def mapped(**columns: str) -> ColumnMap:
    units = {"velocity_x": "mm/s", "time": "s"}
    channels = {
        name: {"column": column, "unit": units.get(name, "N")}
        for name, column in columns.items()
    }
    return parse_map({"channels": channels}, "test")


def test_a_map_of_whole_names_is_of_one_recording(tmp_path: Path) -> None:
    columns = read_columns(as_groups(tmp_path / "session"))
    one = "trials.trial_0002"
    own = {"force_x": "fx", "force_z": "fz", "velocity_x": "speed_mm_s"}
    (found,), _ = mapped_recordings(
        columns, mapped(**{name: f"{one}.{column}" for name, column in own.items()})
    )
    assert found.position_mm[-1, 0] == pytest.approx(SPEEDS_MM_S[2], rel=0.02)
    with pytest.raises(FieldError, match="there is no column 'Fx'; columns: 'fx', 'fz'"):
        mapped_recordings(columns, mapped(force_x="Fx"))


def test_two_sensors_are_not_two_recordings(tmp_path: Path) -> None:
    path = tmp_path / "day.h5"
    with h5py.File(path, "w") as file:
        for name in ("sensor1/fx", "sensor1/fz", "sensor2/fx", "sensor2/fz", "x"):
            file[name] = np.ones(9)
    assert not groups_of(read_columns(path))


def test_a_clock_that_only_jumps_back_is_refused() -> None:
    """It begins anew where it falls back to its first time, and nowhere else."""
    held = {name: values.copy() for name, values in TRIALS[0].items()}
    held["t"][2500:] -= 0.1
    columns = Columns("text", tuple(Column(name, held[name]) for name in held))
    with pytest.raises(FieldError, match="is not regular at row 2500"):
        mapped_recordings(columns, mapped(force_x="fx", time="t"))


def test_references_without_end_are_refused(tmp_path: Path) -> None:
    """A few bytes each, they may all lead to the same values."""
    path = tmp_path / "day.mat"
    with h5py.File(path, "w") as file:
        values = file.create_dataset("#refs#/a", data=np.ones(9))
        field = file.create_dataset("trial/fx", shape=(100_000,), dtype=h5py.ref_dtype)
        field[:] = values.ref
    with pytest.raises(StudyError, match="holds more than 16384 objects"):
        read_columns(path)


def test_what_lies_in_another_file_is_no_part_of_a_cell(tmp_path: Path) -> None:
    other = as_groups(tmp_path / "other")
    path = as_cell_of_structs_of_level_73(tmp_path / "day")
    with h5py.File(path, "r+") as file:
        for number in range(len(TRIALS)):
            file[f"#refs#/{number}/fy"] = h5py.ExternalLink(other, "trials/trial_0000/fx")
    names = {column.name.rpartition(".")[2] for column in read_columns(path).columns}
    assert names == set(TRIALS[0])


@pytest.mark.timeout(120)
def test_a_cell_whose_structs_hold_more_than_can_be_is_refused(tmp_path: Path) -> None:
    """A few references lead to many groups each, over and over."""
    path = tmp_path / "day.mat"
    with h5py.File(path, "w") as file:
        struct = file.create_group("#refs#/a")
        for number in range(4000):
            struct.create_group(f"g{number}")
        cell = file.create_dataset("trial", shape=(9000,), dtype=h5py.ref_dtype)
        cell[:] = struct.ref
        cell.attrs["MATLAB_class"] = np.bytes_("cell")
    with pytest.raises(StudyError, match="holds more than 16384 objects"):
        read_columns(path)


@pytest.mark.parametrize("odd", [np.nan, np.inf])
def test_a_clock_of_no_times_is_refused_without_a_warning(odd: float) -> None:
    held = TRIALS[0] | {"t": np.full(round(RATE_HZ), odd)}
    columns = Columns("text", tuple(Column(name, held[name]) for name in held))
    with pytest.raises(FieldError):
        mapped_recordings(columns, mapped(force_x="fx", time="t"))
