"""The texture stream: one whole period of friction a frame, replacing what was felt.

Each frame stands alone, so that the newest may overtake older ones; the rig cross-fades from
one to the next. 64 bytes of header, then float32 friction in newtons, all little-endian.
"""

import struct
import threading
import time
from dataclasses import dataclass
from numbers import Integral, Real
from types import TracebackType
from typing import Final, Self

import numpy as np
import zenoh
from numpy.typing import ArrayLike, NDArray

from frictus.calls import Caller
from frictus.errors import ArgumentError, FrameError, LinkError, NoRigError, RefusedError
from frictus.keys import Topics
from frictus.lease import stream_end
from frictus.messages import Applied, RigStatus
from frictus.reception import Latest
from frictus.session import declare_publisher
from frictus.textures import PERIOD_MM, PERIOD_S

MAGIC: Final = b"FRTX"
VERSION: Final = 1
HEADER: Final = struct.Struct("<4sHHIIQqIIddQ")
HEADER_BYTES: Final = HEADER.size
MAX_SAMPLES: Final = 4096
MAX_FRAME_BYTES: Final = HEADER_BYTES + 4 * MAX_SAMPLES
MAX_TTL_MS: Final = 60_000
SPATIAL, TEMPORAL = 0, 1
ENDED: Final = ("not_owner", "not_armed", "tripped")
"""Refusals which say that a stream has ended; the rig's status may come later."""


@dataclass(frozen=True, slots=True)
class StreamFrame:
    """One update of a streamed texture.

    Attributes
    ----------
    ticket : int
        Given by the rig when the stream was opened.
    sequence : int
        Counts the updates of this stream from 0.
    utc_ns, ttl_ms : int
        When it was made, and for how long it may still be taken; older ones are refused.
    period : float
        Length of the period, in mm where `spatial`, else in s.
    spatial : bool
        Over position (True) or over time.
    angle_deg : float
        Direction of a spatial texture's phase, from x towards y.
    friction_n : ndarray of float32, shape (n_samples,)
        Friction over one period, 2 to 4096 samples.
    """

    ticket: int
    sequence: int
    utc_ns: int
    ttl_ms: int
    period: float
    spatial: bool
    angle_deg: float
    friction_n: NDArray[np.float32]

    def pack(self) -> bytes:
        """Return the frame.

        Raises
        ------
        FrameError
            If a value is out of range or not finite.
        """
        friction = np.ascontiguousarray(self.friction_n, dtype="<f4")
        _check(friction, self.period, self.angle_deg, self.spatial, self.ttl_ms)
        try:
            header = HEADER.pack(
                MAGIC,
                VERSION,
                SPATIAL if self.spatial else TEMPORAL,
                self.ticket,
                friction.size,
                self.sequence,
                self.utc_ns,
                self.ttl_ms,
                0,
                self.period,
                self.angle_deg,
                0,
            )
        except struct.error as error:
            raise FrameError(f"a header field does not fit: {error}") from error
        return header + friction.tobytes()

    @classmethod
    def unpack(cls, frame: bytes) -> "StreamFrame":
        """Read a frame.

        Parameters
        ----------
        frame : bytes
            Header and data, nothing more.

        Raises
        ------
        FrameError
            If the frame is torn, of another version, not a stream frame, or holds a value
            that is out of range or not finite.
        """
        if len(frame) < HEADER_BYTES:
            raise FrameError(f"{len(frame)} bytes: the header alone takes {HEADER_BYTES}")
        (
            magic,
            version,
            domain,
            ticket,
            samples,
            sequence,
            utc_ns,
            ttl_ms,
            _,
            period,
            angle_deg,
            _,
        ) = HEADER.unpack_from(frame)
        if magic != MAGIC:
            raise FrameError(f"magic {magic!r}: stream frames begin with {MAGIC!r}")
        if version != VERSION:
            raise FrameError(f"version {version}: this reader knows {VERSION}; update it")
        if domain not in (SPATIAL, TEMPORAL):
            raise FrameError(f"domain {domain}: 0 (spatial) and 1 (temporal) accepted")
        if len(frame) != HEADER_BYTES + 4 * samples:
            raise FrameError(
                f"{len(frame)} bytes: {samples} samples take {HEADER_BYTES + 4 * samples}"
            )
        friction = np.frombuffer(frame, dtype="<f4", offset=HEADER_BYTES)
        _check(friction, period, angle_deg, domain == SPATIAL, ttl_ms)
        return cls(
            ticket, sequence, utc_ns, ttl_ms, period, domain == SPATIAL, angle_deg, friction
        )


def ticket_of(frame: bytes) -> int:
    """Return the ticket of a frame without reading the rest of it.

    Parameters
    ----------
    frame : bytes
        Header and data.

    Raises
    ------
    FrameError
        If it is longer or shorter than any frame.
    """
    longest = HEADER_BYTES + 4 * MAX_SAMPLES
    if not HEADER_BYTES <= len(frame) <= longest:
        raise FrameError(f"{len(frame)} bytes: {HEADER_BYTES} to {longest} are a frame")
    return int(HEADER.unpack_from(frame)[3])


