"""The protocol of a Neonode touch sensor as a state machine: events in, actions out.

It has no transport and no clock: bytes, connections and times are handed in, and what it wants
is handed out.
"""

from dataclasses import dataclass, replace
from typing import Final, Literal, assert_never

from frictus_hardware.errors import ConfigError
from frictus_hardware.sensors.timing import Instant, unwrapped
from frictus_hardware.sensors.zforce import (
    DETECTION_MODE,
    ENABLE,
    BootComplete,
    FrameReader,
    Malformed,
    Message,
    Touch,
    Touches,
    TouchEvent,
    Unknown,
    ZForceReply,
)

SensorAxis = Literal["+x", "-x", "+y", "-y"]
SENSOR_AXES: Final = ("+x", "-x", "+y", "-y")
SETUP: Final = (DETECTION_MODE, ENABLE)
"""One after the other; each waits for the response to the one before."""
FRAME_PATIENCE_S: Final = 0.1
"""For the rest of a frame."""


@dataclass(frozen=True, slots=True)
class ScreenFrame:
    """How the sensor lies on the screen.

    Attributes
    ----------
    x_along, y_along : {"+x", "-x", "+y", "-y"}
        The direction of the sensor that runs along +x and +y of the screen.
    origin_mm : tuple of float
        Where the sensor's (0, 0) is on the screen.
    mm_per_count : float

    Raises
    ------
    ConfigError
        If both run along one axis of the sensor, or a count is no length.
    """

    x_along: SensorAxis = "+x"
    y_along: SensorAxis = "+y"
    origin_mm: tuple[float, float] = (0.0, 0.0)
    mm_per_count: float = 0.1

    def __post_init__(self) -> None:
        """Refuse what is no frame."""
        given = (self.x_along, self.y_along)
        if not set(given) <= set(SENSOR_AXES) or self.x_along[1] == self.y_along[1]:
            raise ConfigError(
                f"x_along and y_along are {given[0]!r} and {given[1]!r}; accepted are +x, -x, "
                "+y, -y, one of them x and the other y"
            )
        if not self.mm_per_count > 0.0:
            raise ConfigError(f"mm_per_count is {self.mm_per_count}; it must be above 0")

    def on_screen_mm(self, x: int, y: int) -> tuple[float, float]:
        """Return a position in counts of the sensor on the screen, mm."""
        counts = {"x": x, "y": y}

        def along(axis: SensorAxis) -> float:
            return self.mm_per_count * (-1.0 if axis[0] == "-" else 1.0) * counts[axis[1]]

        x_mm, y_mm = self.origin_mm
        return x_mm + along(self.x_along), y_mm + along(self.y_along)


@dataclass(frozen=True, slots=True)
class Send:
    """Bytes for the sensor."""

    data: bytes


@dataclass(frozen=True, slots=True)
class NeonodeReport:
    """Where the finger is.

    Attributes
    ----------
    x_mm, y_mm : float
        On the screen.
    in_contact : bool
        Whether the finger touches the screen.
    arrival_s : float
        When the bytes came, by the clock that was handed in.
    sensor_s : float or None
        When it was measured, by the sensor's counter, since the sensor was enabled; None if
        it sends no time.
    """

    x_mm: float
    y_mm: float
    in_contact: bool
    arrival_s: float
    sensor_s: float | None


@dataclass(frozen=True, slots=True)
class FingerLost:
    """Where the finger is is no longer known; it was in contact until now."""

    why: str


@dataclass(frozen=True, slots=True)
class Reconnect:
    """The transport shall be opened anew, and `connected` or `disconnected` told."""


Action = Send | NeonodeReport | FingerLost | Reconnect


@dataclass(frozen=True, slots=True)
class TouchCounts:
    """What has happened since the beginning."""

    reports: int = 0
    other_fingers: int = 0
    unknown: int = 0
    malformed: int = 0
    restarts: int = 0
    time_jumps: int = 0
    stale: int = 0
    repeated_requests: int = 0
    reconnects: int = 0


