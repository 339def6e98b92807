"""A recording becomes a tape that plays as a rig: see `frictus_hardware.replay`."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from frictus.keys import ACCEL, FORCE, VOLTAGE
from frictus.messages import RigStatus, TouchState
from frictus_hardware.replay.tape import Tape, write_tape
from frictus_service.errors import ExportError
from frictus_service.recording.reader import Ending, Item, RecordingReader, State
from frictus_service.recording.samples import Samples, counts_of
from frictus_service.recording.segments import Outline, SampleRange
from frictus_service.recording.writer import new_file

CHANNELS: Final = {FORCE: 3, ACCEL: 3, VOLTAGE: 1}
MAX_SAMPLES: Final = 20_000_000
"""A tape is held in memory: 1000 s at 20 kHz take half a gigabyte to make, a third to play."""
SAMPLE_DIGITS: Final = 6
"""Arrivals are rounded to so many digits of a sample before the fraction is dropped, so that
the rounding of measured sample plus latency shifts none into the block before."""


@dataclass(frozen=True, slots=True)
class Taped:
    """What came of it.

    Attributes
    ----------
    seconds : float
        From the first sample to the last, gaps included.
    missing : int
        Samples that are missing in between.
    ending : Ending
        How far the recording could be read.
    """

    seconds: float
    missing: int
    ending: Ending


@dataclass(slots=True)
class _Found:
    """What the second reading gathers; samples that did not come stay NaN."""

    place: SampleRange
    data: dict[int, NDArray[np.float32]] = field(init=False)
    touches: list[TouchState] = field(default_factory=list)

    def __post_init__(self) -> None:
        n = self.place.n_samples
        self.data = {
            stream: np.full((n, channels), np.nan, np.float32)
            for stream, channels in CHANNELS.items()
        }

    def take(self, items: Iterable[Item]) -> None:
        for item in items:
            if isinstance(item, Samples) and item.run == self.place.run:
                self._add(item)
            elif isinstance(item, State) and isinstance(item.message, TouchState):
                if item.message.run == self.place.run:
                    self.touches.append(item.message)

    def _add(self, samples: Samples) -> None:
        begin = max(samples.first_sample, self.place.first_sample)
        end = min(samples.end_sample, self.place.end_sample)
        if samples.stream in CHANNELS and begin < end:
            source = slice(begin - samples.first_sample, end - samples.first_sample)
            to = slice(begin - self.place.first_sample, end - self.place.first_sample)
            self.data[samples.stream][to] = samples.data[:, source].T


def export_tape(
    path: Path,
    out: Path,
    from_s: float | None = None,
    to_s: float | None = None,
    touch_latency_s: float | None = None,
) -> Taped:
    """Write one run of a recording as a `replay/1` file.

    Parameters
    ----------
    path : Path
        Recording; where it is torn, what comes before is exported.
    out : Path
        Must not exist.
    from_s, to_s : float or None
        Part of the recording, in seconds from its first sample.
    touch_latency_s : float or None
        Declared age of touch reports when they arrived; None: as the recording says.

    Raises
    ------
    RecordingError
        If the file is no recording.
    ExportError
        If it holds several runs, no sample, or does not say the latency.
    NotWrittenError
        If `out` exists or cannot be made.
    """
    with RecordingReader(path) as reader:
        status = reader.status
        if touch_latency_s is not None:
            status = status.model_copy(update={"touch_latency_s": touch_latency_s})
        found = _Found(_place(reader.items(), from_s, to_s))
        found.take(reader.items())
        tape = _tape(found, reader.info.name, status, reader.info.converter_steps)
        with new_file(out) as file:
            write_tape(file, tape)
        span = tape.end_sample - tape.first_sample
        missing = span - tape.voltage_v.size
        return Taped(span / tape.sample_rate_hz, missing, reader.ending)


def _place(items: Iterable[Item], from_s: float | None, to_s: float | None) -> SampleRange:
    outline = Outline.of(items)
    place = outline.place(*outline.span(from_s, to_s))
    if place.n_samples > MAX_SAMPLES:
        raise ExportError(
            f"{place.n_samples / place.sample_rate_hz:.0f} s; at most "
            f"{MAX_SAMPLES / place.sample_rate_hz:.0f} s make a tape: cut it by --from and "
            "--until"
        )
    return place


def _tape(found: _Found, name: str, status: RigStatus, steps: dict[str, float]) -> Tape:
    place = found.place
    if status.touch_latency_s is None:
        raise ExportError(
            "the recording does not say how old touch reports are when they arrive; say so by "
            "--touch-latency, in seconds"
        )
    here = np.logical_and.reduce(
        [np.isfinite(data).all(axis=1) for data in found.data.values()]
    )
    (rows,) = np.nonzero(here)
    if not rows.size:
        raise ExportError("no sample in it has force, acceleration and voltage")
    begins = np.flatnonzero(np.diff(rows, prepend=rows[0] - 2) > 1)
    force, force_step_n = _stored(found.data[FORCE][here], steps.get("force"))
    accel, accel_step = _stored(found.data[ACCEL][here], steps.get("accel"))
    first, end = place.first_sample + int(rows[0]), place.first_sample + int(rows[-1]) + 1
    return Tape(
        name=name,
        finger_source=status.finger_source,
        sample_rate_hz=place.sample_rate_hz,
        lead_samples=round(1e-3 * status.lead_ms * place.sample_rate_hz),
        screen_mm=status.screen_mm,
        screen_peak_v=status.screen_peak_v,
        touch_latency_s=status.touch_latency_s,
        force=force,
        force_step_n=force_step_n,
        accel=accel,
        accel_step_m_s2=accel_step,
        voltage_v=found.data[VOLTAGE][here, 0],
        stretch_row=begins,
        stretch_first_sample=place.first_sample + rows[begins],
        **_touches(found.touches, status.touch_latency_s * place.sample_rate_hz, first, end),
    )


def _stored(
    values: NDArray[np.float32], step: float | None
) -> tuple[NDArray[np.int16] | NDArray[np.float32], float]:
    """Return counts and their step where they give back every value, else the values."""
    counts = None if step is None else counts_of(values, step)
    return (values, 1.0) if counts is None or step is None else (counts, step)


def _touches(
    touches: list[TouchState], latency: float, first: int, end: int
) -> dict[str, NDArray[Any]]:
    """Return the fields of the reports that arrived within the recording, in order."""
    measured = np.array([touch.sample for touch in touches], dtype=np.float64)
    arrival = np.floor(np.round(measured + latency, SAMPLE_DIGITS)).astype(np.int64)
    within = np.flatnonzero((arrival >= first) & (arrival < end))
    order = within[np.argsort(arrival[within], kind="stable")]
    return {
        "touch_arrival_sample": arrival[order],
        "touch_measured_sample": measured[order],
        "touch_x_mm": np.array([touch.x_mm for touch in touches], dtype=np.float64)[order],
        "touch_y_mm": np.array([touch.y_mm for touch in touches], dtype=np.float64)[order],
        "touch_in_contact": np.array([touch.in_contact for touch in touches], dtype=np.bool_)[
            order
        ],
    }
