"""What one page does to a rig: what it has armed, and the points of its pointer."""

import asyncio
import contextlib
import functools
import time
from collections.abc import Awaitable, Callable
from typing import Final, NamedTuple

import zenoh
from anyio import to_thread

import frictus
from frictus.errors import (
    ArgumentError,
    FrictusError,
    LeaseLostError,
    NoRigError,
    OutcomeUnknownError,
    RefusedError,
)
from frictus.lease import Lease
from frictus.websocket.messages import Armed, Disarmed, PageArmRequest, PageDisarmRequest, Point
from frictus_service.api.dashboard.hub import Hub
from frictus_service.api.dashboard.messages import RefusedViewerError

LOOK_S: Final = 0.1
FAULTS: Final = (FrictusError, zenoh.ZError)
"""What a command to a rig may end with."""


class _ArmedRig(NamedTuple):
    """A rig that a page has armed."""

    rig: frictus.Rig
    lease: Lease

    def disarm(self) -> None:
        """Give it back; whatever it says, it is closed."""
        with contextlib.closing(self.rig):
            self.lease.disarm()


class Arming:
    """Holds the lease of one page on at most one rig.

    Parameters
    ----------
    hub : Hub
        Arms rigs.
    client : str
        The page, as rigs know it.
    tell : callable
        Sends a message to the page.
    given_back : callable
        Told which rig is no longer held, and why, before the page is.
    """

    def __init__(
        self,
        hub: Hub,
        client: str,
        tell: Callable[[str], Awaitable[None]],
        given_back: Callable[[str, str], None],
    ) -> None:
        self._hub = hub
        self._client = client
        self._tell = tell
        self._given_back = given_back
        self._asked: PageArmRequest | None = None
        # A task of its own: what a worker thread has armed is known even if nobody waits.
        self._arming: asyncio.Task[_ArmedRig] | None = None
        self._changing = asyncio.Lock()
        self._heard_s = time.monotonic()

    def hear(self) -> None:
        """Take note that the page is there."""
        self._heard_s = time.monotonic()

    async def arm(self, asked: PageArmRequest) -> None:
        """Arm a rig for the page and tell it.

        Parameters
        ----------
        asked : PageArmRequest
            Which rig, and how.

        Raises
        ------
        RefusedViewerError
            If it has one already, or the rig refuses.
        """
        async with self._changing:
            if self._arming is not None and self._asked is not None:
                message = f"this page holds rig {self._asked.rig!r}: disarm it first"
                raise RefusedViewerError("arm", "conflict", message, None)
            self._asked = asked
            self._arming = asyncio.create_task(
                to_thread.run_sync(self._armed, asked, limiter=self._hub.leases)
            )
            try:
                await asyncio.shield(self._arming)
            except FAULTS as error:
                self._arming = None
                raise RefusedViewerError("arm", code_of(error), str(error), None) from error
            self.hear()
            await self._tell(Armed(rig=asked.rig, id=asked.id).model_dump_json())

    def _armed(self, asked: PageArmRequest) -> _ArmedRig:
        rig = self._hub.rig_of(asked.rig, self._client)
        try:
            lease = rig.arm(
                lease_ms=self._hub.lease_ms,
                share_with=asked.share_with,
                keep_model=asked.keep_model,
                # Asked in the lease's thread: this event loop may be what stands still.
                still_there=lambda: self._silence_s() <= asked.lease_ms / 1_000,
            )
        except BaseException:
            rig.close()
            raise
        return _ArmedRig(rig, lease)

    async def disarm(self, asked: PageDisarmRequest) -> None:
        """Give a rig back and tell the page.

        Parameters
        ----------
        asked : PageDisarmRequest
            Which rig.

        Raises
        ------
        RefusedViewerError
            If it does not hold this rig.
        """
        if not await self._give_back("", asked=asked):
            message = f"this page does not hold rig {asked.rig!r}"
            raise RefusedViewerError("disarm", "not_owner", message, None)

    async def run(self) -> None:
        """Watch the lease and the page, for ever."""
        while True:
            await asyncio.sleep(LOOK_S)
            held, asked = self._held(), self._asked
            if held is None or asked is None:
                continue
            most_s = asked.lease_ms / 1_000
            if (loss := held.lease.loss) is not None:
                await self._give_back(loss.reason, loss=loss)
            elif self._silence_s() > most_s:
                # It may be frozen: it keeps no screen driven.
                await self._give_back(f"nothing was heard of the page for {most_s:g} s")

    async def close(self) -> None:
        """Give back what is held, or about to be."""
        if self._arming is not None:
            try:
                with contextlib.suppress(*FAULTS):  # then it was never armed
                    await self._end(await self._arming)
            finally:
                self._arming = None

    def _silence_s(self) -> float:
        return time.monotonic() - self._heard_s

    def _held(self) -> _ArmedRig | None:
        arming = self._arming
        if arming is None or not arming.done() or arming.exception() is not None:
            return None  # why it failed is for who waits for it
        return arming.result()

    async def _give_back(
        self,
        reason: str,
        *,
        asked: PageDisarmRequest | None = None,
        loss: LeaseLostError | None = None,
    ) -> bool:
        """Return whether the rig was held, which a request may find ended meanwhile."""
        async with self._changing:
            held, armed = self._held(), self._asked
            if held is None or armed is None or (asked and asked.rig != armed.rig):
                return False
            await self._end(held)
            self._arming = None
            self._given_back(armed.rig, reason)
            disarmed = Disarmed(
                rig=armed.rig,
                reason=reason,
                by=None if loss is None else loss.by,
                utc_ns=None if loss is None else loss.utc_ns,
                id=None if asked is None else asked.id,
            )
            await self._tell(disarmed.model_dump_json())
            return True

    async def _end(self, held: _ArmedRig) -> None:
        # Renewals end in any case, and with them the output.
        with contextlib.suppress(*FAULTS):
            await to_thread.run_sync(held.disarm, limiter=self._hub.leases)


