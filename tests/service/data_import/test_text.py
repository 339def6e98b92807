"""Text as laboratories have it: every value stays in its row and its column."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest

from frictus_service.data_import.formats import tables
from frictus_service.data_import.formats.read import read_columns
from frictus_service.data_import.formats.tables import read_text
from frictus_service.data_import.proposal import propose
from frictus_service.data_import.recordings_in_file import groups_of
from frictus_service.errors import StudyError


def columns_of(content: bytes, tmp_path: Path) -> dict[str, list[float]]:
    path = tmp_path / "table.csv"
    path.write_bytes(content)
    return {column.name: column.values.tolist() for column in read_text(path).columns}


@pytest.mark.parametrize("comment", ["old rig … new rig", "a\fb", "a\vb", "plain"])
@pytest.mark.parametrize("ending", ["\n", "\r\n", "\r"])
def test_a_comment_costs_no_row(comment: str, ending: str, tmp_path: Path) -> None:
    text = ending.join([f"# {comment}", "t;Fx", "0.0;1.0", "0.1;2.0", "0.2;3.0", ""])
    found = columns_of(text.encode("cp1252"), tmp_path)
    assert found == {"t": [0.0, 0.1, 0.2], "Fx": [1.0, 2.0, 3.0]}


def test_decimal_commas_that_the_first_row_does_not_show(tmp_path: Path) -> None:
    found = columns_of(b"t;Fx\n0;0\n0,1;0,5\n0,2;-7\n", tmp_path)
    assert found == {"t": [0.0, 0.1, 0.2], "Fx": [0.0, 0.5, -7.0]}


def test_two_whole_numbers_are_no_decimal(tmp_path: Path) -> None:
    """A row `0,12` is a decimal of one column, or two columns: the heading says which."""
    rows = b"0,12\n1,13\n2,14\n"
    assert columns_of(b"t,Fx\n" + rows, tmp_path) == {
        "t": [0.0, 1.0, 2.0],
        "Fx": [12.0, 13.0, 14.0],
    }
    assert columns_of(b"Fx\n" + rows, tmp_path) == {"Fx": [0.12, 1.13, 2.14]}
    with pytest.raises(StudyError, match="one number or two"):
        columns_of(rows, tmp_path)


def test_aligned_columns_keep_their_values(tmp_path: Path) -> None:
    """MATLAB's `save -ascii` and Fortran align numbers, with a space where a minus could be."""
    found = columns_of(b"   1.0e-01  -2.0e-01\n  -3.0e-01   4.0e-01\n", tmp_path)
    assert found == {"column 1": [0.1, -0.3], "column 2": [-0.2, 0.4]}
    found = columns_of(b"t Fx\r\n 0.1 -0.2 \r\n-0.3  0.4 \r\n", tmp_path)
    assert found == {"t": [0.1, -0.3], "Fx": [-0.2, 0.4]}


STEP = b"""
Step No. %d
Velocity = 240
Fx,Fz,X,T
g,g,mm,sec

1.0,-200.0,5.0,0.0
2.0,-200.0,6.0,0.1
3.0,-200.0,7.0,0.2
"""


def test_steps_of_a_tribometer_are_recordings(tmp_path: Path) -> None:
    """Each has its heading; a summary may end the file."""
    path = tmp_path / "test.csv"
    path.write_bytes(
        b"Created by a tribometer" + STEP % 1 + STEP % 2 + b"\nTotalTime\n00:12:56.5\n"
    )
    found = read_text(path)
    assert list(groups_of(found)) == ["section 1", "section 2"]
    assert {column.unit for column in found.columns} == {"g", "mm", "sec"}
    assert found.columns[-1].values.tolist() == [0.0, 0.1, 0.2]
    (told,) = found.notes
    assert told.endswith("the last 2 lines, from 'TotalTime' on")


def test_a_step_whose_first_column_is_empty(tmp_path: Path) -> None:
    path = tmp_path / "test.txt"
    path.write_bytes(2 * b"t\tFx\tx\n\t1.0\t2.0\n\t1.0\t2.1\n\n")
    found = read_text(path)
    assert [column.values.size for column in found.columns] == 6 * [2]


def test_a_last_row_that_was_not_written_whole_is_told(tmp_path: Path) -> None:
    path = tmp_path / "cut.csv"
    path.write_bytes(b"t,Fx,x\n0.0,1.0,2.0\n0.1,1.0,2.1\n0.2,1.")
    found = read_text(path)
    assert [column.values.size for column in found.columns] == [2, 2, 2]
    assert "'0.2,1.'" in found.notes[0]


@pytest.mark.parametrize("damaged", [b"0.1,1.0", b"broken", b"0.1,1.0,2.1,7", b"0.1,1.o,2.1"])
def test_a_damaged_row_is_refused(damaged: bytes, tmp_path: Path) -> None:
    with pytest.raises(pa.ArrowInvalid):
        columns_of(b"t,Fx,x\n0.0,1.0,2.0\n" + damaged + b"\n0.2,1.0,2.2\n", tmp_path)


@pytest.mark.parametrize(
    ("damaged", "told"),
    [
        (b"0.1,0x10,2.1", "row 2 of the numbers, column 'Fx': '0x10' is no number"),
        (b"0.1,1.0,2.1,7", "row 2 of the numbers has another number of columns: 4, others 3"),
    ],
)
def test_a_damaged_row_is_told_as_a_person_counts(
    damaged: bytes, told: str, tmp_path: Path
) -> None:
    path = tmp_path / "table.csv"
    path.write_bytes(b"of Monday\nt,Fx,x\n0.0,1.0,2.0\n" + damaged + b"\n0.2,1.0,2.2\n")
    with pytest.raises(StudyError, match=told):
        read_columns(path)


