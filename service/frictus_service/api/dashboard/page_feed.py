"""What one page watches: collects what is new of it since it collected last."""

import logging
from collections.abc import Collection, Iterable
from typing import Any, Final

from frictus.errors import FrameError
from frictus.messages import RigStatus
from frictus.websocket.frames import Frame
from frictus.websocket.messages import VALUES, RigLost, Rigs, Watch
from frictus_service.api.dashboard.channels import FINGERS, Channel, Stream, Value
from frictus_service.api.dashboard.hub import Hub
from frictus_service.api.dashboard.messages import NOT_ALLOWED, RefusedViewerError
from frictus_service.api.dashboard.traces import FingerTrace, Trace
from frictus_service.config import Scope

IDLE_RATE_HZ: Final = 10.0
_LOG: Final = logging.getLogger(__name__)
_NOTHING: Final = Watch(op="watch", rig=None, rate_hz=IDLE_RATE_HZ)


class PageFeed:
    """Collects what is new since it collected last.

    Nothing is queued for a viewer: it has cursors into what all viewers share. One that
    collects late gets the newest of every value, and of every stream what is still held; what
    it lost is counted in its next frame.

    Parameters
    ----------
    hub : Hub
        What all viewers share.
    scopes : collection of str
        What its token allows.
    """

    def __init__(self, hub: Hub, scopes: Collection[Scope]) -> None:
        self._hub = hub
        self._scopes = scopes
        self._told_rigs: Rigs | None = None
        self._told_present: bool | None = None
        self._seen: dict[str, tuple[Channel, int]] = {}
        self._traces: dict[str, Trace] = {}
        self._finger = FingerTrace()
        self.watching = _NOTHING
        self.require("read", "hello")

    def require(self, scope: Scope, what: str) -> None:
        """Raise `RefusedViewerError` unless the viewer's token has a scope.

        Parameters
        ----------
        scope : str
            What is needed.
        what : str
            What for.
        """
        if scope not in self._scopes:
            had = ", ".join(sorted(self._scopes))
            message = f"this needs the scope {scope!r}; the token has {had}"
            raise RefusedViewerError(what, "missing_scope", message, NOT_ALLOWED)

    @property
    def wanted(self) -> frozenset[tuple[str, str]]:
        """The channels it watches."""
        if self.watching.rig is None:
            return frozenset()
        fingers = (FINGERS,) if self.watching.fingers else ()
        return frozenset(
            (self.watching.rig, name) for name in (*VALUES, *self.watching.streams, *fingers)
        )

    @property
    def period_s(self) -> float:
        """Time from one collection to the next."""
        return 1.0 / self.watching.rate_hz

    def watch(self, watch: Watch) -> None:
        """Watch this, in place of what was watched; values are told anew.

        Streams of the same rig that are watched still, in the same way, go on without a gap.

        Parameters
        ----------
        watch : Watch
            As the page sent it.
        """
        before, self.watching = self.watching, _NOTHING if watch.rig is None else watch
        same_rig = before.rig == watch.rig
        traces = self._traces if same_rig and _columns(before) == _columns(watch) else {}
        self._traces = {name: traces.get(name) or Trace(watch) for name in watch.streams}
        going_on = set(traces) & set(watch.streams)
        if same_rig and before.fingers and watch.fingers:
            going_on.add(FINGERS)
        else:
            self._finger = FingerTrace()
        self._told_present = None
        self._seen = {name: seen for name, seen in self._seen.items() if name in going_on}
        self._hub.poke()

    def collect(self) -> list[str | bytes]:
        """Return what is new, as text and binary messages; never waits."""
        self._hub.pump()
        news: list[str | bytes] = []
        rigs = Rigs(rigs=self._hub.rigs, link=self._hub.linked)
        if rigs != self._told_rigs:
            self._told_rigs = rigs
            news.append(rigs.model_dump_json())
        rig = self.watching.rig
        if rig is None:
            return news
        present, before = rig in rigs.rigs, self._told_present
        self._told_present = present
        if not present:
            if before is not False:
                news.append(RigLost(rig=rig).model_dump_json())
            return news + self._values(rig, ("status",) if self._tripped(rig) else ())
        return news + self._values(rig, VALUES) + self._frames(rig)

    def _tripped(self, rig: str) -> bool:
        """Whether the newest status is a trip: of a rig that is gone, by its supervisor."""
        status = self._hub.channel(rig, "status")
        message = status.message if isinstance(status, Value) else None
        return isinstance(message, RigStatus) and message.state == "tripped"

    def _values(self, rig: str, names: Iterable[str]) -> list[str | bytes]:
        news: list[str | bytes] = []
        for name in names:
            value = self._hub.channel(rig, name)
            if isinstance(value, Value) and value.count > self._cursor(name, value, 0):
                self._seen[name] = (value, value.count)
                news.append(value.text)
        return news

    def _frames(self, rig: str) -> list[str | bytes]:
        news: list[str | bytes] = []
        for name, trace in list(self._traces.items()):
            blocks = self._since(rig, name)
            try:
                news.extend([frame.pack() for frame in trace.push(blocks)])
            except (FrameError, ArithmeticError) as error:
                # Not of a rig: its numbers do not fit a frame. What follows is shown anew.
                _LOG.warning("stream %s of rig %s is not shown: %s", name, rig, error)
                self._traces[name] = Trace(self.watching)
        try:
            news.extend([frame.pack() for frame in self._fingers(rig)])
        except (FrameError, ArithmeticError) as error:
            _LOG.warning("the finger on rig %s is not shown: %s", rig, error)
        return news

    def _fingers(self, rig: str) -> list[Frame]:
        status = self._hub.channel(rig, "status")
        if not isinstance(status, Value) or not isinstance(status.message, RigStatus):
            return []  # states are of a run, which the status tells
        states = self._since(rig, FINGERS)
        return self._finger.push(states, status.message.run, status.message.sample_rate_hz)

    def _since(self, rig: str, name: str) -> list[Any]:
        """Return what the viewer has not seen of a stream, and count it as seen."""
        stream = self._hub.channel(rig, name)
        if not isinstance(stream, Stream):
            return []
        items = stream.since(self._cursor(name, stream, stream.count))
        self._seen[name] = (stream, stream.count)
        return items

    def _cursor(self, name: str, channel: Channel, start: int) -> int:
        """Return up to where the viewer has seen a channel; a new one from `start` on."""
        seen, count = self._seen.get(name, (None, 0))
        return count if seen is channel else start


def _columns(watch: Watch) -> tuple[object, ...]:
    """Return what of a request decides which columns its streams have."""
    return watch.raw, watch.columns, watch.window_s, watch.samples_per_column
