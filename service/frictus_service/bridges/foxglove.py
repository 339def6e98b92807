"""The bridge to Foxglove and Lichtblick: what a rig says, live over Foxglove's WebSocket.

Topics, schemas and encodings are those of exported recordings (`recording.plot_channels`).
"""

import time
from collections import Counter, deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import foxglove
from foxglove.websocket import ChannelView, ServerListener
from foxglove.websocket import Client as Viewer

from frictus.block import Block
from frictus.client import Client
from frictus.closing import Closing
from frictus.keys import AUX, CHANNELS, STREAMS, Topic, Topics
from frictus.messages import RigStatus, TimeState
from frictus.rig import Rig
from frictus_service.errors import StartError
from frictus_service.recording.plot_channels import (
    HELD,
    PlotChannel,
    SampleTimes,
    column_extremes,
    document_channel,
    is_plausible,
    sample_channel,
    sample_messages,
)
from frictus_service.recording.recording import Intake
from frictus_service.recording.records import (
    GAPS,
    PRESENCE,
    STREAM_NAMES,
    GapNote,
    PresenceNote,
)
from frictus_service.recording.writer import STATES

BACKLOG: Final = 262_144
"""Messages kept for a viewer that is slow: 3 s of four streams at 20 kHz. The oldest are
dropped first, and the package does not say so."""
REPEAT_S: Final = 5.0
"""What holds is sent again so often: of a slow viewer's backlog states are dropped too, and a
scene that was would be missing until the next one."""
STREAM_IDS: Final = {name: stream for stream, name in STREAM_NAMES.items()}
DEFAULT_STREAMS: Final = ("force", "accel", "voltage", "render")
"""What the layout shows."""


@dataclass(frozen=True, slots=True)
class FoxgloveReport:
    """What a bridge has done so far.

    Attributes
    ----------
    seconds : float
        Since it began.
    viewers : int
        That subscribe to something now.
    sent : dict of str to int
        Messages by topic that somebody subscribed to.
    lost : int
        Blocks that never came from the rig.
    refused : int
        Blocks that cannot be read, or whose counts or times no rig has.
    cpu_percent : float
        Of one processor, since it began.
    """

    seconds: float
    viewers: int
    sent: dict[str, int]
    lost: int
    refused: int
    cpu_percent: float


class Subscriptions(ServerListener):
    """Who looks at what; threads of the server call it."""

    def __init__(self) -> None:
        self.new: deque[str] = deque()
        self._held: set[tuple[int, str]] = set()

    @property
    def viewers(self) -> int:
        """How many subscribe to something."""
        return len({viewer for viewer, _ in self._held.copy()})

    def on_subscribe(self, client: Viewer, channel: ChannelView) -> None:
        """Remember it: what holds is told again."""
        self._held.add((client.id, channel.topic))
        self.new.append(channel.topic)

    def on_unsubscribe(self, client: Viewer, channel: ChannelView) -> None:
        """Forget it."""
        self._held.discard((client.id, channel.topic))


