"""Outlets of Lab Streaming Layer: what a rig measures, with labels and units.

A stamp is that of a chunk's last sample; LSL spaces those before it by the nominal rate. Lost
samples become NaN, so that all stay evenly spaced: what reads an XDF file straightens stamps by
counting samples.
"""

from collections.abc import Callable, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
import pylsl
from numpy.typing import NDArray

from frictus.keys import AUX, STREAMS, Topic, Topics
from frictus.messages import RigStatus

CHUNK: Final = 500
"""Samples pushed at once at most: spaced by the nominal rate they must not reach back to the
chunk before, whatever the clock is off and slewed by."""
MAX_FILL_S: Final = 1.0
"""A longer loss is a jump of the stamps: readers begin a new segment there. So are counts that
go back by more: what was far ahead of the rig was not of the rig, and is not to mute it."""
MARKERS: Final = "markers"
FINGER: Final = "finger"
STREAM_IDS: Final = {
    topic.suffix.removeprefix("stream/"): number for number, topic in STREAMS.items()
}
OUTLETS: Final = (*STREAM_IDS, FINGER)
"""Names of what may be sent."""


class OutletChannel(NamedTuple):
    """One channel of a stream."""

    label: str
    unit: str


FINGER_CHANNELS: Final = (
    OutletChannel("x_mm", "mm"),
    OutletChannel("y_mm", "mm"),
    OutletChannel("vx_mm_s", "mm/s"),
    OutletChannel("vy_mm_s", "mm/s"),
    OutletChannel("normal_force_n", "N"),
    OutletChannel("in_contact", ""),
)
"""Fields of `FingerState`."""


def channels_of(name: str, status: RigStatus) -> tuple[OutletChannel, ...]:
    """Return the channels of a stream.

    Parameters
    ----------
    name : str
        One of `OUTLETS`.
    status : RigStatus
        Of the rig: it names the channels of `aux`.
    """
    if name == FINGER:
        return FINGER_CHANNELS
    if STREAM_IDS[name] == AUX:
        return tuple(OutletChannel(one.name, one.unit) for one in status.aux)
    return _named(STREAMS[STREAM_IDS[name]])


def _named(topic: Topic) -> tuple[OutletChannel, ...]:
    parts = topic.message.removeprefix("Block: ").split(", ")
    shared = "" if topic.unit == Topics.RENDER.unit else topic.unit
    named = (part.partition(" ") for part in parts)
    return tuple(OutletChannel(label, unit or shared) for label, _, unit in named)


def described(
    name: str, status: RigStatus, rate_hz: float, channels: Sequence[OutletChannel]
) -> Any:
    """Return the description of an outlet.

    Parameters
    ----------
    name : str
        One of `OUTLETS`, or `MARKERS`.
    status : RigStatus
        Of the rig.
    rate_hz : float
        Nominal; 0 of markers.
    channels : sequence of OutletChannel
        What stands in a sample.

    Returns
    -------
    pylsl.StreamInfo
    """
    kind = "string" if name == MARKERS else "float32"
    content = {"accel": "Accelerometer"}.get(name, name.capitalize())
    source = f"frictus/{status.site}/{status.rig}/{name}"
    info = pylsl.StreamInfo(
        f"{status.rig}-{name}", content, len(channels), rate_hz, kind, source
    )
    description = info.desc()
    listed = description.append_child("channels")
    for channel in channels:
        one = listed.append_child("channel")
        one.append_child_value("label", channel.label)
        one.append_child_value("unit", channel.unit)
        one.append_child_value("type", content)
    acquisition = description.append_child("acquisition")
    acquisition.append_child_value("manufacturer", "frictus")
    acquisition.append_child_value("model", status.backend)
    acquisition.append_child_value("software", status.version)
    acquisition.append_child_value("simulated", str(status.simulated).lower())
    # With "true" readers would not count samples, and leave stamps as ragged as they came.
    description.append_child("synchronization").append_child_value("can_drop_samples", "false")
    return info


class SampleOutlet:
    """An outlet of samples that are counted.

    Parameters
    ----------
    info : pylsl.StreamInfo
        Of float32 channels.

    Attributes
    ----------
    sent, filled : int
        Samples that were measured, and those that stand for lost ones.
    """

    def __init__(self, info: Any) -> None:
        self.sent = self.filled = 0
        self.channels: int = info.channel_count()
        self._outlet = pylsl.StreamOutlet(info)
        self._most = round(MAX_FILL_S * info.nominal_srate())
        self._run = -1
        self._next = 0

    @property
    def due(self) -> tuple[int, int]:
        """Run and count of the sample that comes next; run -1 before the first."""
        return self._run, self._next

    def push(
        self, run: int, first: int, rows: NDArray[np.float32], stamp_s: Callable[[int], float]
    ) -> None:
        """Send consecutive samples, and NaN for those that are missing before them.

        Parameters
        ----------
        run : int
            Of the rig; counts begin anew with it.
        first : int
            Count of the first sample.
        rows : ndarray of float32, shape (n_samples, n_channels)
            In the channels' units.
        stamp_s : callable
            Local time by a sample's count, s.
        """
        missing = first - self._next if run == self._run else 0
        if 0 < missing <= self._most:
            lost = np.full((missing, self.channels), np.nan, np.float32)
            self._push(self._next, lost, stamp_s)
            self.filled += missing
        elif -self._most <= missing < 0:  # sent already
            rows, first = rows[-missing:], self._next
        self._push(first, rows, stamp_s)
        self.sent += len(rows)
        self._run, self._next = run, first + len(rows)

    def _push(
        self, first: int, rows: NDArray[np.float32], stamp_s: Callable[[int], float]
    ) -> None:
        for begin in range(0, len(rows), CHUNK):
            part = rows[begin : begin + CHUNK]
            self._outlet.push_chunk(part, stamp_s(first + begin + len(part) - 1))


class MarkerOutlet:
    """An outlet of texts.

    Parameters
    ----------
    status : RigStatus
        Of the rig.

    Attributes
    ----------
    sent : int
        Texts so far.
    """

    def __init__(self, status: RigStatus) -> None:
        self.sent = 0
        info = described(MARKERS, status, pylsl.IRREGULAR_RATE, [OutletChannel("marker", "")])
        self._outlet = pylsl.StreamOutlet(info)

    def push(self, text: str, stamp_s: float) -> None:
        """Send a text.

        Parameters
        ----------
        text : str
            Of any length.
        stamp_s : float
            Local time, s.
        """
        self._outlet.push_sample([text], stamp_s)
        self.sent += 1

    def close(self) -> None:
        """Take it off the network."""
        del self._outlet
