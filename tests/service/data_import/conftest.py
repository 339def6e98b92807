"""The same recording in every format, each made by the format's own library."""

import warnings
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pyarrow as pa
import pytest
from nptdms import ChannelObject, TdmsWriter
from pyarrow import parquet
from scipy import signal
from scipy.io import savemat, wavfile
from tests.service.data_import.made import Swipes, swipes

FULL_SCALE_N = 2.0


@pytest.fixture(scope="package")
def recorded() -> Swipes:
    return swipes(np.random.default_rng(20260301))


def table(one: Swipes) -> dict[str, np.ndarray]:
    """Name columns as people do, units in brackets; forces are those of the screen, in mN."""
    return {
        "time [s]": one.time_s,
        "U [V]": one.voltage_v,
        "Fx [mN]": -1e3 * one.force_x_n,
        "Fy [mN]": -1e3 * one.force_y_n,
        "Fz [mN]": -1e3 * one.force_z_n,
        "x [mm]": one.x_mm,
        "y [mm]": one.y_mm,
        "ax [m/s^2]": one.accel_m_s2[:, 0],
    }


def write_csv(one: Swipes, path: Path) -> None:
    columns = table(one)
    np.savetxt(
        path,
        np.column_stack(list(columns.values())),
        "%.8g",
        ",",
        header=",".join(columns),
        comments="",
    )


def write_tsv(one: Swipes, path: Path) -> None:
    """Write with a title, units in a line of their own, and a decimal comma."""
    columns = table(one)
    names = [name.split(" [")[0] for name in columns]
    units = [name.split(" [")[1][:-1] for name in columns]
    lines = ["measured on a tribometer", "\t".join(names), "\t".join(units)]
    rows = np.column_stack(list(columns.values()))
    lines += ["\t".join(f"{value:.8g}" for value in row).replace(".", ",") for row in rows]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def write_matlab(one: Swipes, path: Path) -> None:
    held = {
        "fs": one.rate_hz,
        "data": {
            "force_N": one.force_n,
            "acc": np.add(one.accel_m_s2, (0.0, 0.0, 9.81)),
            "u_V": one.voltage_v,
            "pos_mm": one.position_mm,
            "pos_t_s": one.position_t_s,
            "operator": "somebody",
        },
    }
    savemat(path, held, do_compression=True)


def write_matlab_73(one: Swipes, path: Path) -> None:
    """Write as MATLAB -v7.3 does: HDF5 behind a header of 512 bytes, axes reversed."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in {
            "fs": np.array([[one.rate_hz]]),
            "force": one.force_n.T,
            "u_V": one.voltage_v[np.newaxis],
            "pos_mm": one.position_mm.T,
            "pos_t_s": one.position_t_s[np.newaxis],
        }.items():
            stored = file.create_dataset(name, data=values)
            stored.attrs["MATLAB_class"] = np.bytes_("double")
        text = file.create_dataset("note", data=np.frombuffer(b"a\0b\0", dtype="<u2")[None])
        text.attrs["MATLAB_class"] = np.bytes_("char")
    with path.open("rb+") as stream:
        stream.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124, b" ") + b"\0\2IM")


def write_hdf5(one: Swipes, path: Path) -> None:
    """Write channels with units as attributes, and a drive at a quarter of the rate."""
    with h5py.File(path, "w") as file:
        file.attrs["sample_rate_hz"] = one.rate_hz
        for name, values, unit in (
            ("daq/Ft", one.force_x_n, "N"),
            ("daq/Fn", one.force_z_n, "N"),
            ("daq/skin_velocity", np.cumsum(one.accel_m_s2[:, 0]) / one.rate_hz, "m/s"),
            ("stage/velocity", np.gradient(one.x_mm, 1 / one.rate_hz), "mm/s"),
        ):
            file.create_dataset(name, data=values).attrs["unit"] = unit
        drive = 2.0 * np.square(one.voltage_v / 75.0)
        smooth = signal.butter(6, 1500.0, fs=one.rate_hz, output="sos")
        held = np.clip(signal.sosfiltfilt(smooth, drive)[::4], 0.0, 1.0)
        stored = file.create_dataset("dac/drive_fraction", data=held)
        stored.attrs["unit"] = "1"
        stored.attrs["sample_rate_hz"] = one.rate_hz / 4.0


def write_parquet(one: Swipes, path: Path) -> None:
    columns = table(one)
    fields = [
        pa.field(name.split(" [")[0], pa.float64(), metadata={"unit": name.split("[")[1][:-1]})
        for name in columns
    ]
    fields.append(pa.field("label", pa.string()))
    arrays = [pa.array(values) for values in columns.values()]
    arrays.append(pa.array(["swipe"] * one.time_s.size))
    parquet.write_table(pa.table(arrays, schema=pa.schema(fields)), path)


def write_tdms(one: Swipes, path: Path) -> None:
    def channel(name: str, values: np.ndarray, unit: str) -> ChannelObject:
        known = {
            "unit_string": unit,
            "wf_increment": 1.0 / one.rate_hz,
            "wf_start_time": np.datetime64("2026-03-01T10:00:00"),
        }
        return ChannelObject("daq", name, values, properties=known)

    with TdmsWriter(path) as writer:
        writer.write_segment(
            [
                channel("Fx", one.force_x_n, "N"),
                channel("Fz", one.force_z_n, "N"),
                channel("voltage", one.voltage_v / 50.0, "V"),
                channel("x", one.x_mm, "mm"),
            ]
        )


def write_wav(one: Swipes, path: Path) -> None:
    full = np.column_stack([one.force_x_n, one.force_z_n]) / FULL_SCALE_N
    wavfile.write(path, int(one.rate_hz), np.rint(32767 * full).astype(np.int16))


Writer = Callable[[Swipes, Path], None]
WRITERS: dict[str, tuple[Writer, list[str]]] = {
    "comma.csv": (write_csv, []),
    "tab.tsv": (write_tsv, []),
    "five.mat": (write_matlab, ["force_x.unit=N"]),
    "seven.mat": (write_matlab_73, []),
    "daq.h5": (write_hdf5, []),
    "table.parquet": (write_parquet, []),
    "labview.tdms": (write_tdms, ["drive_voltage.scale=50"]),
    "sound.wav": (
        write_wav,
        [
            "force_x.column=channel 1",
            "force_x.unit=N",
            f"force_x.scale={FULL_SCALE_N * 32768 / 32767}",
            "force_z.column=channel 2",
            "force_z.unit=N",
            f"force_z.scale={FULL_SCALE_N * 32768 / 32767}",
            "stage_speed_mm_s=80",
        ],
    ),
}
"""Each format: its writer, and what a person has to say beside the file."""


@pytest.fixture(params=WRITERS)
def stored(
    request: pytest.FixtureRequest, recorded: Swipes, tmp_path: Path
) -> tuple[Path, list[str]]:
    """A file of each format, and the answers it takes."""
    write, answers = WRITERS[request.param]
    path = tmp_path / request.param
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # npTDMS, of numpy's datetimes
        write(recorded, path)
    return path, answers
