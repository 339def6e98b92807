"""Files that are damaged, lie about their size, or hold what must never be loaded."""

import os
import pickle
import struct
import zlib
from pathlib import Path

import h5py
import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet
from scipy.io import savemat
from tests.service.data_import.conftest import WRITERS
from tests.service.data_import.made import Swipes

from frictus_service.data_import.formats import columns, tables
from frictus_service.data_import.formats.read import read_columns
from frictus_service.discovery.impact_recording import ImpactRecordingError, read_impacts
from frictus_service.errors import StudyError
from frictus_service.study import matlab

ROUNDS = 60


@pytest.fixture(scope="module")
def brief(recorded: Swipes) -> Swipes:
    """Return the beginning of the recording: damage hits structure as often as samples."""
    n, k = 64, 3
    return Swipes(
        recorded.time_s[:n],
        recorded.voltage_v[:n],
        recorded.force_x_n[:n],
        recorded.force_y_n[:n],
        recorded.force_z_n[:n],
        recorded.accel_m_s2[:n],
        recorded.x_mm[:n],
        recorded.y_mm[:n],
        recorded.position_t_s[:k],
        recorded.position_mm[:k],
    )


@pytest.mark.filterwarnings("ignore")  # of the libraries, about what was made on purpose
@pytest.mark.parametrize("name", [name for name in WRITERS if name != "daq.h5"])
def test_damage_is_a_sentence(
    name: str, brief: Swipes, tmp_path: Path, rng: np.random.Generator
) -> None:
    path = tmp_path / name
    WRITERS[name][0](brief, path)
    whole = path.read_bytes()
    refusals: list[str] = []
    for round_ in range(ROUNDS):
        data = bytearray(whole)
        if round_ % 3 == 0:
            del data[int(rng.integers(1, len(data))) :]
        else:
            for at in rng.integers(0, min(len(data), 4000), size=round_ % 7 + 1):
                data[at] ^= 1 << int(rng.integers(8))
        path.write_bytes(data)
        try:
            columns = read_columns(path)
        except StudyError as error:
            refusals.append(str(error))
        else:
            assert sum(column.values.size for column in columns.columns) < 1e6
    # Where nothing is refused, the damage is in samples alone.
    assert refusals
    assert all(str(path) in refusal for refusal in refusals)


def test_a_matlab_file_that_unfolds_without_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(matlab, "MAX_BYTES", 1 << 22)
    path = tmp_path / "bomb.mat"
    savemat(path, {"fs": 1.0})
    header = path.read_bytes()[:128]
    packer = zlib.compressobj(9)
    zeros = bytes(1 << 24)
    packed = b"".join(packer.compress(zeros) for _ in range(4)) + packer.flush()
    path.write_bytes(header + struct.pack("<II", 15, len(packed)) + packed)
    assert path.stat().st_size < 1 << 20
    with pytest.raises(StudyError, match="unfolds to more than"):
        read_columns(path)
    with pytest.raises(ImpactRecordingError, match="unfolds to more than"):
        read_impacts(path)


def test_a_matlab_file_that_nests_without_end(tmp_path: Path) -> None:
    path = tmp_path / "deep.mat"
    nested: dict[str, object] = {"x": 1.0}
    for _ in range(30):
        nested = {"s": nested}
    savemat(path, nested, do_compression=True)
    with pytest.raises(StudyError, match="more than 8 deep"):
        read_columns(path)


def element(kind: int, data: bytes) -> bytes:
    return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8)


@pytest.mark.parametrize("class_", [1, 2, 4, 6])  # cell, struct, text, numbers
@pytest.mark.parametrize("compressed", [False, True])
@pytest.mark.parametrize(
    "dimensions", [element(5, struct.pack("<2i", 1, 2**31 - 1)), b"\5\0\4\0\xff\xff\xff\x7f"]
)
def test_a_matlab_array_that_declares_without_end(
    class_: int, compressed: bool, dimensions: bytes, tmp_path: Path
) -> None:
    matrix = element(
        14,
        element(6, struct.pack("<II", class_, 0))
        + dimensions
        + element(1, b"a")
        + element(4, b""),
    )
    path = tmp_path / "declares.mat"
    savemat(path, {"fs": 1.0})
    if compressed:
        matrix = struct.pack("<II", 15, len(zlib.compress(matrix))) + zlib.compress(matrix)
    path.write_bytes(path.read_bytes()[:128] + matrix)
    with pytest.raises(StudyError, match="declares 2,147,483,647 elements"):
        read_columns(path)


def test_objects_in_a_matlab_file_and_two_variables_of_one_name(tmp_path: Path) -> None:
    """A saved workspace holds a session of NI-DAQ or two, which are no arrays."""
    path = tmp_path / "workspace.mat"
    savemat(path, {"reference": 1.0})
    opaque, value = element(6, struct.pack("<II", 17, 0)), path.read_bytes()[128:]
    session, other = (
        element(14, opaque + b"".join(element(1, each) for each in names) + value)
        for names in ((b"s", b"MCOS", b"daq.Session"), (b"t", b"MCOS", b"daq.Session"))
    )
    savemat(path, {"out": np.arange(5.0), "sr": 1000.0})
    saved = path.read_bytes()
    path.write_bytes(saved + session + other)
    assert [column.name for column in read_columns(path).columns] == ["out"]
    np.testing.assert_array_equal(read_impacts(path).samples, np.arange(5.0))
    path.write_bytes(saved[:128] + session)
    with pytest.raises(StudyError, match="save it by writetable or writetimetable"):
        read_columns(path)
    path.write_bytes(saved + saved[128:])
    with pytest.raises(StudyError, match=r'Duplicate variable name "out".*each variable once'):
        read_columns(path)


