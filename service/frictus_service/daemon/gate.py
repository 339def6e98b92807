"""What must hold of a command before anything is done with it: size, form, age."""

from dataclasses import dataclass
from typing import Final, TypeVar

import numpy as np

from frictus.errors import FrameError, RefusedError
from frictus.messages import GuidanceState, Request
from frictus.stream import StreamFrame
from frictus_service.config import Limits

Kind = TypeVar("Kind", bound=Request)
CENTURY_NS: Final = 100 * 365 * 86_400 * 10**9
MAX_NESTED: Final = 10_000
"""Objects and lists in a payload. They take long to read, and meanwhile the block loop may wait
for the interpreter's lock."""
MAX_VALUES: Final = 140_000
"""Two recordings at full length, and what stands around them. While a payload is read the block
loop waits: a million numbers, even in a field that nobody knows, take longer than the lead."""
GUIDANCE_TTL_MS: Final = 500
"""Guidance comes 30 times a second; what a frozen sender left behind guides nobody."""


@dataclass(frozen=True, slots=True)
class Gate:
    """Reads commands; refuses with `frictus.errors.RefusedError`.

    Parameters
    ----------
    limits : Limits
    """

    limits: Limits

    def read(self, kind: type[Kind], payload: bytes, utc_ns: int, most_bytes: int) -> Kind:
        """Return the request that `payload` holds.

        Parameters
        ----------
        kind : type
            Which request.
        payload : bytes
            JSON.
        utc_ns : int
            Now.
        most_bytes : int
            Larger payloads are not looked into.

        Raises
        ------
        RefusedError
            `too_large`, `bad_request` (the text names the field) or `stale`.
        """
        self.check_size(len(payload), most_bytes)
        _check_counts(payload)
        try:
            request = kind.from_json(payload)
        except FrameError as error:
            raise RefusedError("bad_request", str(error)) from error
        self.time_left_s(request.utc_ns, request.ttl_ms, utc_ns)
        return request

    def read_frame(self, payload: bytes, utc_ns: int) -> tuple[StreamFrame, float]:
        """Return the stream frame that `payload` holds, and for how long it is good, s.

        Raises
        ------
        RefusedError
            As `read`.
        """
        self.check_size(len(payload), self.limits.max_payload_bytes)
        try:
            frame = StreamFrame.unpack(payload)
        except FrameError as error:
            raise RefusedError("bad_request", str(error)) from error
        return frame, self.time_left_s(frame.utc_ns, frame.ttl_ms, utc_ns)

    def read_guidance(self, payload: bytes, utc_ns: int) -> GuidanceState:
        """Return the guidance that `payload` holds.

        Raises
        ------
        RefusedError
            As `read`.
        """
        self.check_size(len(payload), self.limits.max_payload_bytes)
        _check_counts(payload)
        try:
            guidance = GuidanceState.from_json(payload)
        except FrameError as error:
            raise RefusedError("bad_request", str(error)) from error
        self.time_left_s(guidance.utc_ns, GUIDANCE_TTL_MS, utc_ns)
        return guidance

    def time_left_s(self, sent_ns: int, ttl_ms: int, utc_ns: int) -> float:
        """Return how long a command is still good for, s; more than 0.

        Raises
        ------
        RefusedError
            `stale`, where it is too old, or made in the future.
        """
        # Beyond a century either way all ages are alike; an integer may be of any size.
        age_ms = 1e-6 * max(-CENTURY_NS, min(utc_ns - sent_ns, CENTURY_NS))
        if -age_ms > self.limits.max_clock_ahead_ms:
            raise RefusedError(
                "stale",
                f"made {-1e-3 * age_ms:.3f} s in the future, at most "
                f"{1e-3 * self.limits.max_clock_ahead_ms:g} s is accepted: "
                "set the clocks of both machines by NTP",
            )
        allowed_ms = min(ttl_ms, self.limits.max_command_age_ms)
        left_ms = allowed_ms - max(age_ms, 0.0)
        if left_ms <= 0.0:
            raise RefusedError(
                "stale",
                f"{1e-3 * age_ms:.3f} s old, good for {1e-3 * allowed_ms:g} s: "
                "send it again; if it keeps happening, set the clocks by NTP",
            )
        return 1e-3 * left_ms

    def check_size(self, size_bytes: int, most_bytes: int) -> None:
        """Refuse a payload for its length, before it is looked into.

        Raises
        ------
        RefusedError
            `too_large`.
        """
        if size_bytes > most_bytes:
            raise RefusedError(
                "too_large", f"{size_bytes} bytes; at most {most_bytes} are accepted"
            )


def _check_counts(payload: bytes) -> None:
    octets = np.frombuffer(payload, np.uint8)  # counted without the interpreter's lock
    nested = np.count_nonzero(octets == ord("[")) + np.count_nonzero(octets == ord("{"))
    if nested > MAX_NESTED:
        raise RefusedError(
            "too_large", f"{nested} objects and lists; at most {MAX_NESTED} are accepted"
        )
    values = np.count_nonzero(octets == ord(",")) + 1
    if values > MAX_VALUES:
        raise RefusedError(
            "too_large", f"{values} values; at most {MAX_VALUES} are accepted: resample"
        )
