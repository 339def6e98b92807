"""What every rig accepts: its configuration, a drive, and the length of a ramp."""

import math
from typing import Annotated, Final

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from frictus_hardware.arrays import FloatArray
from frictus_hardware.errors import ConfigError, NotArmedError, UnsafeDriveError

Positive = Annotated[float, Field(gt=0.0)]
NonNegative = Annotated[float, Field(ge=0.0)]
LONGEST_MM: Final = 10_000.0
"""Side of a screen; messages hold no place further off."""
SideMm = Annotated[float, Field(gt=0.0, le=LONGEST_MM)]


class StrictModel(BaseModel):
    """Refuses unknown fields, wrong types, NaN and infinities."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


LEAST_N: Final = 0.05
"""A finger on the screen presses at least this hard."""
MAX_BLOCK_S: Final = 1.0
"""The longest drive, and the longest ramp: what is queued longer cannot be stopped in time."""


def require_drive(
    drive_v: FloatArray, max_samples: int, *, armed: bool, besides: str = ""
) -> float:
    """Refuse a drive that must not be played; return its largest magnitude, V.

    Parameters
    ----------
    drive_v : ndarray
        Volts at the screen.
    max_samples : int
        Longest block that is accepted.
    armed : bool
        Whether anything but zero may be played.
    besides : str
        What else the rig asks of its length.

    Raises
    ------
    ConfigError
        Unless it has one axis of 1 to `max_samples` samples.
    UnsafeDriveError
        Unless every sample is finite.
    NotArmedError
        If it is not zero while disarmed.
    """
    if drive_v.ndim != 1 or not 1 <= drive_v.size <= max_samples:
        raise ConfigError(
            f"a drive of shape {drive_v.shape}: one axis of 1 to {max_samples} samples "
            f"accepted{besides}; nothing was output"
        )
    largest_v = float(np.abs(drive_v).max())
    if not largest_v < math.inf:
        raise UnsafeDriveError("a drive sample is not finite; nothing was output")
    if not armed and largest_v > 0.0:
        raise NotArmedError("drive other than zero while disarmed; nothing was output")
    return largest_v


DEFAULT_MAX_LEAD_MS: Final = 20.0
"""To which a shorter lead may grow where nothing else is configured."""


def require_max_lead(lead_ms: float, max_lead_ms: float | None) -> None:
    """Refuse a longest lead that is shorter than the lead.

    Parameters
    ----------
    lead_ms : float
        The lead to begin with.
    max_lead_ms : float or None
        To which it may grow; None: see `longest_lead_ms`.

    Raises
    ------
    ConfigError
        If it is shorter.
    """
    if max_lead_ms is not None and not max_lead_ms >= lead_ms:
        raise ConfigError(
            f"max_lead_ms = {max_lead_ms:g} is less than lead_ms = {lead_ms:g}: at least that "
            "accepted; the same, and the lead never grows"
        )


def longest_lead_ms(lead_ms: float, max_lead_ms: float | None) -> float:
    """Return to what a lead may grow: what is configured, else `DEFAULT_MAX_LEAD_MS`.

    Parameters
    ----------
    lead_ms : float
        The lead to begin with, which is never shortened.
    max_lead_ms : float or None
        As configured.
    """
    return max(lead_ms, DEFAULT_MAX_LEAD_MS if max_lead_ms is None else max_lead_ms)


def require_longer_lead(
    lead_samples: int, present_samples: int, max_samples: int, *, armed: bool
) -> int:
    """Refuse a lead that a rig cannot go over to; return by how much it is longer, samples.

    Parameters
    ----------
    lead_samples : int
        What is asked for.
    present_samples, max_samples : int
        The lead in force, and the longest.
    armed : bool
        Whether there may be output.

    Raises
    ------
    ConfigError
        If it is out of this range, or the output is armed.
    """
    if armed:
        raise ConfigError("the output is armed: stop it, then lengthen the lead")
    if not present_samples <= lead_samples <= max_samples:
        raise ConfigError(
            f"a lead of {lead_samples} samples: {present_samples}, as now, to {max_samples} "
            "accepted; raise max_lead_ms in the configuration for more"
        )
    return lead_samples - present_samples


def ramp_samples(ramp_s: float, sample_rate_hz: float) -> int:
    """Return the samples of a ramp to zero, `MAX_BLOCK_S` at most.

    Raises
    ------
    ConfigError
        If it is negative or not a number.
    """
    if not ramp_s >= 0.0:
        raise ConfigError(f"a ramp of {ramp_s} s: 0 or more accepted")
    return round(min(ramp_s, MAX_BLOCK_S) * sample_rate_hz)
