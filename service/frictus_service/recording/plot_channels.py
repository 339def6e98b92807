"""How Foxglove and Lichtblick are told what a rig says: topics, schemas, bytes and times.

They plot one value a message, at the message's time. So each sample becomes a message of its
own: the channels as float32, which the well-known encoding `ros1` describes without overhead.
Files and live connections share this. https://mcap.dev/spec/registry
"""

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Final

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel

from frictus.block import MAX_FIRST_SAMPLE
from frictus.keys import AUX, CHANNELS, STREAMS, TOPICS
from frictus.messages import AuxChannel, TimeState
from frictus.slewed_clock import SlewedClock
from frictus_service.recording.plain_schema import plain_schema
from frictus_service.recording.reader import STATE_KINDS
from frictus_service.recording.records import NOTES, STREAM_NAMES
from frictus_service.recording.writer import JSON_SCHEMA

STEP_NS: Final = 100_000_000
"""A fit that is further off is no fit but a UTC clock that was set: it is followed at once."""
MAX_RUNS: Final = 64
"""Of which the clocks are kept."""
HELD: Final = {topic.suffix for topic in TOPICS if topic.latest}
"""Topics of which the last message holds until the next."""
DOCUMENTS: Final[dict[str, type[BaseModel]]] = {**STATE_KINDS, **NOTES}


@dataclass(frozen=True, slots=True)
class PlotChannel:
    """A topic as viewers are told of it.

    Attributes
    ----------
    topic : str
        Such as `stream/force`.
    encoding : str
        Of its messages: `ros1` or `json`.
    schema_name, schema_encoding : str
        What its messages are called, and how the schema is written: `ros1msg` or `jsonschema`.
    schema : bytes
        Names and types of the fields.
    metadata : dict of str to str
        The unit, of samples.
    """

    topic: str
    encoding: str
    schema_name: str
    schema_encoding: str
    schema: bytes
    metadata: dict[str, str]


def sample_channel(stream: int, n_channels: int, aux: Sequence[AuxChannel]) -> PlotChannel:
    """Return what describes the samples of a stream.

    Parameters
    ----------
    stream : int
        Of `STREAMS`.
    n_channels : int
        That its blocks have.
    aux : sequence of AuxChannel
        Of the rig's status.
    """
    names = CHANNELS.get(stream, ())
    if stream == AUX:
        names = field_names([f"{one.name}_{one.unit}" for one in aux])
    if len(names) != n_channels:  # of a later version, or of a status of another rig
        names = tuple(f"channel_{number}" for number in range(n_channels))
    return PlotChannel(
        topic=STREAMS[stream].suffix,
        encoding="ros1",
        schema_name=f"frictus/{STREAM_NAMES[stream].capitalize()}",
        schema_encoding="ros1msg",
        schema="".join(f"float32 {name}\n" for name in names).encode(),
        metadata={"unit": STREAMS[stream].unit},
    )


@cache
def document_channel(topic: str) -> PlotChannel:
    """Return what describes a state or a note.

    Parameters
    ----------
    topic : str
        Of `DOCUMENTS`.
    """
    kind = DOCUMENTS[topic]
    schema = json.dumps(plain_schema(kind)).encode()
    return PlotChannel(topic, "json", kind.__name__, JSON_SCHEMA, schema, {})


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


def sample_messages(data: NDArray[np.float32]) -> list[bytes]:
    """Return samples, each as the bytes of a message.

    Parameters
    ----------
    data : ndarray of float32, shape (n_channels, n_samples)
        In the channels' units.
    """
    rows = np.ascontiguousarray(data.T, "<f4")
    content, width = rows.tobytes(), rows.itemsize * rows.shape[1]
    return [content[at : at + width] for at in range(0, len(content), width)]


def column_extremes(
    data: NDArray[np.float32], samples_per_column: int
) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """Return the least and the greatest value of each column of samples, in turn.

    Parameters
    ----------
    data : ndarray of float32, shape (n_channels, n_samples)
        Of a block; the last column may be shorter.
    samples_per_column : int
        At least 2.

    Returns
    -------
    extremes : ndarray of float32, shape (n_channels, n)
        Minimum, maximum, minimum, …
    at : ndarray of int64, shape (n,)
        The sample at which each is to be drawn: a column's first, and its middle one. Rises.
    """
    starts = np.arange(0, data.shape[1], samples_per_column)
    middles = (starts + np.append(starts[1:], data.shape[1])) // 2
    at = np.stack((starts, middles), axis=1).ravel()
    folded = np.stack(
        (np.minimum.reduceat(data, starts, axis=1), np.maximum.reduceat(data, starts, axis=1)),
        axis=2,
    ).reshape(len(data), -1)
    once = np.diff(at, prepend=-1) > 0  # a last column of one sample is both
    return folded[:, once], at[once]


def is_plausible(first_sample: int, n_samples: int, utc_ns: int, rate_hz: float) -> bool:
    """Return whether counts and times can be computed with, as a rig's can."""
    counts = rate_hz >= 1.0 and 0 <= first_sample < MAX_FIRST_SAMPLE - n_samples
    return counts and 0 <= utc_ns < 2**62  # until 2116


@dataclass(slots=True)
class SampleTimes:
    """When samples were taken: each run's count on UTC, by a line that rises."""

    _clocks: dict[int, SlewedClock] = field(default_factory=dict)

    def of(
        self, run: int, first_sample: int, n_samples: int, utc_ns: int, rate_hz: float
    ) -> NDArray[np.int64]:
        """Return the UTC of consecutive samples.

        Parameters
        ----------
        run : int
            Of the rig.
        first_sample, n_samples : int
            Their counts.
        utc_ns : int
            Of the first, as its block says; a new run's line begins there.
        rate_hz : float
            At least 1.

        Returns
        -------
        ndarray of int64, shape (n_samples,)
            Nanoseconds.
        """
        clock = self._clocks.get(run)
        if clock is None:
            clock = self._begin(run, SlewedClock(first_sample, utc_ns, 1e9 / rate_hz))
        return clock.time_ns(np.arange(first_sample, first_sample + n_samples))

    def follow(self, fit: TimeState) -> None:
        """Take a new fit of a run of which samples came."""
        clock = self._clocks.get(fit.run)
        if clock is None:
            return
        clock.approach(fit.sample, fit.utc_ns, fit.ns_per_sample)
        if abs(clock.error_ns) > STEP_NS:
            self._begin(fit.run, SlewedClock(fit.sample, fit.utc_ns, fit.ns_per_sample))

    def _begin(self, run: int, clock: SlewedClock) -> SlewedClock:
        self._clocks[run] = clock
        if len(self._clocks) > MAX_RUNS:
            del self._clocks[next(iter(self._clocks))]
        return clock
