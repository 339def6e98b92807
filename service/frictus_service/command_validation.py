"""What must hold of a command before anything is done with it: size, form, age."""

from dataclasses import dataclass
from typing import Final, TypeVar

import numpy as np

from frictus.errors import FrameError, RefusedError
from frictus.messages import GuidanceState, Message, Request
from frictus.stream import MAX_FRAME_BYTES, StreamFrame
from frictus_service.config import Limits
from frictus_service.json_text import read_sliced

Kind = TypeVar("Kind", bound=Request)
AnyMessage = TypeVar("AnyMessage", bound=Message)
SHORT_BYTES: Final = 4_096
"""What is decided in a callback is at most so long; it takes microseconds to read."""
SHORT: Final = ("arm", "disarm", "reset", "lease", "pointer", "compensation", "adaptation")
CENTURY_NS: Final = 100 * 365 * 86_400 * 10**9
MAX_NESTED: Final = 10_000
"""Objects and lists in a payload. They take long to read, and meanwhile the block loop may wait
for the interpreter's lock."""
MAX_VALUES: Final = 140_000
"""Two recordings at full length, and what stands around them. While a payload is read the block
loop waits: a million numbers, even in a field that nobody knows, take longer than the lead."""
MAX_MEMBERS: Final = 40_000
"""Members of objects, with the escapes in strings: what is slowest to read."""
MAX_DIGITS: Final = 500
"""Of one number, which is read in one go; of twice as many none is accepted."""
SLICED_BYTES: Final = 32_000
"""Payloads from this length on are read in slices; up to it the fast parser takes 0.2 ms."""
GUIDANCE_TTL_MS: Final = 500
"""Guidance comes 30 times a second; what a frozen sender left behind guides nobody."""


@dataclass(frozen=True, slots=True)
class CommandValidator:
    """Reads commands; refuses with `frictus.errors.RefusedError`.

    Parameters
    ----------
    limits : Limits
        Of what a rig accepts.
    """

    limits: Limits

    def most_bytes(self, name: str) -> int:
        """Return how long the payload of a call or message may be.

        Parameters
        ----------
        name : str
            A key of `frictus.keys.CALLS`, or `lease`, `texture`, `pointer`, `guidance`.
        """
        if name == "scene":
            return self.limits.max_scene_bytes
        if name == "texture":
            return MAX_FRAME_BYTES
        most = self.limits.max_payload_bytes
        return min(SHORT_BYTES, most) if name in SHORT else most

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
            request = _read(kind, payload)
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
            guidance = _read(GuidanceState, payload)
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


def _read(kind: type[AnyMessage], payload: bytes) -> AnyMessage:
    return kind.from_json(payload, None if len(payload) < SLICED_BYTES else read_sliced)


def _check_counts(payload: bytes) -> None:
    if len(payload) < MAX_DIGITS:  # too short to hold too much of anything
        return
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
    members = np.count_nonzero(octets == ord(":")) + np.count_nonzero(octets == ord("\\"))
    if members > MAX_MEMBERS:
        raise RefusedError(
            "too_large", f"{members} members and escapes; at most {MAX_MEMBERS} are accepted"
        )
    digits = (octets >= ord("0")) & (octets <= ord("9"))
    rows = digits[: octets.size // MAX_DIGITS * MAX_DIGITS].reshape(-1, MAX_DIGITS)
    if rows.all(axis=1).any():  # every run of twice as many fills a row
        raise RefusedError(
            "too_large",
            f"a number of {MAX_DIGITS} digits or more; fewer are accepted: round it",
        )


def check_match(wanted: str | None, present: str, what: str) -> None:
    """Refuse a change of something else than its sender saw.

    Parameters
    ----------
    wanted, present : str or None
        Etags: of what the sender saw, None where it does not mind; and of what is in force.
    what : str
        Its name, for people.

    Raises
    ------
    RefusedError
        `conflict`.
    """
    if wanted is not None and wanted != present:
        raise RefusedError(
            "conflict", f"the {what} is {present!r} now, not {wanted!r}: read it again"
        )
