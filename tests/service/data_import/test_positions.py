"""Where the finger was: from positions or a velocity, at their own rate, with gaps."""

import numpy as np
import pytest

from frictus_hardware.arrays import FloatArray
from frictus_service.data_import.column_map import parse_map
from frictus_service.data_import.formats.columns import Column, Columns
from frictus_service.data_import.motion import find_strokes
from frictus_service.data_import.recording import MappedRecording, apply_map
from frictus_service.errors import FieldError

RATE_HZ = 10_000.0
SECONDS = 5.0
SPEED_MM_S = 20.0


def slide(name: str, unit: str, values: FloatArray, **said: float) -> MappedRecording:
    """Return one slide of 5 s under a steady force, with a channel of motion."""
    count = round(SECONDS * RATE_HZ)
    columns = Columns(
        "text",
        (
            Column("Fx", np.full(count, 0.2), rate_hz=RATE_HZ),
            Column("Fz", np.full(count, 0.4), rate_hz=RATE_HZ),
            Column("x", np.linspace(0.0, SPEED_MM_S * SECONDS, count), rate_hz=RATE_HZ),
            Column("motion", values),
        ),
    )
    channels: dict[str, object] = {
        "force_x": {"column": "Fx", "unit": "N"},
        "force_z": {"column": "Fz", "unit": "N"},
        name: {"column": "motion", "unit": unit, **said},
    }
    if name == "position_y":
        channels["position_x"] = {"column": "x", "unit": "mm"}
    return apply_map(columns, parse_map({"rate_hz": RATE_HZ, "channels": channels}, "test"))


@pytest.mark.parametrize(
    ("name", "unit"), [("position_x", "mm"), ("position_y", "mm"), ("velocity_x", "mm/s")]
)
def test_motion_of_another_rate_than_the_force_is_refused(name: str, unit: str) -> None:
    """Taken at the force's rate, a finger of 20 mm/s for 5 s was one of 200 mm/s for 0.5 s."""
    slow = SPEED_MM_S * np.arange(5000.0) / 1000.0
    with pytest.raises(
        FieldError, match=r"lasts 0.5 s, the force 5 s; give its rate_hz"
    ) as told:
        slide(name, unit, slow)
    assert told.value.field == name


def test_motion_of_another_rate_that_is_said_has_its_speed() -> None:
    steady = np.full(5000, SPEED_MM_S)
    for name, unit, values in (
        ("position_x", "mm", np.cumsum(steady) / 1000.0),
        ("velocity_x", "mm/s", steady),
    ):
        (stroke,) = find_strokes(slide(name, unit, values, rate_hz=1000.0))
        assert stroke.speed_mm_s == pytest.approx(SPEED_MM_S, rel=1e-3)
        assert (stroke.last - stroke.first) / RATE_HZ == pytest.approx(SECONDS, abs=0.1)


def test_late_positions_are_taken_when_they_were() -> None:
    """The finger rests for a second before it slides; its sensor tells so 40 ms later."""
    time_s = np.arange(SECONDS * RATE_HZ) / RATE_HZ
    place = SPEED_MM_S * np.clip(time_s - 1.0 - 0.04, 0.0, None)
    columns = Columns(
        "text",
        tuple(
            Column(name, values, rate_hz=RATE_HZ)
            for name, values in (
                ("Fx", np.full(time_s.size, 0.2)),
                ("Fz", np.full(time_s.size, 0.4)),
                ("x", place),
            )
        ),
    )
    units = {"force_x": ("Fx", "N"), "force_z": ("Fz", "N"), "position_x": ("x", "mm")}
    channels = {
        name: {"column": column, "unit": unit} for name, (column, unit) in units.items()
    }
    plain = {"rate_hz": RATE_HZ, "channels": channels}
    begins = []
    for late_s in (0.0, 0.04):
        column_map = parse_map(plain | {"positions_late_s": late_s}, "test")
        (stroke,) = find_strokes(apply_map(columns, column_map))
        begins.append(stroke.first / RATE_HZ)
    assert begins[0] - begins[1] == pytest.approx(0.04, abs=0.01)


def test_an_encoder_that_is_turned_back_beyond_zero() -> None:
    """Its counter has no sign: from 0 it goes to 4294967295."""
    way = np.rint(np.linspace(40.0, -60.0, round(SECONDS * RATE_HZ)) / 0.0005)
    found = slide("position_x", "mm", np.mod(way, 2.0**32), scale=0.0005, rate_hz=RATE_HZ)
    assert found.position_mm[[0, -1], 0] == pytest.approx([40.0, -60.0], abs=0.1)
    (stroke,) = find_strokes(found)
    assert stroke.direction == -1
    assert stroke.speed_mm_s == pytest.approx(SPEED_MM_S, rel=1e-3)
    assert any("'motion' is a counter of 32 bits" in note for note in found.notes)
    small = slide("position_x", "um", np.linspace(0.0, 1e5, 50_000), rate_hz=RATE_HZ)
    assert not any("counter" in note for note in small.notes)


def test_a_finger_does_not_stand_still_where_its_velocity_is_missing() -> None:
    """It speeds up from 20 to 40 mm/s; of the second from 2 to 3 s nothing is known."""
    time_s = np.arange(SECONDS * RATE_HZ) / RATE_HZ
    velocity = np.interp(time_s, [2.0, 3.0], [20.0, 40.0])
    gap = (time_s > 2.0) & (time_s < 3.0)
    found = slide("velocity_x", "mm/s", np.where(gap, np.nan, velocity))
    at_s, x_mm = found.position_t_s, found.position_mm[:, 0]
    inside = np.isnan(x_mm)
    np.testing.assert_allclose(at_s[inside][[0, -1]], [2.0, 3.0], atol=0.01)
    assert inside.sum() == pytest.approx(200, abs=2)
    before, after = at_s < 1.99, at_s > 3.01
    np.testing.assert_allclose(x_mm[before], 20.0 * at_s[before], atol=0.01)
    np.testing.assert_allclose(x_mm[after], 70.0 + 40.0 * (at_s[after] - 3.0), atol=0.01)
    assert any(f"{gap.sum()} samples of velocity_x are missing" in note for note in found.notes)
    early, late = find_strokes(found)
    assert (early.speed_mm_s, late.speed_mm_s) == pytest.approx((20.0, 40.0), rel=1e-3)
    assert early.last / RATE_HZ < 2.01
    assert late.first / RATE_HZ > 2.99


@pytest.mark.filterwarnings("ignore:overflow")
def test_a_velocity_too_large_for_a_number_gives_no_stroke() -> None:
    assert not find_strokes(slide("velocity_x", "m/s", np.full(50_000, 1e307)))


def test_an_excerpt_of_two_rows_still_says_where_the_finger_was() -> None:
    """It was averaged over more reports than there are, which left none."""
    rows = [np.full(2, 0.2), np.full(2, 0.4), np.array([10.0, 10.1])]
    columns = Columns(
        "text",
        tuple(
            Column(name, values, rate_hz=RATE_HZ)
            for name, values in zip(("Fx", "Fz", "x"), rows, strict=True)
        ),
    )
    channels = {
        "force_x": {"column": "Fx", "unit": "N"},
        "force_z": {"column": "Fz", "unit": "N"},
        "position_x": {"column": "x", "unit": "mm"},
    }
    found = apply_map(columns, parse_map({"rate_hz": RATE_HZ, "channels": channels}, "test"))
    np.testing.assert_array_equal(found.position_mm[:, 0], [10.0, 10.1])
