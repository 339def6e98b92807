"""What a client holds of a rig: the lease, and the texture stream."""

import asyncio
import contextlib
from collections.abc import AsyncIterator, Awaitable, Callable
from typing import Protocol

from numpy.typing import ArrayLike

from frictus.errors import (
    FrictusError,
    LeaseLostError,
    LinkError,
    RefusedError,
)
from frictus.messages import Applied
from frictus.stream import update_frame
from frictus.websocket.connection import Connection
from frictus.websocket.messages import StreamOpened, StreamUpdates


class AsyncLease:
    """The right to drive one rig's screen. Made by `AsyncRig.arm`.

    The service renews it as long as it hears of this client, which pings twice a second: code
    that blocks the event loop for longer than `lease_ms` loses the rig.
    """

    def __init__(self) -> None:
        self._loss: LeaseLostError | None = None
        self._lost = asyncio.Event()

    @property
    def lost(self) -> bool:
        """Whether it has ended before it was given back; `reason` says why."""
        return self._loss is not None

    @property
    def reason(self) -> str:
        """Why the lease is lost, by whom and when; empty while it is held."""
        return "" if self._loss is None else self._loss.reason

    @property
    def loss(self) -> LeaseLostError | None:
        """What `fingers()` and `AsyncTextureStream.send` raise once it is lost; None before."""
        return self._loss

    async def wait_lost(self) -> LeaseLostError:
        """Wait until the lease is lost; return how."""
        await self._lost.wait()
        assert self._loss is not None
        return self._loss

    def lose(self, loss: LeaseLostError) -> None:
        """Take note that it is lost.

        Parameters
        ----------
        loss : LeaseLostError
            How.
        """
        self._loss = self._loss or loss
        self._lost.set()


class _Refusals(Protocol):
    """Takes the refusal of what has no answer, such as an update."""

    def pop(self, what: str, default: None) -> RefusedError | None:
        """Return it once."""


class AsyncTextureStream:
    """An open texture stream. Made by `AsyncRig.open_stream`.

    Parameters
    ----------
    connection : Connection
        Over which it was opened.
    opened : StreamOpened
        The answer.
    peak_n : float
        Largest |friction| that was declared, N.
    refusals : dict
        Of updates, by ``update``; they come later than the update.

    Attributes
    ----------
    applied : Applied
        What the rig made of the peak: gain and bias.
    sent : int
        Updates sent so far.
    updates : StreamUpdates
        What became of them, as far as the service has said: how many were passed on to the
        rig, left out for a newer one, left out for their age.
    """

    def __init__(
        self, connection: Connection, opened: StreamOpened, peak_n: float, refusals: _Refusals
    ) -> None:
        self.applied: Applied = opened.applied
        self.sent = 0
        self.updates = StreamUpdates(sent=0, superseded=0, expired=0, newest=None)
        self._connection = connection
        self._ticket = opened.ticket
        self._peak_n = peak_n
        self._refusals = refusals
        self._failure: Exception | None = None

    def fail(self, error: Exception) -> None:
        """Have every `send` raise an error from now on: nothing plays what would be sent.

        Parameters
        ----------
        error : Exception
            What `send` raises.
        """
        self._failure = self._failure or error

    async def send(
        self,
        friction_n: ArrayLike,
        *,
        period_mm: float | None = None,
        period_s: float | None = None,
        angle_deg: float = 0.0,
        ttl_ms: int = 200,
    ) -> None:
        """Send one period of friction; the rig cross-fades to it.

        There is no reply; `updates` counts. What is out of range is refused here, for the
        service would end the connection, and with it the lease. It waits while the network
        takes nothing, but the age of an update counts from the call on.

        Parameters
        ----------
        friction_n : array_like, shape (n_samples,)
            Friction over one period, N; 2 to 4096 samples within the declared peak.
        period_mm, period_s : float
            Length of the period; give one: up to 1000 mm, or up to 10 s.
        angle_deg : float
            Direction of a spatial texture's phase, from x towards y; -360 to 360.
        ttl_ms : int
            For how long the rig may still take it, in ms from now.

        Raises
        ------
        ArgumentError
            If a value is out of range, not finite, or above the declared peak.
        LeaseLostError
            If the lease under which it was opened has ended, or another scene or stream has
            taken its place.
        RefusedError
            If an update before was refused.
        LinkError
            If the stream is closed or the connection is lost.
        """
        if self._failure is not None:
            raise self._failure
        refused = self._refusals.pop("update", None)
        if refused is not None:
            raise refused
        frame = update_frame(
            self._ticket,
            self.sent,
            self._connection.utc_ns,
            self._peak_n,
            friction_n,
            period_mm=period_mm,
            period_s=period_s,
            angle_deg=angle_deg,
            ttl_ms=ttl_ms,
        )
        self.sent += 1
        await self._connection.send(frame)

    def closed(self) -> None:
        """Have every `send` raise `LinkError`: it was closed from this side."""
        self.fail(LinkError("this stream is closed; open another"))


@contextlib.asynccontextmanager
async def ending(end: Callable[[], Awaitable[None]]) -> AsyncIterator[None]:
    """End something; an error that is already on its way is not replaced by one of ending.

    Parameters
    ----------
    end : callable
        Ends it.
    """
    try:
        yield
    except BaseException:
        with contextlib.suppress(FrictusError):
            await end()
        raise
    await end()
