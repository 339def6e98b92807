"""One file of each format, made by the format's own library, becomes the study it holds."""

import gzip
import zipfile
from pathlib import Path

import h5py
import numpy as np
import pyarrow as pa
import pytest
from numpy.lib.stride_tricks import sliding_window_view
from pyarrow import parquet
from tests.service.data_import.conftest import write_csv
from tests.service.data_import.made import TONES_HZ, Swipes
from typer.testing import CliRunner

from frictus_service.cli.app import app
from frictus_service.data_import.column_map import load_map, map_beside
from frictus_service.data_import.formats.arrays import read_hdf5
from frictus_service.data_import.formats.read import read_columns
from frictus_service.study.importers import open_study
from frictus_service.study.reader import StudyReader


def run(*words: str | Path, answers: str = "") -> tuple[int, str, str]:
    result = CliRunner().invoke(app, ["study", "import", *map(str, words)], input=answers)
    return result.exit_code, result.stdout, result.stderr


def test_every_format_becomes_the_same_study(
    stored: tuple[Path, list[str]], recorded: Swipes, tmp_path: Path
) -> None:
    path, answers = stored
    out = tmp_path / "out" / "study.h5"
    said = [word for answer in answers for word in ("--set", answer)]
    code, _, told = run(path, out, "--yes", *said)
    assert code == 0, told
    with StudyReader(out) as study:
        assert not study.excluded
        # 2.5 s at 80 mm/s over 60 mm: three strokes whole, the last one cut.
        assert len(study.trials) in (3, 4)
        trials = [study.read(info.id) for info in study.trials]
    for trial in trials:
        windows = sliding_window_view(recorded.force_x_n, 50)
        first = int(np.argmin(np.abs(windows - trial.force_n[:50, 0]).sum(axis=1)))
        cut = slice(first, first + len(trial.force_n))
        expected = recorded.force_n[cut]
        np.testing.assert_allclose(trial.force_n[:, 0], expected[:, 0], atol=1e-4)
        np.testing.assert_allclose(trial.force_n[:, 2], expected[:, 2], atol=1e-4)
        assert trial.info.speed_mm_s == pytest.approx(80.0, rel=0.02)
        assert trial.info.force_n == pytest.approx(0.4, rel=0.1)
        if path.suffix != ".wav":
            assert trial.info.tones_hz == TONES_HZ
            assert trial.info.drive_vpp == pytest.approx(150.0, rel=0.05)
        else:
            assert trial.info.tones_hz == ()
            assert trial.voltage_v is None
    assert [info.order for info in study.trials] == list(range(len(trials)))
    # The map is beside the file, and every command takes the file with it.
    assert load_map(map_beside(path)).channels
    with open_study(path) as again:
        assert [info.speed_mm_s for info in again.trials] == [
            trial.info.speed_mm_s for trial in trials
        ]


def test_a_map_is_confirmed_and_corrected(recorded: Swipes, tmp_path: Path) -> None:
    from tests.service.data_import.conftest import write_csv

    path = tmp_path / "swipe.csv"
    write_csv(recorded, path)
    code, _, told = run(
        path, tmp_path / "a.h5", answers="speed_mm_s=x\nspeed_mm_s=80\nparticipant=Ada\n\n"
    )
    assert code == 0, told
    assert "speed_mm_s" in told  # what could not be understood was said
    confirmed = load_map(map_beside(path))
    assert (confirmed.speed_mm_s, confirmed.participant) == (80.0, "Ada")
    assert confirmed.channels["force_x"].sign == -1
    with StudyReader(tmp_path / "a.h5") as study:
        assert {info.speed_mm_s for info in study.trials} == {80.0}
        assert {info.participant for info in study.trials} == {"Ada"}


def test_nobody_confirms(recorded: Swipes, tmp_path: Path) -> None:
    from tests.service.data_import.conftest import write_csv

    path = tmp_path / "swipe.csv"
    write_csv(recorded, path)
    code, _, told = run(path, tmp_path / "a.h5")
    assert code == 2
    assert "nobody confirmed the map; --yes accepts it" in told
    assert not map_beside(path).exists()


def test_what_is_open_is_asked_not_guessed(recorded: Swipes, tmp_path: Path) -> None:
    path = tmp_path / "bare.csv"
    table = np.column_stack([-recorded.force_x_n, 1e3 * recorded.force_z_n, recorded.x_mm])
    np.savetxt(path, table, "%.6g", ",", header="Fx,Fz,x", comments="")
    code, _, told = run(path, tmp_path / "a.h5", "--yes")
    assert code == 2
    assert "rate_hz" in told  # nothing says it
    assert "could be mN or gf" in told  # 400 of force_z fit two units
    assert "its sign is turned" not in told  # nothing is said of signs before the rest is known
    done = ["--set", "force_z.unit=mN", "--set", "rate_hz=20000"]
    code, _, told = run(path, tmp_path / "a.h5", "--yes", *done)
    assert code == 0, told
    assert "the tangential force is against the velocity" in told
    assert load_map(map_beside(path)).channels["force_x"].sign == -1
    map_beside(path).unlink()
    by_person = [*done, "--set", "force_x.sign=1"]
    code, _, told = run(path, tmp_path / "b.h5", "--yes", *by_person)
    assert code == 0, told
    assert load_map(map_beside(path)).channels["force_x"].sign == 1