class FoxgloveBridge(Closing):
    """Serves what a rig publishes while `turn` is called; a context manager.

    Parameters
    ----------
    client : Client
        Connected; it reads alone.
    rig : Rig
        Is there.
    streams : sequence of str
        Of `STREAM_IDS`; one that the rig has not stays silent.
    samples_per_column : int
        1: each sample is a message. More: of so many samples the least value of each channel,
        then the greatest, as a page draws them; viewers lay out some thousand messages a
        second, not 80 000.
    host : str
        Interface; the server asks nobody who they are.
    port : int
        0: any that is free.

    Attributes
    ----------
    port : int
        That is served.

    Raises
    ------
    LinkError
        If the rig says nothing.
    StartError
        If the port cannot be had.
    """

    def __init__(
        self,
        client: Client,
        rig: Rig,
        streams: Sequence[str] = DEFAULT_STREAMS,
        samples_per_column: int = 1,
        host: str = "127.0.0.1",
        port: int = 0,
    ) -> None:
        self._rig = rig
        self._samples_per_column = samples_per_column
        self._aux = rig.status().aux
        self._times = SampleTimes()
        self._held: dict[str, bytes] = {}
        self._sent: Counter[str] = Counter()
        self._refused = 0
        self._repeat_s = 0.0
        self._began_s, self._began_cpu_s = time.monotonic(), time.process_time()
        self._context = foxglove.Context()
        self._channels: dict[str, tuple[PlotChannel, foxglove.Channel]] = {}
        self._subscriptions = Subscriptions()
        try:
            self._server = foxglove.start_server(
                name=f"frictus {rig.site}/{rig.name}",
                host=host,
                port=port,
                context=self._context,
                server_listener=self._subscriptions,
                message_backlog_size=BACKLOG,
            )
        except RuntimeError as error:
            raise StartError(
                f"{host}:{port} cannot be served: {error}; --port 0 takes a free one"
            ) from error
        self.port: int = self._server.port
        self._streams = [STREAM_IDS[name] for name in streams]
        self._intake = Intake(client.session, rig.keys, self._streams)
        self._presence = client.presence(rig.site)
        for topic in (*(state.suffix for state in STATES), GAPS, PRESENCE):
            self._channel(document_channel(topic))
        self._advertise_streams()

    def turn(self) -> None:
        """Send what has come since; does not wait."""
        now_ns = time.time_ns()
        self._intake.drain_into(self, now_ns)
        for change in self._presence.drain():
            if change.rig.name == self._rig.name:
                note = PresenceNote(utc_ns=now_ns, present=change.present)
                self._document(PRESENCE, note.to_json(), now_ns)
        again = {self._subscriptions.new.popleft() for _ in range(len(self._subscriptions.new))}
        if time.monotonic() >= self._repeat_s:
            self._repeat_s = time.monotonic() + REPEAT_S
            again |= self._held.keys()
        for topic in again & self._held.keys():
            self._document(topic, self._held[topic], now_ns)

    def state(self, topic: Topic, payload: bytes, utc_ns: int) -> None:
        """Send a state as it was published."""
        if topic == Topics.TIME:
            self._times.follow(TimeState.from_json(payload))
        elif topic == Topics.STATUS:
            self._aux = RigStatus.from_json(payload).aux
            self._advertise_streams()
        if topic.suffix in HELD:
            self._held[topic.suffix] = payload
        self._document(topic.suffix, payload, utc_ns)

    def gap(self, note: GapNote) -> None:
        """Send word of what is missing."""
        self._refused += note.reason == "unreadable"
        self._document(GAPS, note.to_json(), note.utc_ns)

    def block(self, block: Block) -> None:
        """Send samples, or the extremes of their columns, if somebody looks at them."""
        data = block.data
        n_channels, n_samples = data.shape
        first, rate_hz = block.first_sample, block.sample_rate_hz
        if not is_plausible(first, n_samples, block.utc_ns, rate_hz):
            self._refused += 1
            return
        times_ns = self._times.of(block.run, first, n_samples, block.utc_ns, rate_hz)
        channel = self._channel(sample_channel(block.stream, n_channels, self._aux))
        if not channel.has_sinks():
            return
        if self._samples_per_column > 1:
            data, at = column_extremes(data, self._samples_per_column)
            times_ns = times_ns[at]
        for message, at_ns in zip(sample_messages(data), times_ns.tolist(), strict=True):
            channel.log(message, log_time=at_ns)
        self._sent[STREAMS[block.stream].suffix] += len(times_ns)

    def report(self) -> FoxgloveReport:
        """Return what was done so far."""
        seconds = time.monotonic() - self._began_s
        spent_s = time.process_time() - self._began_cpu_s
        return FoxgloveReport(
            seconds=seconds,
            viewers=self._subscriptions.viewers,
            sent=dict(self._sent),
            lost=self._intake.lost_blocks,
            refused=self._refused,
            cpu_percent=100.0 * spent_s / seconds,
        )

    def _advertise_streams(self) -> None:
        for stream in self._streams:
            n_channels = len(self._aux if stream == AUX else CHANNELS[stream])
            if n_channels:  # else a rig without further channels
                self._channel(sample_channel(stream, n_channels, self._aux))

    def _document(self, topic: str, payload: bytes, utc_ns: int) -> None:
        channel = self._channel(document_channel(topic))
        if channel.has_sinks():
            channel.log(payload, log_time=utc_ns)
            self._sent[topic] += 1

    def _channel(self, described: PlotChannel) -> foxglove.Channel:
        """Return the channel that is advertised so; another one of its topic is taken back."""
        known, channel = self._channels.get(described.topic, (None, None))
        if channel is None or known != described:
            if channel is not None:
                channel.close()
            channel = foxglove.Channel(
                described.topic,
                message_encoding=described.encoding,
                schema=foxglove.Schema(
                    name=described.schema_name,
                    encoding=described.schema_encoding,
                    data=described.schema,
                ),
                context=self._context,
                metadata=described.metadata,
            )
            self._channels[described.topic] = (described, channel)
        return channel

    def close(self) -> None:
        """Stop following, and serving."""
        self._intake.close()
        self._presence.close()
        self._server.stop()