@pytest.mark.parametrize("missing", ["n/a", "N/A", "#N/A", "NULL", "None", "-nan", "1.#QNAN"])
def test_missing_samples_as_programs_write_them(missing: str, tmp_path: Path) -> None:
    """In the first row, too, which was taken for a heading."""
    rows = f"t,Fx\n0.0,{missing}\n0.1,2.0\n0.2,{missing}\n"
    found = columns_of(rows.encode(), tmp_path)
    assert found["t"] == [0.0, 0.1, 0.2]
    assert np.isnan(found["Fx"]).tolist() == [True, False, True]


def test_the_line_in_which_the_head_ends_tells_no_layout(tmp_path: Path) -> None:
    """Of a row whose divider is unknown, the beginning is one number."""
    path = tmp_path / "bars.csv"
    row = b"0.125|1.5\n"
    before = (tables.HEAD_BYTES - 5) // len(row) * len(row)
    path.write_bytes(b"x" * (tables.HEAD_BYTES - 5 - before - 1) + b"\n" + 7000 * row)
    with pytest.raises(StudyError, match="columns divided by comma"):
        read_columns(path)


def test_rows_that_end_in_a_delimiter_keep_their_heading(tmp_path: Path) -> None:
    """Programs that write each value with a comma after it do not write one in the heading."""
    found = columns_of(b"t,Fx,x\n0.0,1.0,2.0,\n0.1,1.5,2.5,\n", tmp_path)
    assert {name: found[name] for name in ("t", "Fx", "x")} == {
        "t": [0.0, 0.1],
        "Fx": [1.0, 1.5],
        "x": [2.0, 2.5],
    }


def test_a_time_beside_each_channel(tmp_path: Path) -> None:
    """As programs of NI write it; the line of units was the heading, and V a velocity."""
    path = tmp_path / "day.csv"
    lines = (
        "Timestamp,2026-03-01 10:11:12,Timestamp,2026-03-01 10:11:12",
        "Interval,0.001,Interval,{interval}",
        'Channel name,"Force",Channel name,"Input 1"',
        'Unit,"V",Unit,"mm"',
        "0,0.25,0,0.5",
        "0.001,0.25,0.001,0.5",
    )
    path.write_text("\n".join(lines).format(interval="0.001"))
    found = read_columns(path)
    assert [(column.name, column.unit) for column in found.columns] == [
        ("time", ""),
        ("Force", "V"),
        ("Input 1 time", ""),
        ("Input 1", "mm"),
    ]
    path.write_text("\n".join(lines).format(interval="0.002"))  # two clocks: none is proposed
    assert read_columns(path).columns[0].name == "Force time"


def test_a_heading_of_two_lines_with_the_unit_of_the_time(tmp_path: Path) -> None:
    """As setups of servo motors write it."""
    path = tmp_path / "axis.csv"
    path.write_bytes(b"Time,Analog 1\nms,Servo motor speed\n0.0,0.5\n0.5,0.5\n")
    found = read_columns(path)
    assert [(column.name, column.unit) for column in found.columns] == [
        ("Time", "ms"),
        ("Servo motor speed", ""),
    ]


LVM = """LabVIEW Measurement\t
Writer_Version\t2
Reader_Version\t2
Separator\tTab
Date\t2026/03/01
Time\t10:11:12{point}5
***End_of_Header***\t
\t
Channels\t2\t\t
Samples\t3\t3\t
Date\t2026/03/01\t2026/03/01\t
Y_Unit_Label\tNewtons\tPounds\t
X_Dimension\tTime\tTime\t
X0\t0{point}0E+0\t0{point}0E+0\t
Delta_X\t0{point}001\t0{point}001\t
***End_of_Header***\t\t\t
X_Value\tFx\tFz\tComment
"""


@pytest.mark.parametrize("point", [".", ","])
def test_measurements_of_labview(point: str, tmp_path: Path) -> None:
    """Its heading has a column for comments, which its rows lack, and units in a line."""
    path = tmp_path / "day.lvm"
    rows = [f"0{point}00{row}\t0{point}25\t0{point}5\r\n" for row in range(3)]
    path.write_text(LVM.format(point=point) + "".join(rows), encoding="utf-8", newline="")
    found = read_columns(path)
    assert {column.name: column.values.tolist() for column in found.columns} == {
        "X_Value": [0.0, 0.001, 0.002],
        "Fx": [0.25] * 3,
        "Fz": [0.5] * 3,
    }
    channels = propose(found).column_map.channels
    assert set(channels) == {"time", "force_x", "force_z"}
    assert (channels["force_x"].unit, channels["force_z"].unit) == ("N", "lbf")


@pytest.mark.parametrize(
    ("rows", "names"),
    [
        (
            "Channel name,Fx,Channel name,Fz,\n0,1,0,2,\n1,1,1,2,",
            ["Fx time", "Fx", "Fz time", "Fz", ""],
        ),
        (
            "Channel name,Fx,Channel name\n0,1,2\n1,1,2",
            ["Channel name", "Fx", "Channel name (3)"],
        ),
    ],
)
def test_a_time_beside_each_channel_and_a_column_more(
    rows: str, names: list[str], tmp_path: Path
) -> None:
    """A delimiter at the end makes none; what has no channel is no time of one."""
    path = tmp_path / "day.csv"
    path.write_text(rows)
    found = [column.name for column in read_columns(path).columns]
    assert found == [name or f"column {number}" for number, name in enumerate(names, 1)]
