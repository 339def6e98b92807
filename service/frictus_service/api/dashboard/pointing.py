"""The points of one viewer on their way to a rig: the newest wins."""

import asyncio

from fastapi.concurrency import run_in_threadpool

import frictus
from frictus_service.api.dashboard.hub import Hub
from frictus_service.api.dashboard.messages import Point
from frictus_service.api.dashboard.refusal import RefusedViewerError


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
        published = run_in_threadpool(
            self._moved[1].point,
            point.x_mm,
            point.y_mm,
            in_contact=point.in_contact,
            normal_force_n=point.normal_force_n,
        )
        self._publishing = asyncio.create_task(published)
        await asyncio.shield(self._publishing)

    async def _leave(self) -> None:
        moved, self._moved = self._moved, None
        if moved is not None:
            await run_in_threadpool(moved[1].close)