def test_an_hdf5_file_that_nests_without_end(tmp_path: Path) -> None:
    path = tmp_path / "deep.h5"
    with h5py.File(path, "w") as file:
        file.create_group("/".join("g" * 40)).create_dataset("force_x", data=np.zeros(9))
    with pytest.raises(StudyError, match="more than 16 deep"):
        read_columns(path)


def test_an_hdf5_file_that_declares_without_end(tmp_path: Path) -> None:
    path = tmp_path / "huge.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset("force_x", shape=(1 << 40,), dtype="f8", chunks=(1 << 20,))
    with pytest.raises(StudyError, match="more than 100,000,000 values"):
        read_columns(path)


def test_an_hdf5_file_that_points_elsewhere(tmp_path: Path) -> None:
    (tmp_path / "secret").write_bytes(bytes(800))
    path = tmp_path / "pointing.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset(
            "force_x", shape=(100,), dtype="f8", external=[(tmp_path / "secret", 0, 800)]
        )
    with pytest.raises(StudyError, match="lies in another file"):
        read_columns(path)


def test_an_hdf5_file_whose_chunks_unfold_to_more_than_it_holds(tmp_path: Path) -> None:
    path = tmp_path / "chunk.h5"
    with h5py.File(path, "w") as file:
        wide = {"maxshape": (None,), "chunks": (3_000_000,), "compression": "gzip"}
        file.create_dataset("force_x", data=np.zeros(10), **wide)
    with pytest.raises(StudyError, match="80 bytes in chunks of 24000000"):
        read_columns(path)


def test_a_parquet_file_that_unfolds_without_end(tmp_path: Path) -> None:
    path = tmp_path / "bomb.parquet"
    zeros = pa.array(np.zeros(1_000_000))
    with parquet.ParquetWriter(path, pa.schema([("force_x", pa.float64())])) as writer:
        for _ in range(101):
            writer.write_table(pa.table({"force_x": zeros}))
    assert path.stat().st_size < 1 << 20
    with pytest.raises(StudyError, match="more than 100,000,000 values"):
        read_columns(path)


def test_a_text_that_holds_more_values_than_a_file_may(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(columns, "MAX_VALUES", 10_000)
    path = tmp_path / "long.csv"
    path.write_text("a;b\n" + "1;1\n1;2\n" * 6_000)
    with pytest.raises(StudyError, match=r"the table .* more than 10,000 values"):
        read_columns(path)


class Evil:
    """Leaves a trace where it is unpickled."""

    def __reduce__(self) -> tuple[object, tuple[str, str]]:
        return (open, ("unpickled", "w"))


@pytest.mark.parametrize("name", ["evil.pkl", "evil.npy", "evil.csv", "evil.mat", "evil.h5"])
def test_nothing_is_unpickled(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    path = tmp_path / name
    if path.suffix == ".npy":
        np.save(path, np.array([Evil()], dtype=object), allow_pickle=True)
    else:
        path.write_bytes(pickle.dumps(Evil()))
    with pytest.raises(StudyError):
        read_columns(path)
    assert not (tmp_path / "unpickled").exists()


@pytest.mark.parametrize(
    "content", [b"", b"\0" * 600, b"a,b\n", b"1" * 100_000, b"\xff\xfe1,2"]
)
@pytest.mark.parametrize("suffix", [".csv", ".mat", ".h5", ".wav", ".parquet", ".tdms", ".txt"])
def test_empty_and_odd_files(content: bytes, suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"odd{suffix}"
    path.write_bytes(content)
    with pytest.raises(StudyError, match="accepted"):
        read_columns(path)


def test_trials_in_an_array_of_more_dimensions_are_refused_with_what_to_do(
    tmp_path: Path,
) -> None:
    path = tmp_path / "day.mat"
    savemat(path, {"force": np.ones((5, 3, 4))})
    with pytest.raises(StudyError, match=r"more dimensions each as a struct"):
        read_columns(path)


def test_a_wav_that_was_never_written_is_told_so(tmp_path: Path) -> None:
    path = tmp_path / "reserved.wav"
    path.write_bytes(b"RIFF\0\0\0\0WAVE" + bytes(4_000))
    with pytest.raises(StudyError, match="no format or no samples"):
        read_columns(path)


@pytest.mark.parametrize("rate_hz", [np.nan, np.inf, -2e4, 0.0])
def test_a_sample_rate_that_is_none(rate_hz: float, tmp_path: Path) -> None:
    path = tmp_path / "daq.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset("force", data=np.ones(9)).attrs["sample_rate_hz"] = rate_hz
    with pytest.raises(StudyError, match="force: its sample rate is"):
        read_columns(path)


def test_text_of_octave_is_named_with_the_way_out(tmp_path: Path) -> None:
    path = tmp_path / "day1.mat"  # what Octave's `save day1.mat fs` writes
    text = "# Created by Octave 7.3.0, Sun Nov 29 10:00:00 2026 UTC <lab@desk>\n# name: fs\n"
    path.write_text(text + "# type: scalar\n20000\n\n\n", encoding="ascii")
    with pytest.raises(StudyError, match=r"Octave's own text.*save it again with -v7"):
        read_columns(path)


def test_one_that_is_cut_while_it_is_read_is_not_taken_for_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, read = tmp_path / "swipe.csv", tables.read_text
    path.write_text("time,force\n" + "".join(f"{0.001 * i:.3f},0.1\n" for i in range(100)))

    def read_a_part(path: Path) -> columns.Columns:
        os.truncate(path, 11 + 10 * 40)  # at the end of a line
        return read(path)

    monkeypatch.setattr(tables, "read_text", read_a_part)
    with pytest.raises(StudyError, match=r"swipe\.csv changed while it was read"):
        read_columns(path)