def test_a_folder_and_a_missing_file_are_sentences(tmp_path: Path) -> None:
    for path, sentence in (
        (Path(), "is a folder"),
        (tmp_path / "none.csv", "there is no file"),
    ):
        code, _, told = run(path, tmp_path / "a.h5", "--yes")
        assert code == 2
        assert sentence in told


def test_packed_files_and_workbooks_are_told_what_to_do_first(tmp_path: Path) -> None:
    gzipped, workbook = tmp_path / "a.csv", tmp_path / "b.xlsx"
    gzipped.write_bytes(gzip.compress(b"t,x\n0,1\n"))
    with zipfile.ZipFile(workbook, "w") as archive:
        archive.writestr("xl/workbook.xml", "<workbook/>")
    for path, sentence in (
        (gzipped, "is packed by gzip; unpack it"),
        (workbook, "save the sheet as CSV"),
    ):
        code, _, told = run(path, tmp_path / "a.h5", "--yes")
        assert code == 2
        assert sentence in told


def test_many_files_are_one_study(
    recorded: Swipes, tmp_path: Path, rng: np.random.Generator
) -> None:
    from tests.service.data_import.conftest import write_csv
    from tests.service.data_import.made import swipes

    for name, one in (("a", recorded), ("b", swipes(rng))):
        write_csv(one, tmp_path / f"{name}.csv")
    files = [tmp_path / "a.csv", tmp_path / "b.csv"]
    out = tmp_path / "s.h5"
    code, _, told = run(*files, out, "--yes", "--participant", "007", "--mount", "paper")
    assert code == 0, told
    with StudyReader(out) as study:
        assert study.info.mount is not None
        orders = [info.order for info in study.trials]
        assert orders == list(range(len(orders)))
        assert {info.participant for info in study.trials} == {"007"}
    code, _, told = run(*files, out, "--yes")
    assert code == 2
    assert "exists" in told


@pytest.mark.parametrize("kind", ["i2", "f4"])
def test_packed_arrays_are_what_they_stand_for(kind: str, tmp_path: Path) -> None:
    """NetCDF: value = number times scale_factor, plus add_offset, but where a fill stands."""
    path = tmp_path / "packed.h5"
    stored = {
        "packed": {"scale_factor": 0.5, "add_offset": 10.0, "_FillValue": -99},
        "moved": {"add_offset": [10.0], "missing_value": [4, 6]},
        "filled": {"_FillValue": 4, "missing_value": "none"},
        "plain": {"offset": 10.0, "long_name": "force"},
    }
    with h5py.File(path, "w") as file:
        for name, attributes in stored.items():
            numbers = np.array([2, 4, -99, 6], dtype=kind)
            file.create_dataset(name, data=numbers).attrs.update(attributes)
    found = {column.name: column.values for column in read_hdf5(path).columns}
    nan = np.nan
    np.testing.assert_array_equal(found["packed"], [11.0, 12.0, nan, 13.0])
    np.testing.assert_array_equal(found["moved"], [12.0, nan, -89.0, nan])
    np.testing.assert_array_equal(found["filled"], [2.0, nan, -99.0, 6.0])
    np.testing.assert_array_equal(found["plain"], [2.0, 4.0, -99.0, 6.0])


def test_numbers_of_netcdf_beyond_its_range_or_type(tmp_path: Path) -> None:
    """Attributes mean what is stored: signs, ranges, fills of single precision."""
    path = tmp_path / "netcdf.h5"
    byte, single = np.array([1, -1, -128, 5], "i1"), np.array([1.0, -99.9, 1e20, 5.0], "f4")
    stored = {
        "unsigned": (byte, {"_Unsigned": "true", "scale_factor": 0.5, "_FillValue": -128}),
        "range": (byte, {"valid_range": np.array([-1, 4], "i1")}),
        "ends": (byte, {"valid_min": -2, "valid_max": 3}),
        "filled": (single, {"_FillValue": -99.9, "missing_value": 1e20}),
        "half": (np.array([1000.0, 2.0], "f2"), {"scale_factor": 1e3}),
    }
    with h5py.File(path, "w") as file:
        for name, (numbers, attributes) in stored.items():
            file.create_dataset(name, data=numbers).attrs.update(attributes)
    found = {column.name: column.values for column in read_hdf5(path).columns}
    nan = np.nan
    np.testing.assert_array_equal(found["unsigned"], [0.5, 127.5, nan, 2.5])
    np.testing.assert_array_equal(found["range"], [1.0, -1.0, nan, nan])
    np.testing.assert_array_equal(found["ends"], [1.0, -1.0, nan, nan])
    np.testing.assert_array_equal(found["filled"], [1.0, nan, nan, 5.0])
    np.testing.assert_array_equal(found["half"], [1e6, 2e3])


