"""The texture stream frame: one whole period of friction, replacing what was felt before.

Each frame stands alone, so that the newest may overtake older ones; the rig cross-fades from
one to the next. 64 bytes of header, then float32 friction in newtons, all little-endian.
"""

import math
import struct
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from frictus.errors import FrameError
from frictus.textures import PERIOD_MM, PERIOD_S

MAGIC: Final = b"FRTX"
VERSION: Final = 1
HEADER: Final = struct.Struct("<4sHHIIQqIIddQ")
HEADER_BYTES: Final = HEADER.size
MAX_SAMPLES: Final = 4096
MAX_TTL_MS: Final = 60_000
SPATIAL, TEMPORAL = 0, 1


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
    if not 0 < ttl_ms <= MAX_TTL_MS:
        raise FrameError(f"ttl_ms {ttl_ms}: 1 to {MAX_TTL_MS} accepted")
    (shortest, longest), unit = (PERIOD_MM, "mm") if spatial else (PERIOD_S, "s")
    if not shortest <= period <= longest:
        raise FrameError(f"period {period} {unit}: {shortest:g} to {longest:g} accepted")
    if not (math.isfinite(angle_deg) and abs(angle_deg) <= 360.0):
        raise FrameError(f"angle {angle_deg} deg: -360 to 360 accepted")
