"""A recording becomes a file that Foxglove and Lichtblick plot, sample by sample.

They plot one value a message, at the message's time. So each sample becomes a message of its
own: the channels as float32, which the well-known encoding `ros1` describes without overhead.
https://mcap.dev/spec/registry
"""

import json
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import Any, Final

import numpy as np
from mcap.writer import CompressionType, Writer
from numpy.typing import NDArray
from pydantic import BaseModel

from frictus.keys import AUX, CHANNELS, STREAMS, TOPICS
from frictus.messages import AuxChannel, RigStatus, TimeState
from frictus.slewed_clock import SlewedClock
from frictus_service.errors import ExportError
from frictus_service.recording.plain_schema import plain_schema
from frictus_service.recording.reader import (
    STATE_KINDS,
    Ending,
    Item,
    RecordingReader,
    State,
)
from frictus_service.recording.records import (
    END,
    GAPS,
    NOTES,
    PRESENCE,
    STREAM_NAMES,
    EndNote,
    GapNote,
    PresenceNote,
)
from frictus_service.recording.samples import Samples
from frictus_service.recording.writer import JSON_SCHEMA, create

MAX_PART_S: Final = 1e9
MAX_MESSAGES: Final = 20_000_000
"""Of one file, which a viewer takes into memory."""
CHUNK_BYTES: Final = 4_000_000
STEP_NS: Final = 100_000_000
"""A fit that is further off is no fit but a UTC clock that was set: it is followed at once."""
LAYOUT: Final = files("frictus_service.recording") / "foxglove_layout.json"
"""Panels for what an exported recording holds."""
HELD: Final = {topic.suffix for topic in TOPICS if topic.latest}
"""Topics of which the last message holds until the next."""
DOCUMENTS: Final[dict[str, type[BaseModel]]] = {**STATE_KINDS, **NOTES}
NOTE_TOPICS: Final = {GapNote: GAPS, PresenceNote: PRESENCE, EndNote: END}


@dataclass(frozen=True, slots=True)
class Plottable:
    """What came of an export.

    Attributes
    ----------
    messages : int
        In the file; each sample is one.
    ending : Ending
        How far the recording could be read.
    """

    messages: int
    ending: Ending


def export_foxglove(
    path: Path, out: Path, from_s: float | None = None, to_s: float | None = None
) -> Plottable:
    """Write a recording, or a part of it, as a file for Foxglove or Lichtblick.

    Parameters
    ----------
    path : Path
        Recording; where it is torn, what comes before is exported.
    out : Path
        Must not exist.
    from_s, to_s : float or None
        Part of the recording, in seconds from its first sample.

    Raises
    ------
    RecordingError
        If the file is no recording.
    ExportError
        If there is no sample in that part, or more than a viewer can hold.
    NotWrittenError
        If `out` exists or cannot be made.
    """
    with RecordingReader(path) as reader:
        begin_ns, end_ns = _part(reader.items(), from_s, to_s)
        content = reader.attachments.get("status.json")
        aux = () if content is None else RigStatus.from_json(content).aux
        with create(out) as file:
            writer: Any = Writer(file, CHUNK_BYTES, CompressionType.ZSTD)
            writer.start("", reader.info.software)
            plot = _PlotWriter(writer, aux)
            for item in reader.items():
                if isinstance(item, Samples):
                    plot.samples(item, begin_ns, end_ns)
                else:
                    plot.document(item, begin_ns, end_ns)
            writer.finish()
        return Plottable(plot.messages, reader.ending)


def _part(items: Iterator[Item], from_s: float | None, to_s: float | None) -> tuple[int, int]:
    """Return when the part begins and ends, ns UTC."""
    for at_s in (from_s, to_s):
        if at_s is not None and not 0.0 <= at_s <= MAX_PART_S:  # refuses NaN too
            raise ExportError(f"{at_s} s: a part begins and ends at 0 to {MAX_PART_S:g} s")
    spans = [
        (item.utc_ns, item.utc_ns + round(1e9 * item.duration_s), item.data.shape[1])
        for item in items
        if isinstance(item, Samples) and _is_plausible(item)
    ]
    if not spans:
        raise ExportError("it holds no samples: there is nothing to plot")
    first_ns, last_ns = min(span[0] for span in spans), max(span[1] for span in spans)
    begin_ns = 0 if from_s is None else first_ns + round(1e9 * from_s)
    end_ns = 2**63 if to_s is None else first_ns + round(1e9 * to_s)
    count = sum(n for at, until, n in spans if at < end_ns and until > begin_ns)
    if not count:
        seconds = 1e-9 * (last_ns - first_ns)
        raise ExportError(f"there are no samples in that part: it has {seconds:.2f} s")
    if count > MAX_MESSAGES:
        raise ExportError(
            f"{count} samples; a viewer takes at most {MAX_MESSAGES} into memory: cut it by "
            "--from and --until"
        )
    return begin_ns, end_ns


