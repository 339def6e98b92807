"""Sweeps of the finger, from its reported position."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Self

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from frictus_hardware.arrays import BoolArray, FloatArray

WINDOW_S = 0.07
"""Velocity is the slope of a straight line through the reports of so long before and after."""

GAP_S = 0.15
"""A longer silence of the sensor ends a sweep: where the finger was meanwhile is unknown."""

STRAY_MM = 4.0
"""A report so far from the median of five is an error of the sensor: at 200 mm/s, the tip of a
reversal is 3.4 mm from it."""

REST_MM_S = 2.0
"""Below this the finger rests, and electrostatic friction fades."""

REST_SHARE = 0.25
"""So is it below this share of the trial's brisk speed, its upper quartile."""

STEADY_SHARE = 0.8
"""A sweep begins and ends where it reaches this share of its own median speed."""

MARGIN_S = 0.02
"""Cut off at both ends besides: what a reversal excites in mount and finger rings down."""

LEAST_TRAVEL_MM = 3.0
LEAST_SWEEP_S = 0.1


@dataclass(frozen=True, slots=True)
class TouchMotion:
    """The finger at those reports around which its velocity is known.

    Attributes
    ----------
    time_s : ndarray, shape (k,)
        Rising.
    reported_mm : ndarray, shape (k, 2)
        Position as the sensor says it.
    position_mm, velocity_mm_s : ndarray, shape (k, 2)
        Smoothed.
    """

    time_s: FloatArray
    reported_mm: FloatArray
    position_mm: FloatArray
    velocity_mm_s: FloatArray

    @property
    def speed_mm_s(self) -> FloatArray:
        """Magnitude of the velocity, shape (k,)."""
        speed: FloatArray = np.hypot(self.velocity_mm_s[:, 0], self.velocity_mm_s[:, 1])
        return speed

    def position_at(self, time_s: FloatArray) -> FloatArray:
        """Return the smoothed position at given times, shape (n, 2); at its ends it goes on."""
        inside = np.clip(time_s, self.time_s[0], self.time_s[-1])
        beyond = time_s - inside
        velocity = np.where(beyond[:, np.newaxis] < 0.0, *self.velocity_mm_s[[0, -1]])
        place = [np.interp(inside, self.time_s, axis) for axis in self.position_mm.T]
        return np.column_stack(place) + beyond[:, np.newaxis] * velocity

    def within(self, sweep: "Sweep") -> "TouchMotion":
        """Return the motion in a sweep by its own reports: its turns bend it at both ends.

        Speeds in the outer thirds of strokes of 60 mm would be 0.7 % too low at 100 mm/s. A
        sweep with too few reports keeps the lines through all.
        """
        begin, end = sweep.begin_s - MARGIN_S, sweep.end_s + MARGIN_S
        own = (self.time_s >= begin) & (self.time_s <= end)
        found = _lines(self.time_s[own], self.reported_mm[own])
        return found if found.time_s.size else self


@dataclass(frozen=True, slots=True)
class Sweep:
    """One steady movement in one direction.

    Attributes
    ----------
    direction : int
        +1 left to right, -1 right to left.
    begin_s, end_s : float
        From the first sample of the trial.
    """

    direction: int
    begin_s: float
    end_s: float


@dataclass(frozen=True, slots=True)
class SweepThird:
    """The part of a sweep that lies in one third of the stroke.

    Attributes
    ----------
    sweep : int
        Number of the sweep in its trial.
    direction : int
        +1 left to right, -1 right to left.
    third : int
        0, 1, 2 from left to right.
    begin_s, end_s : float
        From the first sample of the trial.
    speed_mm_s : float
        Mean along `along`.
    along : tuple of float
        Unit vector of the motion.
    position_mm : float
        Middle of its path, x.
    """

    sweep: int
    direction: int
    third: int
    begin_s: float
    end_s: float
    speed_mm_s: float
    along: tuple[float, float]
    position_mm: float

    @classmethod
    def between(
        cls,
        path: TouchMotion,
        sweep: Sweep,
        begin_s: float,
        end_s: float,
        *,
        number: int = 0,
        third: int = 0,
    ) -> Iterator[Self]:
        """Yield the part of a sweep between two times; nothing where the finger stood still.

        Parameters
        ----------
        path : TouchMotion
            Of `TouchMotion.within` the sweep.
        sweep : Sweep
            Which it is a part of.
        begin_s, end_s : float
            Within the sweep, rising.
        number, third : int
            See `sweep` and `third` above.
        """
        begin, end = path.position_at(np.array([begin_s, end_s]))
        travel_x_mm, travel_y_mm = (end - begin).tolist()
        length_mm = math.hypot(travel_x_mm, travel_y_mm)
        if length_mm > 0.0:
            yield cls(
                number,
                sweep.direction,
                third,
                begin_s,
                end_s,
                length_mm / (end_s - begin_s),
                (travel_x_mm / length_mm, travel_y_mm / length_mm),
                float(begin[0] + end[0]) / 2.0,
            )


def smooth(position_mm: FloatArray, position_t_s: FloatArray) -> TouchMotion:
    """Return position and velocity by local straight lines; strays and silences left out.

    Parameters
    ----------
    position_mm : ndarray, shape (k, 2)
        As reported; NaN where a report is missing.
    position_t_s : ndarray, shape (k,)
        Rising.
    """
    there = np.isfinite(position_t_s) & np.isfinite(position_mm).all(axis=1)
    time, place = position_t_s[there], position_mm[there]
    if time.size >= 5:
        padded = np.pad(place, ((2, 2), (0, 0)), mode="edge")
        middle = np.median(sliding_window_view(padded, 5, axis=0), axis=-1)
        kept = np.abs(place - middle).max(axis=1) <= STRAY_MM
        time, place = time[kept], place[kept]
    parts = [_lines(time[run], place[run]) for run in _runs(np.diff(time) <= GAP_S)]
    if not parts:
        return TouchMotion(np.empty(0), *np.empty((3, 0, 2)))
    return TouchMotion(
        np.concatenate([part.time_s for part in parts]),
        np.concatenate([part.reported_mm for part in parts]),
        np.concatenate([part.position_mm for part in parts]),
        np.concatenate([part.velocity_mm_s for part in parts]),
    )


