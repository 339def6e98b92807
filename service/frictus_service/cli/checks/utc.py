"""Whether the system clock is kept in step with UTC: recordings bear its time."""

import ctypes
import os
import re
import subprocess
import sys
from collections.abc import Callable
from typing import Final

from frictus_service.cli.checks.check import Check

TIME_ERROR: Final = 5
"""What Linux says of a clock that nothing keeps in step."""
FAR_MS: Final = 100.0
ANSWER_S: Final = 10.0
_LEAP = re.compile(r":\s*([0-3])\s*\(")
_TO_DO = (
    "have it synchronised: chrony or systemd-timesyncd on Linux, the time service on Windows"
)

Kept = tuple[bool, float | None]
"""Whether it is kept in step, and how far it may be off, ms, where that is known."""


class _Timex(ctypes.Structure):
    _fields_ = (
        ("modes", ctypes.c_uint),
        ("offset", ctypes.c_long),
        ("freq", ctypes.c_long),
        ("maxerror_us", ctypes.c_long),
        ("rest", ctypes.c_char * 256),
    )


def clock_synchronised(ask: Callable[[], Kept | None] | None = None) -> Check:
    """Look at the system clock.

    Parameters
    ----------
    ask : callable or None
        Says how the clock is kept, None for unknown. None: asks this system.
    """
    kept = (ask or _ask_system)()
    if kept is None:
        found = "it is not known whether the system clock is synchronised"
        return Check("utc", "warn", found, _TO_DO)
    in_step, off_ms = kept
    within = "" if off_ms is None else f", off by at most {off_ms:.3g} ms"
    if not in_step:
        return Check("utc", "warn", "the system clock is not synchronised", _TO_DO)
    if off_ms is not None and not off_ms <= FAR_MS:
        return Check("utc", "warn", f"the system clock is synchronised{within}", _TO_DO)
    return Check("utc", "ok", f"the system clock is synchronised{within}")


def _ask_system() -> Kept | None:
    if sys.platform.startswith("linux"):
        return _ask_linux()
    return _ask_windows() if os.name == "nt" else None


def _ask_linux() -> Kept | None:
    timex = _Timex()  # modes = 0 reads and changes nothing
    state = ctypes.CDLL(None, use_errno=True).adjtimex(ctypes.byref(timex))
    if state < 0:
        return None  # not allowed, as in some containers
    return state != TIME_ERROR, 1e-3 * timex.maxerror_us


def _ask_windows() -> Kept | None:
    try:
        done = subprocess.run(
            ["w32tm", "/query", "/status"],
            capture_output=True,
            text=True,
            timeout=ANSWER_S,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired):
        return None
    return leap_of(done.stdout) if done.returncode == 0 else (False, None)


def leap_of(status: str) -> Kept | None:
    """Return what `w32tm /query /status` says, in any language; None if it says nothing.

    Parameters
    ----------
    status : str
        Its first line is the leap indicator, 3 for a clock that is not synchronised.
    """
    found = _LEAP.search(status.strip().partition("\n")[0])
    return None if found is None else (found[1] != "3", None)
