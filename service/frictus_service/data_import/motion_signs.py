"""Axes and signs that physics settles: friction opposes the slide, a finger presses.

The sensor under the screen reports the force of the finger on it, so that along the slide it
has the sign of the velocity. A force that is clearly against the velocity has the other sign;
one that is neither is a question.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from frictus_service.data_import.column_map import ColumnMap
from frictus_service.data_import.formats.columns import Columns
from frictus_service.data_import.recording import Recording, apply_map
from frictus_service.errors import FieldError
from frictus_service.identification.observation.sweeps import TouchMotion, rest_mm_s, smooth

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
        recording = apply_map(columns, column_map)
        if _is_across(recording):
            column_map = _swapped(column_map)
            reasons.append("the finger moves along y of the file: x and y are exchanged")
            recording = apply_map(columns, column_map)
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


def _velocity(column_map: ColumnMap) -> dict[str, object]:
    return {"position_x": None} if "velocity_x" in column_map.channels else {}


def friction_correlation(recording: Recording) -> float | None:
    """Return how the tangential force follows the velocity, -1 to 1; None where nothing moves.

    Parameters
    ----------
    recording : Recording
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


def _is_across(recording: Recording) -> bool:
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
