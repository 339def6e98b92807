"""Whether the sensors lie as configured, by what a calibration hears of the finger."""

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import Any, Final

import numpy as np

from frictus.block import Block
from frictus.messages import TouchState
from frictus_service.errors import AlignmentError
from frictus_service.identification.observation.sensor_alignment import Strokes, align_sensors
from frictus_service.identification.observation.sensor_discrepancies import sensor_discrepancies

KEPT_S: Final = 90.0
APART_S: Final = 0.5
"""Blocks that are further apart begin another stretch."""
CHANNELS: Final = {"force": slice(0, 3), "accel": slice(3, 6)}


class StrokesCapture:
    """Keeps what was sensed while a finger touched, the newest 90 s of one run of a rig."""

    def __init__(self) -> None:
        self._run: int | None = None
        self._blocks: deque[tuple[str, Block]] = deque()
        self._touches: deque[TouchState] = deque()
        self._kept_s = 0.0

    def add_block(self, stream: str, block: Block) -> None:
        """Take a block of force or acceleration; of other streams nothing is kept."""
        if stream not in CHANNELS:
            return
        if block.run != self._run:  # the rig began anew, and its samples count from 0 again
            self._blocks.clear()
            self._touches.clear()
            self._run, self._kept_s = block.run, 0.0
        self._blocks.append((stream, block))
        self._kept_s += _seconds(block)
        while self._kept_s > KEPT_S * len(CHANNELS):
            self._kept_s -= _seconds(self._blocks.popleft()[1])
        oldest = self._blocks[0][1].first_sample
        while self._touches and self._touches[0].sample < oldest:
            self._touches.popleft()

    def add_touch(self, touch: TouchState) -> None:
        """Take a touch report; those without contact say nothing of the path."""
        if touch.in_contact and touch.run == self._run:
            self._touches.append(touch)

    def strokes(self) -> Iterator[Strokes]:
        """Yield the stretches that were heard; what is missing within them is NaN."""
        blocks = sorted(self._blocks, key=lambda kept: kept[1].first_sample)
        stretch: list[tuple[str, Block]] = []
        end = 0
        for stream, block in blocks:
            if stretch and block.first_sample - end > APART_S * block.sample_rate_hz:
                yield self._joined(stretch, end)
                stretch = []
            stretch.append((stream, block))
            end = max(end, block.first_sample + block.data.shape[1])
        if stretch:
            yield self._joined(stretch, end)

    def _joined(self, stretch: list[tuple[str, Block]], end: int) -> Strokes:
        first, rate_hz = stretch[0][1].first_sample, stretch[0][1].sample_rate_hz
        sensed = np.full((end - first, 6), np.nan)
        for stream, block in stretch:
            at = block.first_sample - first
            sensed[at : at + block.data.shape[1], CHANNELS[stream]] = block.data.T
        reports = {
            touch.sample: (touch.x_mm, touch.y_mm)
            for touch in self._touches
            if first <= touch.sample < end
        }
        at_sample = np.array(sorted(reports))
        position = np.array([reports[sample] for sample in at_sample]).reshape(-1, 2)
        return Strokes(
            rate_hz, sensed[:, :3], sensed[:, 3:], (at_sample - first) / rate_hz, position
        )


def _seconds(block: Block) -> float:
    n_samples: int = block.data.shape[1]
    return n_samples / block.sample_rate_hz


def alignment_of(
    strokes: Sequence[Strokes], declared_latency_s: float
) -> tuple[dict[str, Any] | None, tuple[str, ...]]:
    """Return how the sensors lie, as plain values, and notes on what is not as configured.

    Parameters
    ----------
    strokes : sequence of Strokes
        What was heard.
    declared_latency_s : float
        Of the touch sensor.

    Returns
    -------
    details : dict or None
        The fields of a `SensorAlignment`; None where it cannot be told.
    notes : tuple of str
        Empty where all is as configured.
    """
    try:
        found = align_sensors(strokes)
    except AlignmentError as error:
        return None, (f"whether the sensors lie as configured is unknown: {error}",)
    notes = tuple(
        f"{slip.found}: {slip.to_do}, and calibrate again"
        for slip in sensor_discrepancies(found, declared_latency_s)
    )
    return asdict(found) | {"rotation": found.rotation.tolist()}, notes