def test_what_matlab_stores_of_no_numbers_is_no_column(tmp_path: Path) -> None:
    """MATLAB 7.3 keeps the size of an empty array as its values, of a table a reference."""
    path = tmp_path / "day.h5"
    stored = {
        "force": ([[0.1, 0.2, 0.3]], {"MATLAB_class": b"double"}),
        "pos": ([0, 0], {"MATLAB_class": b"double", "MATLAB_empty": np.uint8(1)}),
        "t": ([[3707764736, 2, 1, 1, 1, 1]], {"MATLAB_class": b"duration"}),
    }
    with h5py.File(path, "w") as file:
        for name, (numbers, attributes) in stored.items():
            file.create_dataset(name, data=numbers).attrs.update(attributes)
    assert [column.name for column in read_hdf5(path).columns] == ["force"]


def test_a_dimension_without_values_is_no_column(tmp_path: Path) -> None:
    """NetCDF keeps each dimension as a data set; without values, nothing is written in it."""
    path = tmp_path / "dimension.h5"
    with h5py.File(path, "w") as file:
        for name, values in (("sample", None), ("metre", np.arange(3.0))):
            scale = file.create_dataset(name, (3,), ">f4", data=values)
            scale.make_scale("a dimension")
        force = file.create_dataset("force", data=np.arange(3.0))
        force.dims[0].attach_scale(file["sample"])
    assert [column.name for column in read_hdf5(path).columns] == ["force", "metre"]


def test_the_counts_of_a_study_have_its_scale(tmp_path: Path) -> None:
    path = tmp_path / "counts.h5"
    with h5py.File(path, "w") as file:
        counts = file.create_dataset("force", data=np.array([2, 4, -9], dtype="i2"))
        counts.attrs.update({"scale": 0.5, "offset": 1.0, "_FillValue": -9})
    (force,) = read_hdf5(path).columns
    np.testing.assert_array_equal(force.values, [2.0, 3.0, np.nan])


def test_columns_that_are_called_alike_stay_apart(tmp_path: Path) -> None:
    """Parquet may have them: the second was a copy of the first."""
    path = tmp_path / "alike.parquet"
    arrays = [pa.array(["a", "b"]), pa.array([1.0, 2.0]), pa.array([3.0, 4.0])]
    parquet.write_table(pa.Table.from_arrays(arrays, names=["Fx", "Fx", "Fx"]), path)
    found = {column.name: column.values.tolist() for column in read_columns(path).columns}
    assert found == {"Fx": [1.0, 2.0], "Fx (2)": [3.0, 4.0]}


def test_data_sets_whose_paths_read_alike_stay_apart(tmp_path: Path) -> None:
    """One of `a.b` and one of `a/b`: what was mapped was the last."""
    path = tmp_path / "alike.h5"
    with h5py.File(path, "w") as file:
        file["a.b"], file["a/b"] = [1.0, 2.0], [3.0, 4.0]
    found = {column.name: column.values.tolist() for column in read_columns(path).columns}
    assert sorted(found.values()) == [[1.0, 2.0], [3.0, 4.0]]


def test_names_of_a_program_that_writes_no_utf_8(tmp_path: Path) -> None:
    path = tmp_path / "day1.h5"
    with h5py.File(path, "w") as file:
        group = file.create_group("Läufe".encode("latin-1"))
        group.create_dataset("Kraft längs".encode("latin-1"), data=[1.0, 2.0])
    (column,) = read_columns(path).columns
    assert column.name == "Läufe.Kraft längs"


def test_a_name_as_long_as_a_file_system_takes(recorded: Swipes, tmp_path: Path) -> None:
    """Its map, and what is unfinished, would have longer ones."""
    path, out = tmp_path / f"{'a' * 251}.csv", tmp_path / f"{'o' * 252}.h5"
    write_csv(recorded, path)
    done = CliRunner().invoke(app, ["study", "import", "--yes", str(path), str(out)])
    assert done.exit_code == 0, done.output
    assert "keep it elsewhere, and give it with --map" in done.output
    with open_study(out) as study:
        assert study.trials
