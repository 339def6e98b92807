"""What all JSON messages share: the words and ranges of the wire, and how one is read."""

from collections.abc import Callable
from typing import Annotated, Final, Literal, Self

from pydantic import ConfigDict, Field, FiniteFloat, ValidationError

from frictus.errors import FrameError, explain
from frictus.lenient import Lenient

RefusalCode = Literal[
    "bad_request",  # the payload cannot be read; the text says where
    "too_large",  # larger than the rig reads
    "stale",  # older than its time to live, or from the future: check the clocks
    "not_owner",  # another client holds the rig
    "not_armed",
    "tripped",  # latched until an operator resets it
    "conflict",  # what was to be replaced is not what the caller saw
    "not_feasible",  # cannot be rendered; the text says why
    "unavailable",  # the rig is not ready
]
SafetyState = Literal["disarmed", "armed", "stopping", "tripped"]
AdaptationPolicy = Literal["observe", "suggest", "adapt"]
"""What a rig's tracker may do with what it learns: tell it; say which model it would put in
force; have the rig follow the finger's gain and cutoff while it plays."""
FaultKind = Literal[
    "config",
    "transient",
    "stream_lost",
    "device_lost",
    "link_lost",
    "sensor",
    "safety",
    "deadline",
    "internal",
]


UtcNs = Annotated[int, Field(ge=0, lt=2**63)]
"""UTC since 1970, ns: 64 bits reach to the year 2262."""
MAX_REASON: Final = 500
"""Characters of why something was done."""
MAX_MARKER: Final = 1_000
"""Characters of a marker."""
MAX_COUNT: Final = 2**63 - 1
Count = Annotated[int, Field(ge=0, lt=MAX_COUNT + 1)]
Int64 = Annotated[int, Field(ge=-(2**63), lt=2**63)]
VelocityMmS = Annotated[FiniteFloat, Field(ge=-1e6, le=1e6)]
ForceN = Annotated[FiniteFloat, Field(ge=-10_000.0, le=10_000.0)]
DurationMs = Annotated[FiniteFloat, Field(ge=-1e12, le=1e12)]
"""Below 0: before its time. 1e12 is 31 years."""
LengthS = Annotated[FiniteFloat, Field(ge=0.0, le=1e9)]
FrequencyHz = Annotated[FiniteFloat, Field(ge=0.0, le=1e9)]
Decibel = Annotated[FiniteFloat, Field(ge=-1e6, le=1e6)]


class Message(Lenient):
    """What all messages share."""

    model_config = ConfigDict(ser_json_inf_nan="null")

    def to_json(self) -> bytes:
        """Return the message as JSON bytes."""
        return self.model_dump_json(by_alias=True).encode()

    @classmethod
    def from_json(cls, payload: bytes, parse: Callable[[bytes], object] | None = None) -> Self:
        """Read a message. Nothing is converted: true is no number, and "1" neither.

        Parameters
        ----------
        payload : bytes
            JSON text in UTF-8.
        parse : callable or None
            Parser of long payloads, which raises ValueError for what is not JSON; None:
            pydantic's own.

        Raises
        ------
        FrameError
            If it is not JSON, or a field is missing, of another type or out of range.
        """
        try:
            if parse is None:
                return cls.model_validate_json(payload, strict=True)
            return cls.model_validate(parse(payload), strict=True)
        except ValidationError as error:
            raise FrameError(f"not a {cls.__name__}: {explain(error)}") from error
        except ValueError as error:
            raise FrameError(f"not a {cls.__name__}: not JSON: {error}") from error
