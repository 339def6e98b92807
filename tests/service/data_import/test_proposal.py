"""What a file does not say is asked, whatever the numbers look like."""

import numpy as np

from frictus_service.data_import.channels import DRIVES
from frictus_service.data_import.formats.columns import Column, Columns
from frictus_service.data_import.proposal import Proposal, propose

TIME_S = np.arange(20_000) / 10_000.0
X_MM = 30.0 + 25.0 * np.sin(np.pi * TIME_S)
FORCE_N = 0.2 * np.sign(np.gradient(X_MM))


def proposed(*columns: Column) -> Proposal:
    known = (Column("t [s]", TIME_S), Column("x [mm]", X_MM))
    return propose(Columns("text", (*known, *columns)))


def asked(found: Proposal) -> set[str]:
    return {question.entry for question in found.questions}


def test_a_unit_that_is_not_known_is_asked_for() -> None:
    """A pressure of 0.4 kPa has the size of newtons."""
    force = Column("Fx [N]", FORCE_N)
    load = np.full(TIME_S.size, 0.4)
    for column in (Column("pressure [kPa]", load), Column("normal force", load, "kg")):
        found = proposed(force, column)
        assert asked(found) == {"force_z"}
        assert column.unit or "kPa" in found.questions[0].sentence
    assert not asked(proposed(force, Column("normal force", load, "-")))


def test_grams_of_a_load_cell_are_a_force() -> None:
    found = proposed(Column("Fx [g]", FORCE_N * 102.0), Column("Fz [g]", np.full(20_000, 41.0)))
    units = {name: mapped.unit for name, mapped in found.column_map.channels.items()}
    assert units == {"time": "s", "position_x": "mm", "force_x": "gf", "force_z": "gf"}
    found = proposed(Column("ax [g]", FORCE_N))
    assert found.column_map.channels["accel_x"].unit == "g"


def test_a_friction_coefficient_is_no_force() -> None:
    found = proposed(Column("friction coefficient", FORCE_N), Column("Fz [N]", X_MM))
    assert "force_x" in asked(found)
    assert "force_x" not in found.column_map.channels
    assert "force_x" in proposed(Column("friction [N]", FORCE_N)).column_map.channels


def test_axes_of_a_force_sensor_have_one_unit_whatever_their_order() -> None:
    """Friction of 2 may be newtons or grams, a normal force of 2 is none of grams."""
    axes = (Column("fx", 10.0 * FORCE_N), Column("fz", np.full(TIME_S.size, 2.0)))
    for columns in (axes, axes[::-1]):
        found = proposed(*columns)
        assert not asked(found)
        units = {name: mapped.unit for name, mapped in found.column_map.channels.items()}
        assert units["force_x"] == units["force_z"] == "N"
    for unit, entry in (("kPa", "force_z"), ("counts", "force_z.")):  # tell no unit of another
        other = Column("fz", np.full(TIME_S.size, 2.0), unit)
        assert asked(proposed(other, axes[0])) == {entry, "force_x.unit"}


def test_trials_in_a_matrix_are_no_axes() -> None:
    """Twenty trials of one force: the first three are not those of x, y and z."""
    trials = [Column(f"force:{n}", FORCE_N, "N") for n in range(1, 21)]
    assert asked(proposed(*trials)) == {"force_x", "force_z"}
    axes = proposed(*trials[:6]).column_map.channels
    assert [axes[f"force_{axis}"].column for axis in "xyz"] == ["force:1", "force:2", "force:3"]


def test_two_sample_rates_are_asked_for() -> None:
    """Of structs as MATLAB has them: `touch.fs` is not the rate of `daq.force`."""
    columns = (Column("daq.force:1", FORCE_N), Column("daq.force:3", X_MM))
    for numbers, is_open in (
        ({"daq.fs": 2e4, "touch.fs": 100.0}, True),
        ({"daq.fs": 2e4, "touch.fs": 2e4}, False),
        ({"fs_kHz": 20.0}, False),
    ):
        assert ("rate_hz" in asked(propose(Columns("MATLAB v5", columns, numbers)))) is is_open


def test_a_drive_is_known_by_its_unit_whatever_it_is_called() -> None:
    """A drive that is passed over in silence makes a study of blank trials."""
    carrier = np.cos(2.0 * np.pi * 2_000.0 * TIME_S)
    for column, channel in (
        (Column("cmd [V]", 75.0 * carrier), "drive_voltage"),
        (Column("command", 75.0 * carrier, "V"), "drive_voltage"),
        (Column("drive (%)", 50.0 + 50.0 * carrier), "drive_fraction"),
        (Column("amplitude [%]", 50.0 + 50.0 * carrier), "drive_fraction"),
    ):
        assert channel in proposed(column).column_map.channels, column.name
    assert not proposed(Column("command [N]", carrier)).column_map.channels.keys() & set(DRIVES)


def test_an_acceleration_as_matlab_can_name_it() -> None:
    """Names of variables have neither brackets nor strokes."""
    for name in ("acc_x_ms2", "ax_m_s2", "accel_x_mps2"):
        found = proposed(Column(name, FORCE_N)).column_map.channels["accel_x"]
        assert (found.column, found.unit) == (name, "m/s2")


def test_names_as_laboratories_shorten_them() -> None:
    """A vibrometer also tells where the skin is, which is no velocity."""
    found = proposed(
        Column("lat", FORCE_N),
        Column("nor", np.full(TIME_S.size, 0.4)),
        Column("LDVpos", 0.01 * FORCE_N),
        Column("LDVvel [mm/s]", 10.0 * FORCE_N),
    )
    mapped = {name: each.column for name, each in found.column_map.channels.items()}
    assert mapped["force_x"] == "lat"
    assert mapped["force_z"] == "nor"
    assert mapped["skin_velocity"] == "LDVvel [mm/s]"
    assert not asked(found)


def test_a_place_that_never_changes_is_no_position() -> None:
    """The stage of a rotary tribometer stands still; the disc turns."""
    still = Column("XYZ.X Position (mm)", np.full(TIME_S.size, 3.9))
    found = propose(Columns("text", (Column("t [s]", TIME_S), still)))
    assert "position_x" not in found.column_map.channels
    assert "'XYZ.X Position (mm)' never changes: it is no position" in found.reasons
    assert "stage_speed_mm_s" in asked(found)


def test_a_small_drive_is_no_kilovolts_and_its_unit_answers_not_its_gain() -> None:
    """A program writes what it asked of the amplifier: 0.4 V, without a unit."""
    found = proposed(Column("voltage", 0.4 * np.cos(2.0 * np.pi * 2_000.0 * TIME_S)))
    drive = {"drive_voltage.unit", "drive_voltage.scale"}
    assert asked(found) & drive == drive
    answered = found.answered(found.column_map, ["drive_voltage.unit=V"])
    assert asked(answered) & drive == {"drive_voltage.scale"}
    left_away = found.answered(found.column_map, ["drive_voltage="])
    assert not asked(left_away) & drive
    assert proposed(Column("voltage_v", 75.0 * FORCE_N)).column_map.channels.keys() & set(
        DRIVES
    )
