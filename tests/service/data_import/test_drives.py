"""Drives as laboratories record them: with carrier, envelope, fraction, held, noise, none."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from frictus_hardware.arrays import FloatArray
from frictus_service.data_import.column_map import ColumnMap, parse_map
from frictus_service.data_import.drive_tones import find_tones
from frictus_service.data_import.formats.columns import Column, Columns
from frictus_service.data_import.motion import conditions_of, find_strokes
from frictus_service.data_import.proposal import propose
from frictus_service.data_import.recording import apply_map
from frictus_service.errors import FieldError
from frictus_service.identification.observation.response import drive_fraction

RATE_HZ = 10_000.0
SECONDS = 6.0
TIME_S = np.arange(round(SECONDS * RATE_HZ)) / RATE_HZ
MESSAGE = 0.5 + 0.3 * np.cos(2.0 * np.pi * 90.0 * TIME_S)


def to_and_fro(speeds_mm_s: tuple[float, ...]) -> FloatArray:
    """Return x, mm: one stroke of a second at each speed, half a second of rest between."""
    velocity = np.zeros(TIME_S.size)
    for number, speed in enumerate(speeds_mm_s):
        first = round(1.5 * number * RATE_HZ)
        velocity[first : first + round(RATE_HZ)] = speed * (-1.0) ** number
    return np.cumsum(velocity) / RATE_HZ


def recorded(
    drive: FloatArray, rate_hz: float, name: str, unit: str
) -> tuple[Columns, ColumnMap]:
    x_mm = to_and_fro((40.0, 40.0, 40.0, 40.0))
    columns = Columns(
        "text",
        (
            Column("Fx", 0.3 * np.sign(np.gradient(x_mm)), rate_hz=RATE_HZ),
            Column("Fz", np.full(TIME_S.size, 0.5), rate_hz=RATE_HZ),
            Column("x", x_mm, rate_hz=RATE_HZ),
            Column("drive", drive, rate_hz=rate_hz),
        ),
    )
    channels = {
        "force_x": {"column": "Fx", "unit": "N"},
        "force_z": {"column": "Fz", "unit": "N"},
        "position_x": {"column": "x", "unit": "mm"},
        name: {"column": "drive", "unit": unit},
    }
    return columns, parse_map({"channels": channels}, "test")


def test_every_kind_of_drive_is_the_same_drive() -> None:
    amplitude_v = 75.0 * np.sqrt(MESSAGE)
    carrier = np.cos(2.0 * np.pi * 7000.0 * TIME_S)
    for drive, name, unit in (
        (amplitude_v * carrier, "drive_voltage", "V"),
        (amplitude_v, "drive_envelope", "V"),
        (MESSAGE, "drive_fraction", "1"),
    ):
        found = apply_map(*recorded(drive, RATE_HZ, name, unit))
        assert found.voltage_v is not None
        fraction = drive_fraction(found.voltage_v, 75.0)
        assert fraction.mean() == pytest.approx(0.5, abs=1e-3)
        line = np.abs((fraction * np.exp(-2j * np.pi * 90.0 * TIME_S)).mean()) * 2.0
        assert line == pytest.approx(0.3, abs=1e-3)
        peak_v = found.crest * np.abs(found.voltage_v).max()
        assert peak_v == pytest.approx(75.0 * np.sqrt(0.8), rel=0.01)


def test_a_slow_drive_is_held() -> None:
    steps = np.arange(TIME_S.size // 8) / TIME_S.size
    columns, column_map = recorded(steps, RATE_HZ / 8.0, "drive_fraction", "1")
    found = apply_map(columns, column_map)
    assert found.voltage_v is not None
    fraction = drive_fraction(found.voltage_v, 75.0)
    np.testing.assert_allclose(fraction, np.repeat(steps, 8), atol=1e-12)
    assert any("each value is held until the next" in note for note in found.notes)


def test_a_fast_drive_keeps_its_power_and_an_odd_rate_is_refused() -> None:
    fast = np.repeat(MESSAGE, 3)
    found = apply_map(*recorded(75.0 * np.sqrt(fast), 3.0 * RATE_HZ, "drive_envelope", "V"))
    assert found.voltage_v is not None
    np.testing.assert_allclose(drive_fraction(found.voltage_v, 75.0), MESSAGE, atol=1e-9)
    odd = np.zeros(round(2.3 * TIME_S.size))
    with pytest.raises(FieldError, match="or a whole multiple; resample it"):
        apply_map(*recorded(odd, 2.3 * RATE_HZ, "drive_envelope", "V"))


def test_a_fast_fraction_keeps_its_mean() -> None:
    """Its root mean square was kept, which is larger where it varies between two samples."""
    within = np.tile([0.2, 0.8, 0.5, 0.9, 0.1, 0.3, 0.7, 0.1], TIME_S.size)
    found = apply_map(*recorded(within, 8.0 * RATE_HZ, "drive_fraction", "1"))
    assert found.voltage_v is not None
    np.testing.assert_allclose(drive_fraction(found.voltage_v, 75.0), 0.45, atol=1e-12)
    assert any("its mean power is kept" in note for note in found.notes)


def test_tones_noise_and_nothing(rng: np.random.Generator) -> None:
    two = 0.5 + 0.2 * np.cos(2.0 * np.pi * 61.7 * TIME_S) + 0.1 * np.sin(700.0 * np.pi * TIME_S)
    assert find_tones(two, RATE_HZ, 7000.0) == (61.7, 350.0)
    noise = 0.5 + 0.1 * rng.standard_normal(TIME_S.size)
    assert find_tones(noise, RATE_HZ, 7000.0) == ()
    assert find_tones(np.full(TIME_S.size, 0.5), RATE_HZ, 7000.0) is None
    # The carrier's second harmonic is no tone, where the rate folds it into the band.
    folded = 0.5 + 0.4 * np.cos(2.0 * np.pi * 300.0 * TIME_S)
    assert find_tones(folded, RATE_HZ, (RATE_HZ + 300.0) / 2.0) == ()


def test_strokes_of_any_mix_of_speeds() -> None:
    columns, column_map = recorded(MESSAGE, RATE_HZ, "drive_fraction", "1")
    x_mm = to_and_fro((150.0, 10.0, 60.0, 61.0))
    changed = tuple(
        replace(column, values=x_mm) if column.name == "x" else column
        for column in columns.columns
    )
    strokes = find_strokes(apply_map(replace(columns, columns=changed), column_map))
    assert [stroke.direction for stroke in strokes] == [1, -1, 1, -1]
    speeds = [stroke.speed_mm_s for stroke in strokes]
    np.testing.assert_allclose(speeds, [150.0, 10.0, 60.0, 61.0], rtol=0.02)
    assert all(early.last <= late.first for early, late in pairwise(strokes))
    for stroke in strokes:
        assert 0.8 * RATE_HZ < stroke.last - stroke.first <= 1.05 * RATE_HZ
    conditions = conditions_of(np.array(speeds))
    assert conditions[2] == conditions[3] == pytest.approx(60.5, rel=0.02)
    assert len(set(conditions)) == 3


def test_conditions_are_within_ten_percent(rng: np.random.Generator) -> None:
    values = np.exp(rng.uniform(0.0, 5.0, 300))
    middle = conditions_of(values)
    assert np.all(np.abs(values / middle - 1.0) <= 0.1)
    assert np.isnan(conditions_of(np.array([np.nan]))).all()


def test_a_voltage_that_is_never_negative_is_an_amplitude() -> None:
    x_mm = to_and_fro((40.0, 40.0, 40.0, 40.0))
    amplitude_v = 75.0 * np.sqrt(MESSAGE)
    carrier = np.cos(2.0 * np.pi * 7000.0 * TIME_S)
    for drive, name, asked in (
        (amplitude_v, "drive_envelope", []),
        (amplitude_v * carrier, "drive_voltage", []),
        (amplitude_v / 50.0, "drive_envelope", ["drive_envelope.scale"]),
    ):
        columns = Columns(
            "text",
            (
                Column("Fx", 0.3 * np.sign(np.gradient(x_mm)), "N", rate_hz=RATE_HZ),
                Column("Fz", np.full(TIME_S.size, 0.5), "N", rate_hz=RATE_HZ),
                Column("Weg", x_mm, "mm", rate_hz=RATE_HZ),
                Column("U", drive, "V", rate_hz=RATE_HZ),
            ),
        )
        proposal = propose(columns)
        assert set(proposal.column_map.channels) == {"force_x", "force_z", "position_x", name}
        assert [question.entry for question in proposal.questions] == asked
        assert all(f"set {name}.scale" in each.sentence for each in proposal.questions)


def test_an_acceleration_that_is_not_along_the_slide_is_left_away() -> None:
    columns, column_map = recorded(np.zeros(TIME_S.size), RATE_HZ, "accel_z", "m/s2")
    found = apply_map(columns, column_map)
    assert found.accel_m_s2 is None
    assert "the acceleration is left away: accel_x is not mapped" in found.notes
    columns, column_map = recorded(np.zeros(TIME_S.size), RATE_HZ, "accel_x", "m/s2")
    assert apply_map(columns, column_map).accel_m_s2 is not None