def code_of(error: Exception) -> str:
    """Return the stable word for what a command to a rig ended with.

    Parameters
    ----------
    error : Exception
        One of `FAULTS`.
    """
    if isinstance(error, RefusedError):
        return error.code
    if isinstance(error, OutcomeUnknownError):
        return "outcome_unknown"
    if isinstance(error, ArgumentError):
        return "bad_request"
    return "no_rig" if isinstance(error, NoRigError) else "no_link"


class Pointing:
    """Publishes points in a worker thread, for publishing may block.

    Parameters
    ----------
    hub : Hub
        Knows the rigs.
    client : str
        The page, as rigs know it.
    """

    def __init__(self, hub: Hub, client: str) -> None:
        self._hub = hub
        self._client = client
        self._moved: tuple[frictus.Rig, frictus.Rig] | None = None
        self._newest: tuple[frictus.Rig, Point] | None = None
        self._pressed = False
        self._publishing: asyncio.Task[None] | None = None
        self._given = asyncio.Event()

    def point(self, rig: str | None, point: Point) -> None:
        """Take a point; one that is not yet on its way is forgotten.

        Parameters
        ----------
        rig : str or None
            Name of the rig that the viewer watches.
        point : Point
            Where to.

        Raises
        ------
        RefusedViewerError
            If that rig's finger cannot be moved now.
        """
        if rig is None:
            raise RefusedViewerError("point", "no_rig", "watch a rig to point at it", None)
        self._newest = (self._hub.movable(rig, self._client), point)
        self._given.set()

    async def run(self) -> None:
        """Publish points as they come, for ever."""
        while True:
            await self._given.wait()
            self._given.clear()
            assert self._newest is not None
            await self._publish(*self._newest)

    async def lift(self) -> None:
        """Take the finger off the screen, if this viewer left it there."""
        if self._publishing is not None:
            await self._publishing  # or it would come after
        if self._pressed and self._newest is not None:
            rig, point = self._newest
            await self._publish(rig, point.model_copy(update={"in_contact": False}))
        await self._leave()

    async def _publish(self, rig: frictus.Rig, point: Point) -> None:
        if self._moved is None or self._moved[0] is not rig:
            await self._leave()
            self._moved = rig, rig.on_behalf_of(self._client)
        self._pressed = point.in_contact
        publish = functools.partial(
            self._moved[1].point,
            point.x_mm,
            point.y_mm,
            in_contact=point.in_contact,
            normal_force_n=point.normal_force_n,
        )
        published = to_thread.run_sync(publish, limiter=self._hub.updates)
        self._publishing = asyncio.create_task(published)
        await asyncio.shield(self._publishing)

    async def _leave(self) -> None:
        moved, self._moved = self._moved, None
        if moved is not None:
            await to_thread.run_sync(moved[1].close, limiter=self._hub.updates)
