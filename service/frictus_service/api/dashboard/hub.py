"""What all viewers share: the link to the rigs, who is present, and the subscriptions.

Zenoh's threads only enqueue. Everything else happens in the event loop, except what may block:
connecting, subscribing and unsubscribing are done in worker threads by one task, which brings
the subscriptions in line with what the viewers want, again and again. So a router that comes
late needs no case of its own. Nor does a rig, or a router, that comes back: what belongs to a
rig that was gone is subscribed to anew, for Zenoh asks for a last value only once.
"""

import asyncio
import contextlib
import logging
from collections.abc import Callable, Iterator
from typing import Final, Protocol

import anyio
import zenoh
from fastapi.concurrency import run_in_threadpool

import frictus
from frictus.client import Presence
from frictus.errors import LinkError
from frictus.keys import person_of, spoken_name
from frictus.messages import RigStatus
from frictus.reception import Feed
from frictus_service.api.dashboard.channels import Channel, Value, open_channel
from frictus_service.api.dashboard.messages import TRY_LATER, RefusedViewerError
from frictus_service.api.services import RigConnection

TEND_S: Final = 0.25
"""How often the link is looked at."""
MAX_VIEWERS: Final = 64
"""No person has more than half of them: others find a place."""
MAX_UPDATES: Final = 8
"""Texture updates and points of pages that are handed to the network at once."""
_LOG: Final = logging.getLogger(__name__)


class ChannelSubscriber(Protocol):
    """Who wants channels."""

    @property
    def wanted(self) -> frozenset[tuple[str, str]]:
        """Names of rigs and of their channels."""
        ...


