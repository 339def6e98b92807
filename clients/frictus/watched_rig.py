"""What a rig says of itself to anybody who looks; nothing here changes it."""

from typing import Final, Literal, TypeVar

import zenoh

from frictus.calls import no_recorder, present_rigs
from frictus.closing import Held, close_all
from frictus.errors import ArgumentError, LinkError, SilenceError
from frictus.gaps import BlockFeed
from frictus.keys import STREAMS, RigKeys, Topic, Topics
from frictus.lease import Leases
from frictus.mailbox import Arrival
from frictus.messages import (
    MESSAGES,
    EstimateState,
    FingerState,
    GuidanceState,
    Message,
    ModelState,
    RecordingState,
    RigStatus,
    SceneState,
    TimeState,
    TouchState,
)
from frictus.readings import Readings
from frictus.reception import Feed

StreamName = Literal["force", "accel", "voltage", "truth", "aux", "render"]
M = TypeVar("M", bound=Message)

FINGER_RING: Final = 4
STATE_RING: Final = 64
TOUCH_QUEUE: Final = 512
BLOCK_QUEUE: Final = 1024  # 5 s of 5 ms blocks
BLOCKS: Final[dict[str, Topic]] = {
    topic.suffix.removeprefix("stream/"): topic for topic in STREAMS.values()
}


class WatchedRig:
    """A rig's states and streams. After a call of this client they include what it changed.

    Parameters
    ----------
    session : zenoh.Session
        The client's session.
    keys : RigKeys
        Site and name.
    timeout_s : float
        Longest wait for a first value.
    readings : Readings or None
        What the rig says of itself, where another `Rig` reads it already and closes it.
    """

    def __init__(
        self, session: zenoh.Session, keys: RigKeys, timeout_s: float, readings: Readings | None
    ) -> None:
        self.keys = keys
        self._session = session
        self._timeout_s = timeout_s
        self._held = Held()
        self._shared = readings is not None
        self._readings = readings or Readings(session, keys, timeout_s)
        self._leases = Leases()

    @property
    def name(self) -> str:
        """Name of the rig."""
        return self.keys.rig

    @property
    def site(self) -> str:
        """Site of the rig."""
        return self.keys.site

    @property
    def present(self) -> bool:
        """Whether the rig's liveliness token stands; raises `LinkError` without a router."""
        return self.keys in present_rigs(self._session, self.site, self._timeout_s)

    def status(self) -> RigStatus:
        """Return the newest status: state, owner, fault, counters, loop timing."""
        return self._readings.value(Topics.STATUS, RigStatus)

    def scene(self) -> SceneState:
        """Return the active scene and what was made of it."""
        return self._readings.value(Topics.SCENE, SceneState)

    def model(self) -> ModelState:
        """Return the active friction model and its etag."""
        return self._readings.value(Topics.MODEL, ModelState)

    def time(self) -> TimeState:
        """Return the fit of the device's sample counter to UTC."""
        return self._readings.value(Topics.TIME, TimeState)

    def recording(self) -> RecordingState:
        """Return what the rig's recorder does; `LinkError` where none runs."""
        try:
            latest = self._readings.latest(Topics.RECORDING, RecordingState)
            return latest.value(self._timeout_s)
        except SilenceError:
            raise LinkError(no_recorder(self.keys)) from None

    def estimate(self) -> EstimateState:
        """Return what `frictus track` knows of the finger now; `LinkError` where none runs."""
        try:
            return self._readings.latest(Topics.ESTIMATE, EstimateState).value(self._timeout_s)
        except SilenceError:
            raise LinkError(
                f"nobody estimates the finger on rig {self.name}: start `frictus track`"
            ) from None

    def watch(
        self, topic: Topic, *, capacity: int = STATE_RING, timeout_s: float | None = None
    ) -> Feed[Message]:
        """Follow any topic of JSON messages, its present value first where it is cached.

        Parameters
        ----------
        topic : Topic
            A member of `frictus.keys.Topics` with JSON messages.
        capacity : int
            Messages held for a slow reader; beyond, the oldest go.
        timeout_s : float or None
            Longest silence before `SilenceError`; None waits for ever.

        Raises
        ------
        ArgumentError
            If the topic does not carry JSON.
        """
        if topic.message not in MESSAGES:
            raise ArgumentError(f"{topic.suffix} carries {topic.message}, which is not JSON")
        kind = MESSAGES[topic.message]
        return self._feed(topic, kind, capacity, timeout_s)

    def fingers(self, *, timeout_s: float | None = None) -> Feed[FingerState]:
        """Follow the finger; a slow reader gets the newest few states, older ones go.

        Once a lease of this client on the rig is lost, the iteration ends with
        `LeaseLostError`; without a lease it goes on whoever drives the screen.

        Parameters
        ----------
        timeout_s : float or None
            Longest silence before `SilenceError`; None waits for ever.
        """
        feed = self._feed(Topics.FINGER, FingerState, FINGER_RING, timeout_s)
        return self._leases.follow(feed)

    def touches(self, *, timeout_s: float | None = None) -> Feed[TouchState]:
        """Follow the touch sensor's reports as they come; a lost lease ends it as `fingers`.

        Parameters
        ----------
        timeout_s : float or None
            Longest silence before `SilenceError`; None waits for ever.
        """
        feed = self._feed(Topics.TOUCH, TouchState, TOUCH_QUEUE, timeout_s)
        return self._leases.follow(feed)

    def guidance(self, *, timeout_s: float | None = None) -> Feed[GuidanceState]:
        """Follow what a participant is asked to do while somebody calibrates on this rig.

        Parameters
        ----------
        timeout_s : float or None
            Longest silence before `SilenceError`; None waits for ever.
        """
        return self._feed(Topics.GUIDANCE, GuidanceState, FINGER_RING, timeout_s)

    def _feed(
        self, topic: Topic, kind: type[M], capacity: int, timeout_s: float | None
    ) -> Feed[M]:
        def decode(arrival: Arrival) -> list[M]:
            return [kind.from_json(arrival.payload)]

        return self._held.keep(Feed(self._readings.declare(topic), decode, capacity, timeout_s))

    def blocks(
        self,
        stream: StreamName,
        *,
        capacity: int = BLOCK_QUEUE,
        timeout_s: float | None = None,
    ) -> BlockFeed:
        """Follow a stream of samples in order, with a `Gap` wherever something is missing.

        It goes on after a lost lease: it shows how the output ramps to zero.

        Parameters
        ----------
        stream : {'force', 'accel', 'voltage', 'truth', 'aux', 'render'}
            N, m/s^2, V, what only a simulated rig knows, further channels, or what the rig
            renders, which comes a lead before it plays; see `frictus.keys.Topics`.
        capacity : int
            Blocks held for a slow reader; beyond, the oldest go and show as a `Gap`.
        timeout_s : float or None
            Longest silence before `SilenceError`; None waits for ever.

        Raises
        ------
        ArgumentError
            If there is no such stream.
        """
        if stream not in BLOCKS:
            raise ArgumentError(f"no stream {stream!r}: {', '.join(BLOCKS)} accepted")
        topic = BLOCKS[stream]
        declare = self._readings.declare(topic)
        return self._held.keep(BlockFeed(declare, topic, capacity, timeout_s))

    def close(self) -> None:
        """Disarm if armed, end every feed and stream. Closing twice is harmless."""
        closes = [*self._leases.disarms(), self._held.close]
        if not self._shared:
            closes.append(self._readings.close)
        close_all(closes)
