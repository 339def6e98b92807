"""The course of a recording at a glance: extremes of signals by column, and what happened."""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from frictus.keys import FORCE, VOLTAGE
from frictus.messages import FingerState, GuidanceState, RigStatus
from frictus_hardware.arrays import FloatArray
from frictus_service.recording.reader import Item, RecordingReader, State
from frictus_service.recording.records import GapNote, PresenceNote
from frictus_service.recording.samples import Samples

COLUMNS: Final = 400
MOST_S: Final = 600.0
"""What is looked at of a recording: so much is read in seconds."""
MOST_EVENTS: Final = 100
SIGNALS: Final = {
    "lateral_force": "N",
    "normal_force": "N",
    "speed": "mm/s",
    "screen_voltage": "V",
}
"""By name, with their units."""
_CHANNELS: Final = {
    FORCE: (("lateral_force", 0), ("normal_force", 2)),
    VOLTAGE: (("screen_voltage", 0),),
}


@dataclass(frozen=True, slots=True)
class CourseEvent:
    """Something that happened.

    Attributes
    ----------
    at_s : float
        From the beginning of the course.
    what : str
        For people.
    """

    at_s: float
    what: str


@dataclass(frozen=True, slots=True)
class Course:
    """How a recording went.

    Attributes
    ----------
    column_s : float
        What one column covers.
    low, high : dict of name of a signal to ndarray, shape (n_columns,)
        Extremes; NaN where nothing was recorded. Of the finger's speed: while it touches.
    events : tuple of CourseEvent
        In their order; `MOST_EVENTS` at most.
    left_out : int
        Events beyond them.
    guided_trials : int
        In what is shown: how many of those a study is made of.
    ending : str
        How far the recording was looked at.
    """

    column_s: float
    low: dict[str, FloatArray]
    high: dict[str, FloatArray]
    events: tuple[CourseEvent, ...]
    left_out: int
    guided_trials: int
    ending: str


def course_of(path: Path, length_s: float) -> Course:
    """Return the course of a recording, of its first `MOST_S` if it is longer.

    Parameters
    ----------
    path : Path
        Of the file.
    length_s : float
        Of the recording, as its summary says it.

    Raises
    ------
    RecordingError
        If the file is no recording.
    """
    shown_s = max(min(length_s, MOST_S), 1e-3)
    with RecordingReader(path) as reader:
        drawn = _Drawing(shown_s)
        for item in reader.items():
            if drawn.is_over(item):
                ending = f"the first {MOST_S:g} of {length_s:.0f} s are shown"
                break
            drawn.add(item)
        else:
            ending = str(reader.ending)
    return Course(
        drawn.column_s,
        {name: _finite(low) for name, low in drawn.low.items()},
        {name: _finite(high) for name, high in drawn.high.items()},
        tuple(drawn.events),
        drawn.left_out,
        drawn.guided,
        ending,
    )


class _Drawing:
    def __init__(self, shown_s: float) -> None:
        self.column_s = shown_s / COLUMNS
        self.low = {name: np.full(COLUMNS, np.inf) for name in SIGNALS}
        self.high = {name: np.full(COLUMNS, -np.inf) for name in SIGNALS}
        self.events: list[CourseEvent] = []
        self.left_out = 0
        self.guided = 0
        self._asked: tuple[str, int, str] | None = None
        self._began: tuple[Samples, float] | None = None
        self._latest: Samples | None = None
        self._latest_s = 0.0
        self._state, self._present = "disarmed", True

    def is_over(self, item: Item) -> bool:
        """Return whether samples begin behind what is shown; what has no time does not."""
        if not isinstance(item, Samples):
            return False
        if self._began is None or item.run != self._began[0].run:
            self._began = item, max(self._latest_s, self._at_s(item.utc_ns))
        # By the count of samples: somebody may have set the clock of the machine.
        first, began_s = self._began
        self._latest = item
        self._latest_s = (
            began_s + (item.first_sample - first.first_sample) / item.sample_rate_hz
        )
        return self._latest_s > MOST_S

    def add(self, item: Item) -> None:
        if isinstance(item, Samples):
            times_s = self._latest_s + np.arange(item.data.shape[1]) / item.sample_rate_hz
            for name, channel in _CHANNELS.get(item.stream, ()):
                if channel < item.data.shape[0]:
                    self._draw(name, times_s, item.data[channel].astype(float))
        elif isinstance(item, State) and isinstance(item.message, FingerState):
            finger = item.message
            if finger.in_contact and self._latest is not None:
                speed_mm_s = float(np.hypot(finger.vx_mm_s, finger.vy_mm_s))
                self._draw("speed", np.array([self._at_s(item.utc_ns)]), np.array([speed_mm_s]))
        elif isinstance(item, State) and isinstance(item.message, GuidanceState):
            asked = (item.message.phase, item.message.trial, item.message.participant)
            self.guided += asked[0] == "record" and asked != self._asked
            self._asked = asked
        elif (event := self._event_of(item)) is not None:
            if len(self.events) < MOST_EVENTS:
                self.events.append(event)
            else:
                self.left_out += 1

    def _at_s(self, utc_ns: int) -> float:
        """Return a time of the machine's clock, by the latest samples."""
        later_ns = 0 if self._latest is None else utc_ns - self._latest.utc_ns
        return self._latest_s + 1e-9 * later_ns

    def _draw(self, name: str, times_s: FloatArray, values: FloatArray) -> None:
        columns = np.clip(times_s / self.column_s, 0.0, COLUMNS - 1).astype(int)
        known = np.isfinite(values)
        np.minimum.at(self.low[name], columns[known], values[known])
        np.maximum.at(self.high[name], columns[known], values[known])

    def _event_of(self, item: Item) -> CourseEvent | None:
        if isinstance(item, State) and isinstance(item.message, RigStatus):
            status = item.message
            before, self._state = self._state, status.state
            if status.state != before:
                return CourseEvent(self._at_s(status.utc_ns), _told(status))
        elif isinstance(item, GapNote):
            lost = f"{item.missing_blocks} of {item.stream} are missing: {item.reason}"
            return CourseEvent(self._at_s(item.utc_ns), lost)
        elif isinstance(item, PresenceNote):
            was, self._present = self._present, item.present
            if item.present != was:
                what = "the rig is back" if item.present else "the rig is gone"
                return CourseEvent(self._at_s(item.utc_ns), what)
        return None


def _told(status: RigStatus) -> str:
    if status.state == "tripped" and status.fault is not None:
        return f"tripped: {status.fault.reason}"
    if status.state == "armed" and status.owner is not None:
        return f"armed by {status.owner}"
    return status.state


def _finite(extremes: FloatArray) -> FloatArray:
    return np.where(np.isfinite(extremes), extremes, np.nan)