def _is_plausible(samples: Samples) -> bool:
    """Return whether counts and times can be computed with, as a rig's can."""
    counts = samples.sample_rate_hz >= 1.0 and samples.end_sample < 2**62
    if counts and 0 <= samples.utc_ns < 2**62:  # until 2116
        return True
    raise ExportError(
        f"samples from index {samples.first_sample} at {samples.sample_rate_hz} Hz from "
        f"{samples.utc_ns} ns UTC on: no rig counts so"
    )


@dataclass(slots=True)
class _PlotWriter:
    """Writes items that lie within the part; follows the clock all along."""

    writer: Any
    aux: Sequence[AuxChannel]
    messages: int = 0
    _channels: dict[str, int] = field(default_factory=dict)
    _clocks: dict[int, SlewedClock] = field(default_factory=dict)
    _before: dict[str, bytes] = field(default_factory=dict)

    def samples(self, samples: Samples, begin_ns: int, end_ns: int) -> None:
        clock = self._clocks.get(samples.run)
        if clock is None:
            per_sample_ns = 1e9 / samples.sample_rate_hz
            clock = SlewedClock(samples.first_sample, samples.utc_ns, per_sample_ns)
            self._clocks[samples.run] = clock
        indices = np.arange(samples.first_sample, samples.end_sample)
        times_ns = clock.time_ns(indices)
        (within,) = np.nonzero((times_ns >= begin_ns) & (times_ns < end_ns))
        if not within.size:
            return
        self._begin(begin_ns)
        channel = self._stream_channel(samples.stream, len(samples.data))
        rows = np.ascontiguousarray(samples.data.T[within], "<f4")
        self._add_rows(channel, times_ns[within].tolist(), rows)

    def _add_rows(self, channel: int, times_ns: list[int], rows: NDArray[Any]) -> None:
        add: Callable[..., None] = self.writer.add_message
        content, width = rows.tobytes(), rows.itemsize * rows.shape[1]
        for row, at_ns in enumerate(times_ns):
            add(channel, at_ns, content[row * width : (row + 1) * width], at_ns)
        self.messages += len(times_ns)

    def document(self, item: Item, begin_ns: int, end_ns: int) -> None:
        """Write a state or a note; what holds when the part begins is written there."""
        if isinstance(item, State):
            if isinstance(item.message, TimeState):
                self._follow(item.message)
            topic, payload = item.topic, item.payload
        else:
            assert not isinstance(item, Samples)
            topic, payload = NOTE_TOPICS[type(item)], item.to_json()
        at_ns = item.utc_ns
        if at_ns < begin_ns:
            if topic in HELD:
                self._before[topic] = payload
        elif at_ns < end_ns:
            self._begin(begin_ns)
            self._add_document(topic, payload, at_ns)

    def _begin(self, begin_ns: int) -> None:
        """Write what held when the part begins."""
        for topic, payload in self._before.items():
            self._add_document(topic, payload, begin_ns)
        self._before.clear()

    def _add_document(self, topic: str, payload: bytes, at_ns: int) -> None:
        channel = self._document_channel(topic)
        self.writer.add_message(channel, at_ns, payload, at_ns)
        self.messages += 1

    def _follow(self, fit: TimeState) -> None:
        clock = self._clocks.get(fit.run)
        if clock is None:
            return
        clock.approach(fit.sample, fit.utc_ns, fit.ns_per_sample)
        if abs(clock.error_ns) > STEP_NS:
            self._clocks[fit.run] = SlewedClock(fit.sample, fit.utc_ns, fit.ns_per_sample)

    def _stream_channel(self, stream: int, n_channels: int) -> int:
        topic = STREAMS[stream].suffix
        if topic not in self._channels:
            names = self._names(stream, n_channels)
            text = "".join(f"float32 {name}\n" for name in names).encode()
            name = f"frictus/{STREAM_NAMES[stream].capitalize()}"
            schema = self.writer.register_schema(name, "ros1msg", text)
            metadata = {"unit": STREAMS[stream].unit}
            self._channels[topic] = self.writer.register_channel(
                topic, "ros1", schema, metadata
            )
        return self._channels[topic]

    def _names(self, stream: int, n_channels: int) -> tuple[str, ...]:
        names = CHANNELS.get(stream, ())
        if stream == AUX:
            names = field_names([f"{one.name}_{one.unit}" for one in self.aux])
        if len(names) != n_channels:  # of a later version, or of a status of another rig
            names = tuple(f"channel_{number}" for number in range(n_channels))
        return names

    def _document_channel(self, topic: str) -> int:
        if topic not in self._channels:
            kind = DOCUMENTS[topic]
            text = json.dumps(plain_schema(kind)).encode()
            schema = self.writer.register_schema(kind.__name__, JSON_SCHEMA, text)
            self._channels[topic] = self.writer.register_channel(topic, "json", schema)
        return self._channels[topic]


def field_names(names: Sequence[str]) -> tuple[str, ...]:
    """Return names as fields of a message may have them, each another one.

    Parameters
    ----------
    names : sequence of str
        Any text.
    """
    found: list[str] = []
    for number, name in enumerate(names):
        plain = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")
        taken = not plain[:1].isalpha() or plain in found
        found.append(f"channel_{number}_{plain}".rstrip("_") if taken else plain)
    return tuple(found)
