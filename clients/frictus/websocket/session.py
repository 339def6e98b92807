"""What the rigs of one connection share: what is watched, what is held, where messages go."""

import asyncio
import contextlib
from collections.abc import Callable
from typing import Any, Final

from frictus.errors import ArgumentError, LeaseLostError, LinkError, RefusedError
from frictus.keys import STREAMS
from frictus.messages import Message
from frictus.watched_rig import BLOCKS
from frictus.websocket.connection import Connection, Heard, RigValue
from frictus.websocket.feeds import AsyncFeed, fingers_of, samples_of
from frictus.websocket.frames import Frame, Kind
from frictus.websocket.held import AsyncLease, AsyncTextureStream
from frictus.websocket.messages import (
    Disarmed,
    Refused,
    RigLost,
    Rigs,
    StreamClosed,
    StreamProgress,
    Watch,
)

FINGERS: Final = "fingers"
"""Name of the feed of all states of the finger; `finger` is the newest."""
NAMES: Final = {
    number: topic.suffix.removeprefix("stream/") for number, topic in STREAMS.items()
}
"""Stream id in a frame's header, to the stream's name."""


class Session:
    """Sends what arrives to its feeds, and watches what they need.

    Parameters
    ----------
    rate_hz : float
        Most frames of a stream per second, 1 to 60.

    Attributes
    ----------
    connection : Connection
        Set once it is open.
    rigs : Rigs or None
        Which rigs are present; None before the service has said so.
    values : dict
        Newest message of the watched rig by its name, such as ``status``.
    leases : dict
        Newest lease of this client by the rig's name, until it is given back.
    stream : AsyncTextureStream or None
        The one that is open.
    refusals : dict
        Of points and updates, which have no answers, until the next one raises them.
    calls : asyncio.Lock
        The service carries out one call of scenes and streams at a time.
    """

    def __init__(self, rate_hz: float) -> None:
        self.connection: Connection
        self.rigs: Rigs | None = None
        self.values: dict[str, Message] = {}
        self.leases: dict[str, AsyncLease] = {}
        self.stream: AsyncTextureStream | None = None
        self.refusals: dict[str, RefusedError] = {}
        self.calls = asyncio.Lock()
        self._rate_hz = rate_hz
        self._rig: str | None = None
        self._heard_of_rig = False
        self._feeds: dict[str, list[AsyncFeed[Any]]] = {}
        self._asked: Watch | None = None
        self._failure: LinkError | None = None
        self._wanted = asyncio.Event()
        self._rigs_told = asyncio.Event()

    def look_at(self, rig: str) -> None:
        """Have a rig watched.

        Parameters
        ----------
        rig : str
            Its name.

        Raises
        ------
        ArgumentError
            If feeds of another one are open.
        """
        if rig != self._rig:
            if any(self._feeds.values()):
                raise ArgumentError(
                    f"a connection watches one rig, and feeds of {self._rig!r} are open: close "
                    "them, or connect once more"
                )
            self._rig, self._heard_of_rig, self.values = rig, False, {}
            self._asked = None  # all is told anew, also where the rig is the one asked for last
            self._wanted.set()

    def feed(
        self, name: str, open_feed: Callable[[Callable[[AsyncFeed[Any]], None]], Any]
    ) -> Any:
        """Return a feed that gets what arrives under a name until it is closed.

        Parameters
        ----------
        name : str
            A stream, `FINGERS`, or the name of a value.
        open_feed : callable
            Makes it, given what it shall call once it is closed.
        """

        def closed(feed: AsyncFeed[Any]) -> None:
            self._feeds[name].remove(feed)
            self._wanted.set()

        feed = open_feed(closed)
        self._feeds.setdefault(name, []).append(feed)
        self._wanted.set()
        if self._failure is not None:
            feed.fail(self._failure)
        return feed

    async def watch_for_ever(self) -> None:
        """Tell the service what is wanted, whenever that changes, until it is lost."""
        with contextlib.suppress(LinkError):  # all feeds know it
            while True:
                await self._wanted.wait()
                self._wanted.clear()
                await self.watch()

    async def watch(self) -> None:
        """Tell the service what is wanted, unless it knows."""
        wanted = Watch(
            op="watch",
            rig=self._rig,
            streams=tuple(name for name in BLOCKS if self._feeds.get(name)),  # type: ignore[misc]
            rate_hz=self._rate_hz,
            raw=True,
            fingers=bool(self._feeds.get(FINGERS)),
        )
        if wanted != self._asked:
            self._asked = wanted
            await self.connection.say(wanted)

    async def await_rigs(self, holds: Callable[[Rigs], bool], timeout_s: float) -> None:
        """Wait until something holds of the rigs that are present, or the time is over.

        Parameters
        ----------
        holds : callable
            Given which are present.
        timeout_s : float
            Longest wait.

        Raises
        ------
        LinkError
            If the connection is lost.
        """
        try:
            async with asyncio.timeout(timeout_s):
                while self.rigs is None or not holds(self.rigs):
                    if self._failure is not None:
                        raise self._failure
                    self._rigs_told.clear()
                    await self._rigs_told.wait()
        except TimeoutError:
            return

    def hear(self, heard: Heard) -> None:
        """Take in what the service has sent.

        Parameters
        ----------
        heard : Frame, RigValue or Message
            As it came.
        """
        match heard:
            case Frame():
                # Those that come before the rig's first message are of the one watched before.
                if self._heard_of_rig:
                    self._take(heard)
            case RigValue(rig=rig) if rig == self._rig:
                self._heard_of_rig = True
                self.values[heard.op] = heard.message
                self._put(heard.op, heard.message)
            case Rigs():
                self.rigs = heard
                self._rigs_told.set()
            case RigLost(rig=rig) if rig == self._rig:
                self.values = {}
            case Disarmed(rig=rig, reason=reason) if reason and rig in self.leases:
                self._lose_lease(rig, LeaseLostError(reason, heard.by, heard.utc_ns))
            case StreamProgress() if self.stream is not None:
                self.stream.updates = heard
            case StreamClosed() if self.stream is not None:
                self.stream.updates = heard
                self.stream.fail(LeaseLostError(f"the stream has ended: {heard.reason}"))
                self.stream = None
            case Refused(what="point" | "update" as what, id=None):
                self.refusals[what] = RefusedError(heard.code, heard.message)
            case _:
                pass

    def follow_lease(self, rig: str, follower: "AsyncFeed[Any] | AsyncTextureStream") -> None:
        """Have a feed or stream fail where a lease of this client is lost already.

        Parameters
        ----------
        rig : str
            Whose lease.
        follower : AsyncFeed or AsyncTextureStream
            `hear` has it fail later.
        """
        lease = self.leases.get(rig)
        if lease is not None and lease.loss is not None:
            follower.fail(lease.loss)

    def fail(self, failure: LinkError) -> None:
        """End every feed, stream and lease: the connection is lost.

        Parameters
        ----------
        failure : LinkError
            Why.
        """
        self._failure = failure
        self._rigs_told.set()
        for feeds in self._feeds.values():
            for feed in feeds:
                feed.fail(failure)
        if self.stream is not None:
            self.stream.fail(failure)
        for lease in self.leases.values():
            lease.lose(LeaseLostError(str(failure)))

    def _lose_lease(self, rig: str, loss: LeaseLostError) -> None:
        self.leases[rig].lose(loss)
        for feed in self._feeds.get(FINGERS, ()) if rig == self._rig else ():
            feed.fail(loss)
        if self.stream is not None:
            self.stream.fail(loss)

    def _take(self, frame: Frame) -> None:
        if frame.kind == Kind.FINGER:
            if self._feeds.get(FINGERS):
                for state in fingers_of(frame):
                    self._put(FINGERS, state)
        elif frame.kind == Kind.RAW:
            self._put(NAMES[frame.stream], samples_of(frame))

    def _put(self, name: str, item: object) -> None:
        for feed in self._feeds.get(name, ()):
            feed.put(item)
