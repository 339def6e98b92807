"""A file and its column map as one continuous recording, in the units and axes of a study."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_service.data_import.channels import BY_NAME, UNITS, find_unit
from frictus_service.data_import.column_map import ColumnMap, MappedColumn
from frictus_service.data_import.formats.columns import Column, Columns, named_rate_hz
from frictus_service.data_import.sampling import (
    COUNTER,
    Sampled,
    averaged,
    direction_of,
    held,
    of_length,
    on_grid,
    signed_counts,
)
from frictus_service.errors import FieldError, listed

END_TOLERANCE: Final = 0.02
"""Of the length of the recording by which channels may end apart."""
STAGE_HZ: Final = 100.0
"""At which the path of a stage of known speed is given at least: 30 Hz tell a motion."""
SLOWEST_LOG_HZ: Final = 1.0
"""Rows farther apart tell nothing of the path between them."""
MOST_PLACES: Final = 1 << 24
"""Two days of a path at `STAGE_HZ`; that of a longer log is given less finely."""


@dataclass(frozen=True, slots=True)
class MappedRecording:
    """A continuous recording; missing samples NaN.

    Attributes
    ----------
    rate_hz : float
        Of all sampled arrays.
    force_n : ndarray, shape (n, 3)
        N, or raw counts; NaN throughout along an axis that was not measured.
    force_unit : {'N', 'counts'}
        Of the force.
    voltage_v : ndarray, shape (n,), or None
        At the screen; None: no drive.
    crest : float
        Amplitude of the screen's voltage over the values that are kept: 1 with its carrier, the
        root of 2 where the carrier is left out.
    accel_m_s2 : ndarray, shape (n, 3), or None
    skin_velocity_m_s : ndarray, shape (n,), or None
    position_mm : ndarray, shape (k, 2)
        Empty where nothing says where the finger was.
    position_t_s : ndarray, shape (k,)
    notes : tuple of str
        What was assumed or changed; sentences.
    column_map : ColumnMap
        By which it was read, with what its own name says.
    """

    rate_hz: float
    force_n: FloatArray
    force_unit: str
    voltage_v: FloatArray | None
    crest: float
    accel_m_s2: FloatArray | None
    skin_velocity_m_s: FloatArray | None
    position_mm: FloatArray
    position_t_s: FloatArray
    notes: tuple[str, ...]
    column_map: ColumnMap

    @property
    def seconds(self) -> float:
        """Its length."""
        return len(self.force_n) / self.rate_hz


def apply_map(columns: Columns, column_map: ColumnMap) -> MappedRecording:
    """Return the recording that a file holds.

    Parameters
    ----------
    columns : Columns
        Of the file.
    column_map : ColumnMap

    Raises
    ------
    FieldError
        If the map does not fit the file; the text names the channel and what to do.
    """
    return _Mapped(columns, column_map).recording()


class _Mapped:
    """A file under its map."""

    def __init__(self, columns: Columns, column_map: ColumnMap) -> None:
        self._columns = {column.name: column for column in columns.columns}
        self._map = column_map
        self._file_rate_hz = named_rate_hz(columns.numbers)
        self._notes: list[str] = []

    def recording(self) -> MappedRecording:
        force = self._force()
        rate_hz, count = force.rate_hz, len(force.values)
        voltage = self._voltage(rate_hz, count)
        acceleration = self._vector("accel_", 0.0, rate_hz, count)
        if acceleration is not None and "accel_x" not in self._map.channels:
            acceleration = None  # zeros along the slide would be a dead sensor
            self._notes.append("the acceleration is left away: accel_x is not mapped")
        skin = self._sampled("skin_velocity")
        if skin is not None:
            skin = self._alongside("skin_velocity", skin, rate_hz, count)
        position_mm, position_t_s = self._position(force)
        unit = self._force_unit()
        return MappedRecording(
            rate_hz=rate_hz,
            force_n=force.values,
            force_unit=unit,
            voltage_v=voltage,
            crest=1.0 if "drive_voltage" in self._map.channels else np.sqrt(2.0),
            accel_m_s2=acceleration,
            skin_velocity_m_s=None if skin is None else skin.values * 1e-3,
            position_mm=position_mm,
            position_t_s=position_t_s - self._map.positions_late_s,
            notes=tuple(self._notes),
            column_map=self._map,
        )

    def _force(self) -> Sampled:
        names = [
            name for name in ("force_x", "force_z", "force_y") if name in self._map.channels
        ]
        if not names:
            raise FieldError(
                "force_x", f"no channel of force is mapped; columns: {self._listed()}"
            )
        first = self._sampled(names[0])
        assert first is not None
        rate_hz, count = first.rate_hz, len(first.values)
        values = self._vector("force_", np.nan, rate_hz, count)
        assert values is not None
        if "force_y" not in names and "force_x" in names:
            values[:, 1] = 0.0
        load_n = self._map.normal_load_n
        if load_n is not None:
            if "force_z" in names:
                raise FieldError("normal_load_n", "stands beside force_z; keep one of them")
            values[:, 2] = load_n
            self._notes.append(
                f"the normal force was not recorded: a dead weight of {load_n:g} N"
            )
        return Sampled(values, rate_hz)

    def _force_unit(self) -> str:
        units = {
            find_unit(mapped.unit) == "counts"
            for name, mapped in self._map.channels.items()
            if name.startswith("force_")
        }
        if len(units) > 1:
            raise FieldError("force_x", "some forces are counts, others not; give all in N")
        return "counts" if units.pop() else "N"

    def _vector(
        self, prefix: str, absent: float, rate_hz: float, count: int
    ) -> FloatArray | None:
        """Return three axes, `absent` where one is not mapped; None where none is."""
        values: FloatArray | None = None
        for axis, letter in enumerate("xyz"):
            sampled = self._sampled(prefix + letter)
            if sampled is None:
                continue
            if values is None:
                values = np.full((count, 3), absent)
            values[:, axis] = self._alongside(prefix + letter, sampled, rate_hz, count).values
        return values

    def _voltage(self, rate_hz: float, count: int) -> FloatArray | None:
        for name in ("drive_voltage", "drive_envelope", "drive_fraction"):
            sampled = self._sampled(name)
            if sampled is None:
                continue
            if name == "drive_fraction":
                if not np.nanmin(sampled.values) >= -1e-9:
                    raise FieldError(name, "is below 0; a drive fraction is 0 to 1")
                # First a voltage, so that the mean of its square is that of the fraction.
                peak_v = self._map.screen_peak_v * np.sqrt(np.maximum(sampled.values, 0.0))
                sampled = Sampled(peak_v, sampled.rate_hz)
            values = self._held(name, sampled, rate_hz, count)
            if name == "drive_voltage":
                return values
            # Its square gives the drive fraction that a carrier's gives in the mean.
            self._notes.append(
                f"{name} is kept as the voltage of the same drive without its carrier"
            )
            without_carrier: FloatArray = values / np.sqrt(2.0)
            return without_carrier
        return None

    def _held(self, name: str, sampled: Sampled, rate_hz: float, count: int) -> FloatArray:
        """Return the drive at the rate of the force: held, or the root of its mean square."""
        ratio = sampled.rate_hz / rate_hz
        if abs(ratio - 1.0) < 1e-6:
            return self._alongside(name, sampled, rate_hz, count).values
        self._check_end(name, sampled, rate_hz, count)
        if ratio < 1.0:
            self._notes.append(
                f"{name} has {sampled.rate_hz:g} Hz: each value is held until the next"
            )
            return held(sampled, rate_hz, count)
        whole = round(ratio)
        if abs(ratio - whole) > 1e-6:
            raise FieldError(
                name,
                f"has {sampled.rate_hz:g} Hz, the force {rate_hz:g} Hz; accepted: a lower "
                "rate, the same, or a whole multiple; resample it",
            )
        self._notes.append(f"{name} has {whole} times the rate: its mean power is kept")
        cut = sampled.values[: len(sampled.values) // whole * whole].reshape(-1, whole)
        mean: FloatArray = np.sqrt(np.square(cut).mean(axis=1))
        return of_length(mean, count)

    def _alongside(self, name: str, sampled: Sampled, rate_hz: float, count: int) -> Sampled:
        """Return a channel that must have the rate of the force, cut to its length."""
        if abs(sampled.rate_hz / rate_hz - 1.0) > 1e-6:
            raise FieldError(
                name,
                f"has {sampled.rate_hz:g} Hz, the force {rate_hz:g} Hz; accepted: the same; "
                "resample it to the force's (only a drive may be held)",
            )
        self._check_end(name, sampled, rate_hz, count)
        return Sampled(of_length(sampled.values, count), rate_hz)

    def _check_end(self, name: str, sampled: Sampled, rate_hz: float, count: int) -> None:
        ends_s, force_s = len(sampled.values) / sampled.rate_hz, count / rate_hz
        if abs(ends_s - force_s) > max(END_TOLERANCE * force_s, 2.0 / rate_hz):
            raise FieldError(
                name,
                f"lasts {ends_s:.4g} s, the force {force_s:.4g} s; give its rate_hz, or cut "
                "both to the same time",
            )

    def _position(self, force: Sampled) -> tuple[FloatArray, FloatArray]:
        places = [self._positions(name, force) for name in ("position_x", "position_y")]
        if places[0] is not None:
            time_s, x_mm = places[0]
            y_mm = np.zeros(x_mm.size) if places[1] is None else places[1][1]
            if y_mm.size != x_mm.size:
                raise FieldError("position_y", f"has {y_mm.size} rows, position_x {x_mm.size}")
            return averaged(np.column_stack([x_mm, y_mm]), time_s)
        velocity = self._sampled("velocity_x")
        speed: FloatArray
        if velocity is not None:
            self._check_end("velocity_x", velocity, force.rate_hz, len(force.values))
            step_s = 1.0 / velocity.rate_hz
            self._notes.append("the position is the integral of velocity_x")
            speed = velocity.values
        elif self._map.stage_speed_mm_s is not None and np.isfinite(force.values[:, 0]).any():
            step_s = 1.0 / force.rate_hz
            self._notes.append(
                f"neither position nor velocity was recorded: the stage moves at "
                f"{self._map.stage_speed_mm_s:g} mm/s as it was set, in the direction that the "
                "sign of the tangential force shows"
            )
            speed = self._map.stage_speed_mm_s * direction_of(force.values[:, 0], force.rate_hz)
        elif self._map.stage_speed_mm_s is not None:
            step_s = 1.0 / force.rate_hz
            self._notes.append("the whole recording is taken as one stroke of the stage")
            speed = np.full(len(force.values), self._map.stage_speed_mm_s)
        else:
            return np.empty((0, 2)), np.empty(0)
        if velocity is None and step_s * SLOWEST_LOG_HZ <= 1.0:
            # Between two samples of a slow log the stage moves on.
            finer = max(min(math.ceil(STAGE_HZ * step_s), MOST_PLACES // speed.size), 1)
            speed, step_s = np.repeat(speed, finer), step_s / finer
        missing = np.isnan(speed)
        there = np.flatnonzero(~missing)
        if missing.any() and there.size:
            self._notes.append(
                f"{missing.sum()} samples of velocity_x are missing: the way between is "
                "reckoned from the velocities around, and positions after them are estimates"
            )
            speed = np.interp(np.arange(speed.size), there, speed[there])
        travelled = np.cumsum(speed) * step_s
        travelled -= travelled.min()
        travelled[missing] = np.nan  # so that no stroke runs through a long gap
        path_mm = np.column_stack([travelled, np.zeros(travelled.size)])
        return averaged(path_mm, step_s * np.arange(float(travelled.size)))

    def _positions(self, name: str, force: Sampled) -> tuple[FloatArray, FloatArray] | None:
        mapped = self._map.channels.get(name)
        if mapped is None:
            return None
        column = self._column(name, mapped)
        clock = self._map.channels.get("position_time")
        if clock is None:
            sampled = self._sampled(name)
            assert sampled is not None
            self._check_end(name, sampled, force.rate_hz, len(force.values))
            return np.arange(len(sampled.values)) / sampled.rate_hz, sampled.values
        time_s = _kept(self._column("position_time", clock), clock)
        if time_s.size != column.values.size:
            raise FieldError(
                "position_time", f"has {time_s.size} rows, {name} {column.values.size}"
            )
        there = np.isfinite(time_s)
        time_s, values = time_s[there], _kept(column, mapped)[there]
        if not time_s.size or not np.all(np.diff(time_s) > 0.0):
            raise FieldError("position_time", "does not rise; accepted: rising times")
        return time_s - self._begins_s(), values

    def _begins_s(self) -> float:
        """Return the time of the first sample, on the file's clock."""
        clock = self._map.channels.get("time")
        if clock is None:
            return 0.0
        time_s = _kept(self._column("time", clock), clock)
        there = time_s[np.isfinite(time_s)]
        if not there.size:
            raise FieldError("time", "has no number; accepted: rising times, or none (time=)")
        return float(there[0])

    def _sampled(self, name: str) -> Sampled | None:
        """Return a channel in its unit, on a regular grid; None where it is not mapped."""
        mapped = self._map.channels.get(name)
        if mapped is None:
            return None
        column = self._column(name, mapped)
        values = _kept(column, mapped)
        said = mapped.rate_hz or column.rate_hz
        clock = self._map.channels.get("time")
        if said is None and clock is not None:
            times = self._column("time", clock)
            if times.values.size == values.size:
                found = on_grid(_kept(times, clock), values, self._map.rate_hz)
                if found.missing:
                    self._note_once(f"{found.missing} samples are missing, as the times show")
                return found
        rate_hz = said or self._map.rate_hz or self._file_rate_hz
        if rate_hz is None:
            raise FieldError(
                name,
                f"nothing says its sample rate, or the file has several; give {name}.rate_hz, "
                "or rate_hz for all",
            )
        return Sampled(values, rate_hz)

    def _note_once(self, note: str) -> None:
        if note not in self._notes:
            self._notes.append(note)

    def _column(self, name: str, mapped: MappedColumn) -> Column:
        found = self._columns.get(mapped.column)
        if found is None:
            raise FieldError(
                name, f"there is no column {mapped.column!r}; columns: {self._listed()}"
            )
        if found.values.size < 2 or not np.isfinite(found.values).any():
            raise FieldError(name, f"column {mapped.column!r} holds nothing but missing values")
        if BY_NAME[name].dimension == "length":
            counts = signed_counts(found.values)
            if counts is not None:
                self._note_once(
                    f"{mapped.column!r} is a counter of 32 bits: its numbers from "
                    f"{COUNTER / 2.0:.0f} on are taken as negative"
                )
                return replace(found, values=counts)
        return found

    def _listed(self) -> str:
        return listed([repr(name) for name in self._columns], 20)


def _kept(column: Column, mapped: MappedColumn) -> FloatArray:
    unit = find_unit(mapped.unit)
    assert unit is not None  # the map was checked
    factor = mapped.sign * mapped.scale * UNITS[unit].factor
    values = column.values if factor == 1.0 else column.values * factor
    kept: FloatArray = np.where(np.isfinite(values), values, np.nan)
    return kept


def mapped_of(column_map: ColumnMap) -> Iterator[str]:
    """Yield one line for each channel: its column, unit and sign."""
    for name, mapped in column_map.channels.items():
        sign = "" if mapped.sign == 1 else "-"
        scale = "" if mapped.scale == 1.0 else f" times {mapped.scale:g}"
        rate = "" if mapped.rate_hz is None else f" at {mapped.rate_hz:g} Hz"
        yield (
            f"{name} = {sign}{mapped.column!r}{scale} {mapped.unit}{rate}: "
            f"{BY_NAME[name].meaning}"
        )