class Touchpad:
    """Sets the sensor up, keeps it set up, and follows one finger.

    Parameters
    ----------
    frame : ScreenFrame
        From the sensor's coordinates to the screen's.
    stale_s : float
        A finger in contact of which nothing was told for so long is lost. The sensor goes on
        reporting a finger that is there, 60 to 100 times a second.
    response_s : float
        How long a request waits for its response; after three times the transport is reopened.
    reconnect_s : float
        How long after a failed connection the next is tried.
    """

    ATTEMPTS: Final = 3

    def __init__(
        self,
        frame: ScreenFrame | None = None,
        stale_s: float = 0.1,
        response_s: float = 0.5,
        reconnect_s: float = 1.0,
    ) -> None:
        self._frame = ScreenFrame() if frame is None else frame
        self._stale_s = stale_s
        self._response_s = response_s
        self._reconnect_s = reconnect_s
        self._counts = TouchCounts()
        self._fault: str | None = "the touch sensor is not connected"
        self._connected = False
        self._reconnect_at_s: float | None = None
        self._reset()

    def _reset(self) -> None:
        self._reader = FrameReader()
        self._fed_s = 0.0
        self._to_send: tuple[bytes, ...] = ()
        self._attempts = 0
        self._respond_by_s = 0.0
        self._finger: int | None = None
        self._reported_s = 0.0
        self._instant: Instant | None = None

    @property
    def counts(self) -> TouchCounts:
        """What has happened since the beginning."""
        return self._counts

    @property
    def fault(self) -> str | None:
        """Why positions cannot be relied on, or None. A stale finger: until the next report."""
        return self._fault

    def connected(self, now_s: float) -> tuple[Action, ...]:
        """Set the sensor up: the transport is open."""
        lost = self._lose("the touch sensor was connected anew")
        self._reset()
        self._connected = True
        self._reconnect_at_s = None
        return lost + self._set_up("the touch sensor is being set up", now_s)

    def disconnected(self, why: str, now_s: float) -> tuple[Action, ...]:
        """Give up the transport, which failed or could not be opened; `tick` asks for it anew.

        Parameters
        ----------
        why : str
            Becomes the fault.
        now_s : float
            Monotonic.
        """
        lost = self._lose(why)
        self._reset()
        self._connected = False
        self._fault = why
        self._reconnect_at_s = now_s + self._reconnect_s
        return lost

    def received(self, data: bytes, now_s: float) -> tuple[Action, ...]:
        """Take bytes of the sensor, in pieces of any size; nothing while not connected."""
        if not self._connected:
            return ()
        if data:
            self._fed_s = now_s
        return self._handle(self._reader.feed(data), now_s)

    def tick(self, now_s: float) -> tuple[Action, ...]:
        """Let time pass; to be called at least ten times a second."""
        if not self._connected:
            return self._ask_reconnect(now_s)
        actions: tuple[Action, ...] = ()
        if self._reader.pending and now_s - self._fed_s > FRAME_PATIENCE_S:
            actions += self._handle(self._reader.flush(), now_s)
        if self._finger is not None and now_s > self._reported_s + self._stale_s:
            self._count(stale=1)
            self._fault = f"no touch report for more than {self._stale_s:g} s"
            actions += self._lose(self._fault)
        if self._to_send and now_s >= self._respond_by_s:
            actions += self._send_again(now_s)
        return actions

    def _count(self, **more: int) -> None:
        added = {name: getattr(self._counts, name) + by for name, by in more.items()}
        self._counts = replace(self._counts, **added)

    def _ask_reconnect(self, now_s: float) -> tuple[Action, ...]:
        if self._reconnect_at_s is None or now_s < self._reconnect_at_s:
            return ()
        self._reconnect_at_s = None
        self._count(reconnects=1)
        return (Reconnect(),)

    def _set_up(self, fault: str, now_s: float) -> tuple[Action, ...]:
        self._fault = fault
        self._to_send = SETUP
        self._attempts = 0
        return self._send(now_s)

    def _send(self, now_s: float) -> tuple[Action, ...]:
        self._attempts += 1
        self._respond_by_s = now_s + self._response_s
        return (Send(self._to_send[0]),)

    def _send_again(self, now_s: float) -> tuple[Action, ...]:
        if self._attempts < self.ATTEMPTS:
            self._count(repeated_requests=1)
            return self._send(now_s)
        return self.disconnected(
            f"the touch sensor did not respond to {self.ATTEMPTS} requests", now_s
        )

    def _handle(self, messages: tuple[Message, ...], now_s: float) -> tuple[Action, ...]:
        actions: tuple[Action, ...] = ()
        for message in messages:
            match message:
                case Touches():
                    actions += self._touches(message, now_s)
                case BootComplete():
                    actions += self._restarted(now_s)
                case ZForceReply():
                    actions += self._responded(message, now_s)
                case Unknown():
                    self._count(unknown=1)
                case Malformed():
                    self._count(malformed=1)
                case _:
                    assert_never(message)
        return actions

    def _restarted(self, now_s: float) -> tuple[Action, ...]:
        self._count(restarts=1)
        self._instant = None
        lost = self._lose("the touch sensor restarted")
        return lost + self._set_up("the touch sensor restarted and is being set up", now_s)

    def _responded(self, response: ZForceReply, now_s: float) -> tuple[Action, ...]:
        if not self._to_send or not _answers(response, self._to_send[0]):
            return ()
        self._to_send = self._to_send[1:]
        self._attempts = 0
        if self._to_send:
            return self._send(now_s)
        self._fault = None
        return ()

    def _lose(self, why: str) -> tuple[Action, ...]:
        if self._finger is None:
            return ()
        self._finger = None
        return (FingerLost(why),)

    def _touches(self, message: Touches, now_s: float) -> tuple[Action, ...]:
        sensor_s = None
        if message.ticks is not None:
            self._instant = unwrapped(self._instant, message.ticks, now_s)
            self._count(time_jumps=int(self._instant.jumped))
            sensor_s = self._instant.time_s
        return tuple(
            self._report(touch, now_s, sensor_s)
            for touch in message.touches
            if self._follows(touch)
        )

    def _follows(self, touch: Touch) -> bool:
        if self._finger is None:
            self._finger = touch.finger
        if self._finger == touch.finger:
            return True
        self._count(other_fingers=1)
        return False

    def _report(self, touch: Touch, now_s: float, sensor_s: float | None) -> NeonodeReport:
        self._count(reports=1)
        self._reported_s = now_s
        if not self._to_send:
            self._fault = None
        in_contact = touch.event is not TouchEvent.UP
        if not in_contact:
            self._finger = None
        x_mm, y_mm = self._frame.on_screen_mm(touch.x, touch.y)
        return NeonodeReport(x_mm, y_mm, in_contact, now_s, sensor_s)


def _answers(response: ZForceReply, request: bytes) -> bool:
    """Return whether tag and first element agree; firmware may add to what it was asked."""
    return bytes([response.tag]) == request[6:7] and response.content[:1] == request[8:9]
