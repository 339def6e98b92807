"""A recording becomes a file that Foxglove and Lichtblick plot, sample by sample."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import Any, Final

import numpy as np
from mcap.writer import CompressionType, Writer

from frictus.messages import AuxChannel, RigStatus, TimeState
from frictus_service.errors import ExportError
from frictus_service.recording.plot_channels import (
    HELD,
    PlotChannel,
    SampleTimes,
    document_channel,
    is_plausible,
    sample_channel,
    sample_messages,
)
from frictus_service.recording.reader import (
    Ending,
    Item,
    RecordingReader,
    State,
)
from frictus_service.recording.records import (
    END,
    GAPS,
    PRESENCE,
    EndNote,
    GapNote,
    PresenceNote,
)
from frictus_service.recording.samples import Samples
from frictus_service.recording.segments import check_part
from frictus_service.recording.writer import new_file

MAX_MESSAGES: Final = 20_000_000
"""Of one file, which a viewer takes into memory."""
CHUNK_BYTES: Final = 4_000_000
LAYOUT: Final = files("frictus_service.recording") / "foxglove_layout.json"
"""Panels for what an exported recording holds."""
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
        begin_ns, end_ns = _part(reader, from_s, to_s)
        content = reader.attachments.get("status.json")
        aux = () if content is None else RigStatus.from_json(content).aux
        with new_file(out) as file:
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


def _part(reader: RecordingReader, from_s: float | None, to_s: float | None) -> tuple[int, int]:
    """Return when the part begins and ends, ns UTC."""
    check_part(from_s, to_s)
    spans = [
        (item.utc_ns, item.utc_ns + round(1e9 * item.duration_s), item.data.shape[1])
        for item in reader.items()
        if isinstance(item, Samples) and _is_plausible(item)
    ]
    if not spans:
        why = "" if reader.ending.complete else f"; it {reader.ending}"
        raise ExportError(f"it holds no samples: there is nothing to plot{why}")
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
    n, rate_hz = samples.data.shape[1], samples.sample_rate_hz
    if is_plausible(samples.first_sample, n, samples.utc_ns, rate_hz):
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
    _times: SampleTimes = field(default_factory=SampleTimes)
    _before: dict[str, bytes] = field(default_factory=dict)

    def samples(self, samples: Samples, begin_ns: int, end_ns: int) -> None:
        times_ns = self._times.of(
            samples.run,
            samples.first_sample,
            samples.data.shape[1],
            samples.utc_ns,
            samples.sample_rate_hz,
        )
        (within,) = np.nonzero((times_ns >= begin_ns) & (times_ns < end_ns))
        if not within.size:
            return
        self._begin(begin_ns)
        channel = self._channel(sample_channel(samples.stream, len(samples.data), self.aux))
        messages = sample_messages(samples.data[:, within])
        add: Callable[..., None] = self.writer.add_message
        for message, at_ns in zip(messages, times_ns[within].tolist(), strict=True):
            add(channel, at_ns, message, at_ns)
        self.messages += len(messages)

    def document(self, item: Item, begin_ns: int, end_ns: int) -> None:
        """Write a state or a note; what holds when the part begins is written there."""
        if isinstance(item, State):
            if isinstance(item.message, TimeState):
                self._times.follow(item.message)
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
        channel = self._channel(document_channel(topic))
        self.writer.add_message(channel, at_ns, payload, at_ns)
        self.messages += 1

    def _channel(self, described: PlotChannel) -> int:
        topic = described.topic
        if topic not in self._channels:
            schema = self.writer.register_schema(
                described.schema_name, described.schema_encoding, described.schema
            )
            self._channels[topic] = self.writer.register_channel(
                topic, described.encoding, schema, described.metadata
            )
        return self._channels[topic]