def update_frame(
    ticket: int,
    sequence: int,
    utc_ns: int,
    peak_n: float,
    friction_n: ArrayLike,
    *,
    period_mm: float | None,
    period_s: float | None,
    angle_deg: float,
    ttl_ms: int,
) -> bytes:
    """Return the bytes of an update, once all of it is known to be accepted.

    Parameters
    ----------
    ticket, sequence : int
        Of the stream; of the update, from 0.
    utc_ns : int
        When it is made.
    peak_n : float
        Largest |friction| that was declared for the stream, N.
    friction_n : array_like, shape (n_samples,)
        Friction over one period, N; 2 to 4096 samples within `peak_n`.
    period_mm, period_s : float or None
        Length of the period; one of the two.
    angle_deg : float
        Direction of a spatial texture's phase, -360 to 360.
    ttl_ms : int
        For how long it may still be taken.

    Raises
    ------
    ArgumentError
        If a value is out of range, not finite, above the declared peak, or no number.
    """
    if (period_mm is None) == (period_s is None):
        raise ArgumentError("give either period_mm or period_s, not both and not neither")
    try:
        friction = np.asarray(friction_n, dtype=np.float32)
    except (TypeError, ValueError) as error:
        raise ArgumentError(f"friction must be numbers: {error}") from error
    if friction.size and not np.max(np.abs(friction)) <= peak_n * (1.0 + 1e-6):
        raise ArgumentError(
            f"friction must be finite and within the declared peak of {peak_n:g} N; "
            f"this update reaches {np.max(np.abs(friction)):g} N"
        )
    spatial = period_mm is not None
    period = period_mm if period_mm is not None else period_s
    assert period is not None
    try:
        return StreamFrame(
            ticket, sequence, utc_ns, ttl_ms, period, spatial, angle_deg, friction
        ).pack()
    except FrameError as error:
        raise ArgumentError(str(error)) from error


def _check(
    friction_n: NDArray[np.float32],
    period: float,
    angle_deg: float,
    spatial: bool,
    ttl_ms: int,
) -> None:
    if friction_n.ndim != 1 or not 2 <= friction_n.size <= MAX_SAMPLES:
        raise FrameError(f"friction of shape {friction_n.shape}: 2 to {MAX_SAMPLES} samples")
    if not np.all(np.abs(friction_n) <= 10.0):  # NaN compares false, so it is refused too
        raise FrameError("friction must be finite and within -10 to 10 N")
    if not (isinstance(ttl_ms, Integral) and 0 < ttl_ms <= MAX_TTL_MS):
        raise FrameError(f"ttl_ms {ttl_ms!r}: 1 to {MAX_TTL_MS} accepted, whole")
    (shortest, longest), unit = (PERIOD_MM, "mm") if spatial else (PERIOD_S, "s")
    if not (isinstance(period, Real) and shortest <= period <= longest):
        raise FrameError(f"period {period!r} {unit}: {shortest:g} to {longest:g} accepted")
    if not (isinstance(angle_deg, Real) and abs(angle_deg) <= 360.0):  # no NaN either
        raise FrameError(f"angle {angle_deg!r} deg: -360 to 360 accepted")


class TextureStream:
    """An open texture stream; a context manager that closes it. Made by `Rig.open_stream`.

    Parameters
    ----------
    caller : Caller
        Calls the rig.
    status : Latest of RigStatus
        The rig's status as it comes in.
    peak_n : float
        Largest |friction| that will be sent, above 0 and up to 10 N, also less its mean, which
        the rig takes off. It fixes bias and gain until the stream ends; a frame that exceeds it
        is refused.

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
        self._sending = threading.Lock()
        self._publisher: zenoh.Publisher | None = declare_publisher(
            caller.session, caller.keys.of(Topics.TEXTURE), Topics.TEXTURE
        )

    @property
    def closed(self) -> bool:
        """Whether the stream was closed from this side."""
        return self._publisher is None

    @property
    def ended(self) -> Exception | None:
        """What `send` raises as nothing plays what would be sent; None while it is played."""
        self._failure = self._failure or stream_end(self._status.newest(), self._opened)
        return self._failure

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
        """Send one period of friction; the rig cross-fades to it. From any thread.

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
        publisher = self._publisher  # another thread may close the stream meanwhile
        if publisher is None:
            raise LinkError("this stream is closed; open another")
        if (ended := self.ended) is not None:
            raise ended
        with self._sending:  # two updates of one number would be one to the rig
            frame = update_frame(
                self._ticket,
                self.sent,
                time.time_ns(),
                self._peak_n,
                friction_n,
                period_mm=period_mm,
                period_s=period_s,
                angle_deg=angle_deg,
                ttl_ms=ttl_ms,
            )
            try:
                publisher.put(frame)
            except zenoh.ZError as error:
                raise LinkError(f"the update was not sent: {error}") from error
            self.sent += 1

    def close(self) -> None:
        """End the stream; the rig fades to the scene. Closing twice is harmless.

        Raises
        ------
        RefusedError, NoRigError, LinkError
            As for every call; a stream that has ended before is no error.
        """
        publisher, self._publisher = self._publisher, None
        if publisher is None:
            return
        publisher.undeclare()  # type: ignore[no-untyped-call]
        try:
            self._caller.call("close_stream", ticket=self._ticket)
        except (RefusedError, NoRigError, LinkError) as error:
            over = isinstance(error, RefusedError) and error.code in ENDED
            if not over and self.ended is None:
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