class Hub:
    """Shares one subscription per rig and channel among all viewers of one event loop.

    Parameters
    ----------
    link : RigConnection
        The API's connection.
    lease_ms : int
        How long a rig that a page holds goes on without hearing from this process.

    Attributes
    ----------
    site : str
        Site of the rigs.
    lease_ms : int
        As given.
    linked : bool
        Whether the router can be reached, as far as is known.
    leases, calls : anyio.CapacityLimiter
        Threads that arm and disarm, and for pages' other calls, one for each page: no page
        waits for another.
    updates : anyio.CapacityLimiter
        Threads for texture updates and points.
    """

    def __init__(self, link: RigConnection, lease_ms: int) -> None:
        self._link = link
        self.site = link.site
        self.lease_ms = lease_ms
        self.linked = False
        self.leases = anyio.CapacityLimiter(MAX_VIEWERS)
        self.calls = anyio.CapacityLimiter(MAX_VIEWERS)
        self.updates = anyio.CapacityLimiter(MAX_UPDATES)
        self._present: set[str] = set()
        self._vanished: set[str] = set()
        self._presence: Feed[Presence] | None = None
        self._client: frictus.Client | None = None
        self._rigs: dict[str, frictus.Rig] = {}
        self._channels: dict[tuple[str, str], Channel] = {}
        self._watchers: list[tuple[str, ChannelSubscriber]] = []
        self._poked = asyncio.Event()
        self._tending: asyncio.Task[None] | None = None

    @contextlib.contextmanager
    def joined(self, watcher: ChannelSubscriber, person: str) -> Iterator[None]:
        """Serve a viewer within the block.

        Parameters
        ----------
        watcher : ChannelSubscriber
            What wants channels.
        person : str
            Whose it is.

        Raises
        ------
        RefusedViewerError
            If there are too many already, of all or of this person.
        """
        own = sum(whose == person for whose, _ in self._watchers)
        if len(self._watchers) >= MAX_VIEWERS or 2 * own >= MAX_VIEWERS:
            message = (
                f"{MAX_VIEWERS} viewers are connected already, which is the most"
                if 2 * own < MAX_VIEWERS
                else f"{own} viewers of {person!r} are connected already, which is the most"
            )
            raise RefusedViewerError("hello", "too_many", message, TRY_LATER)
        joined = person, watcher
        self._watchers.append(joined)
        if self._tending is None:
            self._tending = asyncio.create_task(self._tend())
        self.poke()
        try:
            yield
        finally:
            self._watchers.remove(joined)
            self.poke()

    def poke(self) -> None:
        """Have the subscriptions brought in line now: somebody wants something else."""
        self._poked.set()

    @property
    def rigs(self) -> tuple[str, ...]:
        """Names of the rigs that are present, sorted."""
        return tuple(sorted(self._present)) if self.linked else ()

    def pump(self) -> None:
        """Take what has arrived, for all viewers; never waits."""
        if self._tending is not None and self._tending.done():
            self._tending.result()  # it never ends but by a fault: let it be seen
        self._note_presence()
        for channel in self._channels.values():
            channel.pump()

    def channel(self, rig: str, name: str) -> Channel | None:
        """Return a channel; None while it is not open yet.

        Parameters
        ----------
        rig, name : str
            Name of the rig; name of the stream or value.
        """
        return self._channels.get((rig, name))

    def movable(self, name: str, client: str) -> frictus.Rig:
        """Return a rig whose finger may be moved by a page.

        Parameters
        ----------
        name : str
            A rig that is watched.
        client : str
            The page, as rigs know it.

        Raises
        ------
        RefusedViewerError
            If it is not present, its finger follows no pointer, or another client holds it and
            shares no finger that can be taken over.
        """
        channel = self._channels.get((name, "status"))
        status = channel.message if isinstance(channel, Value) else None
        if name not in self.rigs or not isinstance(status, RigStatus):
            raise RefusedViewerError("point", "no_rig", f"rig {name!r} is not present", None)
        if status.finger_source != "pointer" and not status.finger_takeover:
            raise RefusedViewerError(
                "point",
                "not_feasible",
                f"the finger of rig {name!r} is {status.finger_source}: only a simulated rig "
                "whose finger is set to `client` or `takeover` follows a pointer",
                None,
            )
        owner = status.owner
        shared = {client, person_of(client)} & set(status.share_with)
        if owner not in (None, client) and not (status.finger_takeover and shared):
            message = f"rig {name!r} is held by {spoken_name(owner)}"
            raise RefusedViewerError("point", "not_owner", message, None)
        return self._rigs[name]

    def rig_of(self, rig: str, client: str) -> frictus.Rig:
        """Return a rig as a page commands it; blocks. Whoever takes it closes it.

        Parameters
        ----------
        rig : str
            Its name.
        client : str
            The page, as rigs know it.

        Raises
        ------
        NoRigError, LinkError
        """
        # Waits for a rig that seems absent: on a busy machine one that is there may seem so.
        return self._link.client().rig(rig, self.site).on_behalf_of(client)

    async def close(self) -> None:
        """Release everything; before the link is closed."""
        task, self._tending = self._tending, None
        if task is not None:
            task.cancel()
            await asyncio.wait([task])
        self._watchers.clear()
        await self._release(set())
        if self._presence is not None:
            await run_in_threadpool(self._presence.close)
            self._presence = None

    def _note_presence(self) -> None:
        """Take who came and went."""
        if self._presence is None:
            return
        for (_, name), present in self._presence.drain():
            (self._present.add if present else self._present.discard)(name)
            if not present:
                self._vanished.add(name)
            self.poke()

    async def _tend(self) -> None:
        while True:
            self._poked.clear()
            # Also while nobody looks: of more than the feed holds, the oldest would be lost.
            self._note_presence()
            wanted = {
                (rig, name)
                for _, watcher in self._watchers
                for rig, name in watcher.wanted
                if rig in self.rigs or ((rig, name) in self._channels and self._outlives(name))
            }
            back = self._vanished & self._present
            self._vanished &= {rig for rig, _ in self._channels} - back
            anew = {key for key, channel in self._channels.items() if channel.overdue}
            anew |= {key for key in wanted if key[0] in back}
            await self._release(wanted - anew)
            if self._watchers:
                await self._attempt(wanted)
            with contextlib.suppress(TimeoutError):
                idle = not self._watchers and self._presence is None
                async with asyncio.timeout(None if idle else TEND_S):
                    await self._poked.wait()

    def _outlives(self, name: str) -> bool:
        """Whether a channel goes on without its rig: its supervisor says how that ended."""
        return name == "status" and self.linked

    async def _attempt(self, wanted: set[tuple[str, str]]) -> None:
        try:
            linked = await run_in_threadpool(self._connect)
            for rig, name in sorted(wanted - self._channels.keys()):
                if rig not in self._rigs:
                    self._rigs[rig] = await run_in_threadpool(self._link.recorder_of, rig)
                opened = await run_in_threadpool(open_channel, self._rigs[rig], name)
                self._channels[rig, name] = opened
        except (LinkError, zenoh.ZError) as error:
            linked = False
            if self.linked:
                _LOG.warning("no live data: %s", error)
        self.linked = linked

    def _connect(self) -> bool:
        """Connect if need be, and return whether the router is there."""
        if self._client is None:
            self._client = self._link.client()
        if self._presence is None:
            self._presence = self._client.presence(self.site)
        return bool(self._client.session.info.transports())

    async def _release(self, wanted: set[tuple[str, str]]) -> None:
        """Close what nobody wants."""
        closes: list[Callable[[], None]] = []
        for key in self._channels.keys() - wanted:
            closes.append(self._channels.pop(key).close)
        for rig in self._rigs.keys() - {rig for rig, _ in wanted}:
            closes.append(self._rigs.pop(rig).close)
        for close in closes:
            await run_in_threadpool(close)
