"""What the finger's motion in a recording settles: where strokes are, and axes and signs.

Strokes are sections of one direction that are steady enough. Unlike the sweeps of a trial,
those of a recording may have any mix of speeds: a stretch in one direction is found first, and
what is steady of it is judged by its own speed.

Friction opposes the slide, and a finger presses: that settles axes and signs. The sensor under
the screen reports the force of the finger on it, so that along the slide it has the sign of the
velocity. A force that is clearly against the velocity has the other sign; one that is neither
is a question.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from frictus_hardware.arrays import BoolArray, FloatArray
from frictus_service.data_import.column_map import ColumnMap
from frictus_service.data_import.formats.columns import Columns
from frictus_service.data_import.recording import MappedRecording
from frictus_service.data_import.recordings_in_file import mapped_recordings
from frictus_service.errors import FieldError
from frictus_service.identification.observation.observe import PRESSED_SHARE
from frictus_service.identification.observation.sweeps import (
    MARGIN_S,
    REST_MM_S,
    TouchMotion,
    find_sweeps,
    rest_mm_s,
    smooth,
)

MAX_STROKES: Final = 20_000
STROKES: Final = (
    "sections of one direction that last 0.1 s and 3 mm at least, the finger pressing"
)
"""What a stroke is, for people."""
LOOK_AT: Final = (
    "unit and sign of position and normal force, and at the rate of the positions, 30 Hz at "
    "least"
)
"""Where none is found."""
CONTACT_S: Final = 0.02
"""The normal force is averaged over so long before it says whether the finger presses."""
SAME_RATIO: Final = 1.2
"""Measured speeds, or forces, up to this ratio are one condition: within 10 % of its middle."""


@dataclass(frozen=True, slots=True)
class Stroke:
    """A steady section in one direction.

    Attributes
    ----------
    first, last : int
        Samples, the last one excluded.
    direction : int
        +1 along x, -1 against it.
    speed_mm_s, normal : float
        Means over it; the normal force in the unit of the recording, NaN where it was not
        measured.
    """

    first: int
    last: int
    direction: int
    speed_mm_s: float
    normal: float


def find_strokes(recording: MappedRecording) -> list[Stroke]:
    """Return the strokes of a recording, in time.

    Parameters
    ----------
    recording : MappedRecording
        Of any length.
    """
    motion = smooth(recording.position_mm, recording.position_t_s)
    if motion.time_s.size < 2:
        return []
    pressed = _pressed(recording, motion.time_s)
    moving = pressed & (np.abs(motion.velocity_mm_s[:, 0]) > REST_MM_S)
    heading = np.where(moving, np.sign(motion.velocity_mm_s[:, 0]), 0.0)
    edges = np.flatnonzero(np.diff(heading) != 0.0) + 1
    found: list[Stroke] = []
    for first, last in zip([0, *edges.tolist()], [*edges.tolist(), heading.size], strict=True):
        if heading[first] == 0.0 or last - first < 2:
            continue
        own = TouchMotion(
            motion.time_s[first:last],
            motion.reported_mm[first:last],
            motion.position_mm[first:last],
            motion.velocity_mm_s[first:last],
        )
        found.extend(_strokes(recording, own))
        if len(found) >= MAX_STROKES:
            break
    return found[:MAX_STROKES]


def _strokes(recording: MappedRecording, motion: TouchMotion) -> Iterator[Stroke]:
    for sweep in find_sweeps(motion, np.ones(motion.time_s.size, dtype=np.bool_)):
        # The sweep leaves out at its ends what a reversal excites; a trial is cut again.
        begin_s = max(sweep.begin_s - MARGIN_S, 0.0)
        first = round(begin_s * recording.rate_hz)
        last = round((sweep.end_s + MARGIN_S) * recording.rate_hz)
        last = min(last, len(recording.force_n))
        if last - first < 2:
            continue
        inside = (motion.time_s >= sweep.begin_s) & (motion.time_s <= sweep.end_s)
        speed = float(motion.speed_mm_s[inside].mean())
        normal = recording.force_n[first:last, 2]
        there = np.isfinite(normal)
        mean = float(normal[there].mean()) if there.any() else np.nan
        yield Stroke(first, last, sweep.direction, speed, mean)


def _pressed(recording: MappedRecording, time_s: FloatArray) -> BoolArray:
    """Return whether the finger presses at each time; without a normal force it does."""
    normal = recording.force_n[:, 2]
    if not np.isfinite(normal).any():
        return np.ones(time_s.size, dtype=np.bool_)
    width = max(round(CONTACT_S * recording.rate_hz), 1)
    blocks = max(normal.size // width, 1)
    whole = normal[: blocks * width].reshape(blocks, -1)
    mean = np.nan_to_num(whole).mean(axis=1)
    at = np.clip((time_s * recording.rate_hz / width).astype(np.int64), 0, blocks - 1)
    on: BoolArray = mean[at] >= PRESSED_SHARE * np.quantile(mean, 0.75)
    return on & (time_s >= 0.0) & (time_s * recording.rate_hz < normal.size)


def conditions_of(values: FloatArray) -> FloatArray:
    """Return the condition that each measured value belongs to: the middle of its like.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Above zero; NaN stays.

    Returns
    -------
    ndarray, shape (n,)
        Geometric middle of the values within a ratio of 1.2, to three digits.
    """
    found = np.full(values.shape, np.nan)
    left = np.sort(values[np.isfinite(values)])
    while left.size:
        last = float(left[left <= SAME_RATIO * left[0]][-1])
        middle = float(f"{np.sqrt(left[0] * last):.3g}")
        found[(values >= left[0]) & (values <= last)] = middle
        left = left[left > last]
    return found


CLEAR: Final = 0.5
"""Correlation of force and velocity, about zero, from which the sign is clear."""
LONGER: Final = 2.0
"""So many times farther the finger moves along the slide than across."""


@dataclass(frozen=True, slots=True)
class Signed:
    """A map with axes and signs by motion.

    Attributes
    ----------
    column_map : ColumnMap
        With axes and signs by motion.
    reasons : tuple of str
        What was turned, and why.
    questions : tuple of (str, str)
        Entry and sentence of what is not clear.
    """

    column_map: ColumnMap
    reasons: tuple[str, ...]
    questions: tuple[tuple[str, str], ...]


def signed(columns: Columns, column_map: ColumnMap) -> Signed:
    """Return a map whose axes and signs fit the motion.

    Parameters
    ----------
    columns : Columns
        Of the file.
    column_map : ColumnMap
        Proposed.
    """
    reasons: list[str] = []
    try:
        recording = _longest(columns, column_map)
        if _is_across(recording):
            column_map = _swapped(column_map)
            reasons.append("the finger moves along y of the file: x and y are exchanged")
            recording = _longest(columns, column_map)
    except FieldError as error:
        return Signed(column_map, tuple(reasons), ((error.field, str(error)),))
    normal = recording.force_n[:, 2]
    pressed_negative = bool(np.isfinite(normal).any() and np.nanmean(normal) < 0.0)
    if pressed_negative:
        column_map = _turned(column_map, "force_z")
        reasons.append(
            "the normal force is negative while the finger presses: its sign is turned"
        )
    correlation = friction_correlation(recording)
    if correlation is None or "position_x" not in column_map.channels | _velocity(column_map):
        return Signed(column_map, tuple(reasons), ())
    if correlation < -CLEAR:
        column_map = _turned(column_map, "force_x")
        if pressed_negative:  # all of the force is that of the screen on the finger
            column_map = _turned(column_map, "force_y")
        reasons.append(
            f"the tangential force is against the velocity (correlation {correlation:.2f}), as "
            "that of the screen on the finger: its sign is turned"
        )
    elif correlation < CLEAR:
        question = (
            "force_x.sign",
            f"the tangential force does not follow the direction of motion (correlation "
            f"{correlation:.2f}): look for an offset, another axis or another clock, then set "
            "force_x.sign to 1 or -1",
        )
        return Signed(column_map, tuple(reasons), (question,))
    return Signed(column_map, tuple(reasons), ())


def _longest(columns: Columns, column_map: ColumnMap) -> MappedRecording:
    """Return the longest recording of a file."""
    recordings, _ = mapped_recordings(columns, column_map)
    return max(recordings, key=lambda recording: recording.seconds)


def _velocity(column_map: ColumnMap) -> dict[str, object]:
    return {"position_x": None} if "velocity_x" in column_map.channels else {}


def friction_correlation(recording: MappedRecording) -> float | None:
    """Return how the tangential force follows the velocity, -1 to 1; None where nothing moves.

    Parameters
    ----------
    recording : MappedRecording
        With tangential force and position.
    """
    motion = smooth(recording.position_mm, recording.position_t_s)
    brisk = _brisk(motion)
    if not brisk.any():
        return None
    index = np.rint(motion.time_s[brisk] * recording.rate_hz).astype(np.int64)
    inside = (index >= 0) & (index < len(recording.force_n))
    force = recording.force_n[index[inside], 0]
    heading = np.sign(motion.velocity_mm_s[brisk, 0][inside])
    there = np.isfinite(force)
    strength = np.sqrt(np.square(force[there]).mean()) if there.any() else 0.0
    return float((force[there] * heading[there]).mean() / strength) if strength > 0.0 else None


def _brisk(motion: TouchMotion) -> np.ndarray:
    moving: np.ndarray = np.abs(motion.velocity_mm_s[:, 0]) > rest_mm_s(motion)
    return moving


def _is_across(recording: MappedRecording) -> bool:
    if len(recording.position_mm) < 2:
        return False
    spans = np.nanmax(recording.position_mm, axis=0) - np.nanmin(recording.position_mm, axis=0)
    return bool(spans[1] > LONGER * spans[0])


def _swapped(column_map: ColumnMap) -> ColumnMap:
    """Return a map with x and y exchanged, of every sensor that has both."""
    channels = dict(column_map.channels)
    for stem in ("force_", "position_", "accel_"):
        x, y = stem + "x", stem + "y"
        if x in channels and y in channels:
            channels[x], channels[y] = channels[y], channels[x]
    return column_map.model_copy(update={"channels": channels})


def _turned(column_map: ColumnMap, name: str) -> ColumnMap:
    mapped = column_map.channels.get(name)
    if mapped is None:
        return column_map
    turned = mapped.model_copy(update={"sign": -mapped.sign})
    return column_map.model_copy(update={"channels": {**column_map.channels, name: turned}})