def _runs(joined: BoolArray) -> Iterator[slice]:
    """Yield the runs of items of which each is joined to the next."""
    breaks = np.flatnonzero(~joined) + 1
    edges = [0, *breaks.tolist(), joined.size + 1]
    for first, last in pairwise(edges):
        yield slice(first, last)


def _lines(time: FloatArray, place: FloatArray) -> TouchMotion:
    """Return the straight line around each report, where at least four reports carry it."""
    low = np.searchsorted(time, time - WINDOW_S, side="left")
    high = np.searchsorted(time, time + WINDOW_S, side="right")

    def around(values: FloatArray) -> FloatArray:
        total = np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(values, axis=0)])
        summed: FloatArray = total[high] - total[low]
        return summed

    count = (high - low).astype(np.float64)
    clock = time - time.mean() if time.size else time
    mean_time = around(clock) / count
    mean_place = around(place) / count[:, np.newaxis]
    spread = around(np.square(clock)) / count - np.square(mean_time)
    moved = around(clock[:, np.newaxis] * place) / count[:, np.newaxis]
    moved -= mean_time[:, np.newaxis] * mean_place
    known = (count >= 4) & (spread > 0.0)
    velocity = moved[known] / spread[known, np.newaxis]
    since = (clock - mean_time)[known, np.newaxis]
    smoothed = mean_place[known] + since * velocity
    return TouchMotion(time[known], place[known], smoothed, velocity)


def rest_mm_s(motion: TouchMotion) -> float:
    """Return the speed along x below which the finger rests or turns."""
    if not motion.time_s.size:
        return REST_MM_S
    brisk = float(np.quantile(np.abs(motion.velocity_mm_s[:, 0]), 0.75))
    return max(REST_MM_S, REST_SHARE * brisk)


def find_sweeps(motion: TouchMotion, pressed: BoolArray) -> list[Sweep]:
    """Return the sweeps of a trial, in time.

    Parameters
    ----------
    motion : TouchMotion
        Position and velocity at the reports.
    pressed : ndarray of bool, shape (k,)
        Whether the finger is on the screen at each report.
    """
    if motion.time_s.size < 2:
        return []
    along, across = motion.velocity_mm_s.T
    moving = pressed & (np.abs(along) > np.maximum(rest_mm_s(motion), np.abs(across)))
    heading = np.where(moving, np.sign(along), 0.0)
    joined = (heading[1:] == heading[:-1]) & (np.diff(motion.time_s) <= GAP_S)
    found = (_steady(motion, run, int(heading[run.start])) for run in _runs(joined))
    return [sweep for sweep in found if sweep is not None]


def _steady(motion: TouchMotion, run: slice, direction: int) -> Sweep | None:
    """Return what is steady of a run of reports in one direction; None where too short."""
    if direction == 0:
        return None
    time = motion.time_s[run]
    speed = motion.speed_mm_s[run]
    steady = np.flatnonzero(speed >= STEADY_SHARE * np.median(speed))
    begin, end = time[steady[0]] + MARGIN_S, time[steady[-1]] - MARGIN_S
    if end - begin < LEAST_SWEEP_S:
        return None
    left, right = motion.position_at(np.array([begin, end]))[:, 0]
    if direction * (right - left) < LEAST_TRAVEL_MM:
        return None
    return Sweep(direction, float(begin), float(end))


def cut_thirds(motion: TouchMotion, sweeps: list[Sweep]) -> list[SweepThird]:
    """Cut sweeps where they pass from one third of the stroke to the next.

    Parameters
    ----------
    motion : TouchMotion
        Position and velocity at the reports.
    sweeps : list of Sweep
        The stroke is the range of x that all of them together cover.
    """
    if not sweeps:
        return []
    paths = [motion.within(sweep) for sweep in sweeps]
    ends = [
        path.position_at(np.array([sweep.begin_s, sweep.end_s]))[:, 0]
        for path, sweep in zip(paths, sweeps, strict=True)
    ]
    walls = np.linspace(np.min(ends), np.max(ends), 4)[1:3]
    return [
        third
        for number, (path, sweep) in enumerate(zip(paths, sweeps, strict=True))
        for third in _thirds(path, number, sweep, walls)
    ]


def _thirds(
    path: TouchMotion, number: int, sweep: Sweep, walls: FloatArray
) -> Iterator[SweepThird]:
    """Yield the part of a sweep in each third of the stroke, in time."""
    inside = (path.time_s > sweep.begin_s) & (path.time_s < sweep.end_s)
    time = np.concatenate([[sweep.begin_s], path.time_s[inside], [sweep.end_s]])
    along = sweep.direction * path.position_at(time)[:, 0]
    ahead = sweep.direction * walls[:: sweep.direction]
    passed = np.interp(ahead, np.maximum.accumulate(along), time).tolist()
    thirds = (0, 1, 2) if sweep.direction > 0 else (2, 1, 0)
    edges = [sweep.begin_s, *passed, sweep.end_s]
    for third, begin, end in zip(thirds, edges[:-1], edges[1:], strict=True):
        if end > begin:
            yield from SweepThird.between(path, sweep, begin, end, number=number, third=third)
