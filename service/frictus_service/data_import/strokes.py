"""Long recordings cut into strokes: sections of one direction, steady enough.

Unlike the sweeps of a trial, those of a recording may have any mix of speeds: a stretch in one
direction is found first, and what is steady of it is judged by its own speed.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from frictus_hardware.arrays import BoolArray, FloatArray
from frictus_service.data_import.recording import Recording
from frictus_service.identification.observation.observe import PRESSED_SHARE
from frictus_service.identification.observation.sweeps import (
    MARGIN_S,
    REST_MM_S,
    TouchMotion,
    find_sweeps,
    smooth,
)

MAX_STROKES: Final = 20_000
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


def find_strokes(recording: Recording) -> list[Stroke]:
    """Return the strokes of a recording, in time.

    Parameters
    ----------
    recording : Recording
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
            motion.position_mm[first:last],
            motion.velocity_mm_s[first:last],
        )
        found.extend(_strokes(recording, own))
        if len(found) >= MAX_STROKES:
            break
    return found[:MAX_STROKES]


def _strokes(recording: Recording, motion: TouchMotion) -> Iterator[Stroke]:
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


def _pressed(recording: Recording, time_s: FloatArray) -> BoolArray:
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
