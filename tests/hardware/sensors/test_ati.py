"""Calibration files: every unit, and everything that is refused with its place."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.hardware.sensors.calibration_file import (
    DISTANCE_M,
    FORCE_N,
    TORQUE_N_M,
    CalibrationFile,
    gauge_matrix,
)

from frictus_hardware.errors import ConfigError
from frictus_hardware.sensors.analogue import ForceCalibration
from frictus_hardware.sensors.ati import LARGEST_BYTES, parse_calibration, read_calibration

FILE = CalibrationFile(gauge_matrix())


def parsed(text: str) -> ForceCalibration:
    return parse_calibration(text.encode(), "FT01234.cal")


@pytest.mark.parametrize("force_units", FORCE_N)
@pytest.mark.parametrize("torque_units", TORQUE_N_M)
def test_the_matrix_is_in_newton_and_newton_metre_whatever_the_file_uses(
    force_units: str, torque_units: str
) -> None:
    for distance_units in DISTANCE_M:
        file = replace(
            FILE,
            force_units=force_units,
            torque_units=torque_units,
            distance_units=distance_units,
            distance_m=(0.003, -0.002, 0.012),
        )
        for one in (file, replace(file, basic=False), replace(file, user=False)):
            matrix = parsed(one.text()).matrix
            np.testing.assert_allclose(matrix, FILE.matrix, rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize(
    ("angles_deg", "turned"),
    [
        # Turned by 90 degrees about z, the new x axis lies where y was.
        ((0.0, 0.0, 90.0), [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]),
        ((90.0, 0.0, 0.0), [[1, 0, 0], [0, 0, 1], [0, -1, 0]]),
        ((0.0, 90.0, 0.0), [[0, 0, -1], [0, 1, 0], [1, 0, 0]]),
        # Then about z as it now lies: x before, the turned z after.
        ((90.0, 0.0, 90.0), [[0, 0, 1], [-1, 0, 0], [0, -1, 0]]),
    ],
)
def test_a_turned_basic_transform_turns_the_axes(
    angles_deg: tuple[float, float, float], turned: list[list[int]]
) -> None:
    file = replace(
        FILE, angles_deg=angles_deg, turned=np.array(turned, dtype=np.float64), user=False
    )
    np.testing.assert_allclose(parsed(file.text()).matrix, FILE.matrix, rtol=1e-7, atol=1e-9)
    radians = ' AngleUnits="radians" OutputMode'
    text = file.text().replace(" OutputMode", radians)
    for axis, angle in zip("xyz", angles_deg, strict=True):
        text = text.replace(f'R{axis}="{angle}"', f'R{axis}="{math.radians(angle)!r}"')
    np.testing.assert_allclose(parsed(text).matrix, FILE.matrix, rtol=1e-7, atol=1e-9)


def test_what_else_the_file_says() -> None:
    calibration = parsed(FILE.text())
    assert calibration.serial == "FT01234"
    assert calibration.body_style == "Nano43"
    assert calibration.output_mode == "Ground Referenced Differential"
    assert calibration.gauge_range_v == (-10.0, 10.0)
    assert not calibration.software_temperature
    with pytest.raises(ValueError, match="read-only"):
        calibration.matrix[0, 0] = 0.0
    unipolar = parsed(FILE.text().replace('Bipolar="True"', 'Bipolar="False"'))
    assert unipolar.gauge_range_v == (0.0, 20.0)
    slopes = replace(FILE, extra='<BiasSlope values="0 0 0 0 0 0"/>')
    assert parsed(slopes.text()).software_temperature


def test_rows_are_taken_by_name_and_gauges_by_place() -> None:
    text = replace(FILE, basic=False).text()
    lines = text.split("\n")
    shuffled = "\n".join([*lines[:4], *reversed(lines[4:10]), *lines[10:]])
    np.testing.assert_allclose(parsed(shuffled).matrix, FILE.matrix)
    swapped = replace(FILE, matrix=FILE.matrix[:, ::-1], basic=False)
    np.testing.assert_allclose(parsed(swapped.text()).matrix, FILE.matrix[:, ::-1])


def test_rounding_of_the_maker_is_accepted_and_a_contradiction_is_not() -> None:
    parsed(replace(FILE, decimals=5).text())
    text = FILE.text()
    for was, then in [
        ('Dz="0.012"', 'Dz="0.024"'),
        ('scale="45.0"', 'scale="44.0"'),
        ('<UserAxis Name="Fx"', '<UserAxis Name="Fy"'),
    ]:
        assert was in text
        with pytest.raises(ConfigError, match=r"FT01234\.cal: UserAxis"):
            parsed(text.replace(was, then))


@pytest.mark.parametrize(
    ("was", "then", "place", "accepted"),
    [
        ('Serial="FT01234"', "", "FTSensor@Serial is missing", "text"),
        ('BodyStyle="Nano43"', 'BodyStyle=" "', "FTSensor@BodyStyle is ' '", "text"),
        ('NumGages="6"', 'NumGages="5"', "FTSensor@NumGages is '5'", "6 gauges"),
        ('NumGages="6"', "", "FTSensor@NumGages is missing", "1 finite number"),
        ('ForceUnits="N"', 'ForceUnits="pond"', "Calibration@ForceUnits is 'pond'", "lbf"),
        ('TorqueUnits="N-m"', "", "Calibration@TorqueUnits is missing", "N-mm"),
        ('DistUnits="m"', 'DistUnits="mile"', "Calibration@DistUnits is 'mile'", "mm"),
        ('OutputMode="Ground Referenced Differential"', "", "@OutputMode is missing", "text"),
        ('OutputRange="20"', 'OutputRange="0"', "@OutputRange is '0'", "above 0"),
        ('OutputRange="20"', 'OutputRange="inf"', "@OutputRange is 'inf'", "finite"),
        ('OutputBipolar="True"', "", "@OutputBipolar is missing", "True"),
        ('scale="0.7"', 'scale="-0.7"', "Axis[Fz]@scale is '-0.7'", "above 0"),
        ('scale="0.7"', "", "Axis[Fz]@scale is missing", "1 finite number"),
        ('Dx="0.0"', 'Dx="nan"', "BasicTransform@Dx is 'nan'", "finite"),
        ('Rz="0.0"', "", "BasicTransform@Rz is missing", "finite"),
        ('<Axis Name="Tz"', '<Axis Name="Ty"', "Axis@Name", "once"),
        ('<Axis Name="Tz"', '<Axle Name="Tz"', "Axis@Name", "once"),
        ('<UserAxis Name="Tz"', '<UserAxis Name="Mz"', "UserAxis@Name", "once"),
        ("<BasicTransform ", "<BasicTransform/><BasicTransform ", "2 elements", "exactly one"),
    ],
)
def test_a_fault_is_told_with_its_place_and_what_is_accepted(
    was: str, then: str, place: str, accepted: str
) -> None:
    text = FILE.text()
    assert was in text
    with pytest.raises(ConfigError) as caught:
        parsed(text.replace(was, then, 1))
    message = str(caught.value)
    assert message.startswith("FT01234.cal: ")
    assert place in message
    assert accepted in message


@pytest.mark.parametrize(
    "values", ["", "1 2 3 4 5", "1 2 3 4 5 6 7", "1 2 3 4 5 nan", "1 2 x 4 5 6"]
)
@pytest.mark.parametrize("tag", ["Axis", "UserAxis"])
def test_six_finite_numbers_are_needed(tag: str, values: str) -> None:
    lines = FILE.text().split("\n")
    changed = [
        f'<{tag} Name="Ty" values="{values}" scale="1"/>'
        if line.startswith(f'<{tag} Name="Ty"')
        else line
        for line in lines
    ]
    with pytest.raises(ConfigError, match=rf"{tag}\[Ty\]@values .* 6 finite numbers"):
        parsed("\n".join(changed))


def test_no_rows_no_calibration_and_two_calibrations_are_refused() -> None:
    with pytest.raises(ConfigError, match="no UserAxis"):
        parsed(replace(FILE, user=False, basic=False).text())
    with pytest.raises(ConfigError, match="0 elements Calibration"):
        parsed('<FTSensor NumGages="6"/>')
    text = FILE.text()
    inner = text[text.index("<Calibration") : text.index("</FTSensor>")]
    with pytest.raises(ConfigError, match="2 elements Calibration"):
        parsed(text.replace("</FTSensor>", inner + "</FTSensor>"))


@pytest.mark.parametrize("row", range(6))
def test_a_singular_matrix_is_refused(row: int) -> None:
    for other in (np.zeros(6), FILE.matrix[(row + 1) % 6]):
        matrix = FILE.matrix.copy()
        matrix[row] = other
        with pytest.raises(ConfigError, match="singular"):
            parsed(replace(FILE, matrix=matrix, basic=False).text())


@pytest.mark.parametrize(
    ("data", "why"),
    [
        (b"", "not well-formed"),
        (b"<FTSensor", "not well-formed"),
        (b"<FTSensor/>\0", "not well-formed"),
        (b"<Sensor/>", "<FTSensor> is accepted"),
        (b"\xff\xfe<\0F\0T\0", "not UTF-8"),
        (b'<!DOCTYPE a [<!ENTITY b "c">]><FTSensor>&b;</FTSensor>', "document types"),
        (b'<!DOCTYPE a SYSTEM "file:///etc/passwd"><FTSensor/>', "document types"),
        (b"<FTSensor>&b;</FTSensor>", "not well-formed"),
        (b"<FTSensor>" + b" " * LARGEST_BYTES + b"</FTSensor>", "at most 65536 bytes"),
        (b"<a>" * 20_000, "not well-formed"),
    ],
)
def test_hostile_files_are_refused_before_they_do_harm(data: bytes, why: str) -> None:
    with pytest.raises(ConfigError, match=why):
        parse_calibration(data, "a.cal")


def test_a_declared_encoding_other_than_the_real_one_changes_nothing() -> None:
    text = FILE.text().replace('encoding="utf-8"', 'encoding="utf-16"')
    np.testing.assert_allclose(parsed("\ufeff" + text).matrix, FILE.matrix)


def test_files_are_read_from_disk(tmp_path: Path) -> None:
    path = tmp_path / "FT01234.cal"
    with pytest.raises(ConfigError, match="cannot be read"):
        read_calibration(path)
    with pytest.raises(ConfigError, match="cannot be read"):
        read_calibration(tmp_path)
    path.write_text(FILE.text(), encoding="utf-8")
    assert read_calibration(path).serial == "FT01234"
    path.write_bytes(b" " * (LARGEST_BYTES + 1))
    with pytest.raises(ConfigError, match=r"FT01234\.cal: at most"):
        read_calibration(path)
