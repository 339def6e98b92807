"""A texture streamed from a client: each update is one whole period and replaces the last."""

import time
from types import TracebackType
from typing import Self

import numpy as np
import zenoh
from numpy.typing import ArrayLike

from frictus.calls import Caller
from frictus.errors import ArgumentError, FrameError, LinkError, RefusedError
from frictus.keys import Topics
from frictus.lease import stream_end
from frictus.messages import Applied, RigStatus
from frictus.reception import Latest
from frictus.session import declare_publisher
from frictus.stream import StreamFrame


class TextureStream:
    """An open texture stream; a context manager that closes it. Made by `Rig.open_stream`.

    Parameters
    ----------
    caller : Caller
        Calls the rig.
    status : Latest of RigStatus
        The rig's status as it comes in.
    peak_n : float
        Largest |friction| that will be sent, above 0 and up to 10 N. It fixes bias and gain
        until the stream ends; a frame that exceeds it is refused.

    Attributes
    ----------
    applied : Applied or None
        What the rig made of the peak: gain and bias.
    sent : int
        Updates sent so far.
    """

    def __init__(self, caller: Caller, status: Latest[RigStatus], peak_n: float) -> None:
        reply = caller.call("open_stream", peak_n=peak_n)
        if reply.ticket is None:
            raise LinkError("the rig opened a stream without a ticket: protocol fault")
        self.applied: Applied | None = reply.applied
        self.sent = 0
        self._caller = caller
        self._status = status
        self._opened = reply
        self._ticket = reply.ticket
        self._peak_n = peak_n
        self._failure: Exception | None = None
        self._publisher: zenoh.Publisher | None = declare_publisher(
            caller.session, caller.keys.of(Topics.TEXTURE), Topics.TEXTURE
        )

    @property
    def closed(self) -> bool:
        """Whether the stream was closed from this side."""
        return self._publisher is None

    def fail(self, error: Exception) -> None:
        """Have every `send` raise an error from now on: nothing plays what would be sent.

        Parameters
        ----------
        error : Exception
            What `send` raises.
        """
        self._failure = error

    def send(
        self,
        friction_n: ArrayLike,
        *,
        period_mm: float | None = None,
        period_s: float | None = None,
        angle_deg: float = 0.0,
        ttl_ms: int = 200,
    ) -> None:
        """Send one period of friction; the rig cross-fades to it.

        There is no reply. An update that is too old when it arrives is dropped and counted in
        `RigStatus.counters.stream_updates_expired`.

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
        LinkError
            If the stream is closed or the session is gone.
        """
        if self._publisher is None:
            raise LinkError("this stream is closed; open another")
        self._failure = self._failure or stream_end(self._status.newest(), self._opened)
        if self._failure is not None:
            raise self._failure
        if (period_mm is None) == (period_s is None):
            raise ArgumentError("give either period_mm or period_s, not both and not neither")
        friction = np.asarray(friction_n, dtype=np.float32)
        if friction.size and not np.max(np.abs(friction)) <= self._peak_n * (1.0 + 1e-6):
            raise ArgumentError(
                f"friction must be finite and within the declared peak of {self._peak_n:g} N; "
                f"this update reaches {np.max(np.abs(friction)):g} N"
            )
        spatial = period_mm is not None
        period = period_mm if period_mm is not None else period_s
        assert period is not None
        frame = StreamFrame(
            self._ticket,
            self.sent,
            time.time_ns(),
            ttl_ms,
            period,
            spatial,
            angle_deg,
            friction,
        )
        try:
            self._publisher.put(frame.pack())
        except FrameError as error:
            raise ArgumentError(str(error)) from error
        except zenoh.ZError as error:
            raise LinkError(f"the update was not sent: {error}") from error
        self.sent += 1

    def close(self) -> None:
        """End the stream; the rig fades to the scene. Closing twice is harmless.

        Raises
        ------
        RefusedError, NoRigError, LinkError
            As for every call; a stream that the rig ended first is no error.
        """
        publisher, self._publisher = self._publisher, None
        if publisher is None:
            return
        publisher.undeclare()  # type: ignore[no-untyped-call]
        try:
            self._caller.call("close_stream")
        except RefusedError as error:
            if error.code not in ("not_owner", "not_armed", "tripped"):
                raise

    def __enter__(self) -> Self:
        """Return self."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Close; an error that is already on its way is not replaced by one of closing."""
        try:
            self.close()
        except (RefusedError, LookupError, ConnectionError):
            if error is None:
                raise
