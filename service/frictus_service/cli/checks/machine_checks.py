"""Whether this machine keeps time and has room: pace of a block loop, disk, system clock."""

import ctypes
import os
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

Verdict = Literal["ok", "warn", "fail"]


@dataclass(frozen=True, slots=True)
class DoctorCheck:
    """What one check found.

    Attributes
    ----------
    name : str
        What was looked at.
    verdict : {'ok', 'warn', 'fail'}
    found : str
        What was found.
    to_do : str
        What an operator should do; empty if nothing.
    """

    name: str
    verdict: Verdict
    found: str
    to_do: str = ""


CLOCK_NS: Final = 100_000
"""A clock that steps in more than this cannot time 5 ms blocks well."""
LATE_MS: Final = (2.0, 20.0)
"""Lateness of a 5 ms timer at which to warn, and at which the loop must fail."""


def clock_resolution(clock_ns: Callable[[], int] = time.monotonic_ns) -> DoctorCheck:
    """Measure the smallest step of the monotonic clock."""
    steps = []
    last = clock_ns()
    for _ in range(200_000):
        now = clock_ns()
        if now != last:
            steps.append(now - last)
            last = now
    step_ns = min(steps, default=CLOCK_NS + 1)
    found = f"the monotonic clock steps by {step_ns / 1e3:.3g} us"
    if step_ns > CLOCK_NS:
        return DoctorCheck(
            "clock", "warn", found, "loop deadlines will be coarse on this machine"
        )
    return DoctorCheck("clock", "ok", found)


def timer_lateness() -> DoctorCheck:
    """Measure how late a 5 ms timer wakes on this machine, as it is loaded now."""
    rounds, period_s = 200, 0.005
    late_ms = []
    due_s = time.monotonic()
    for _ in range(rounds):
        due_s = max(due_s + period_s, time.monotonic())
        time.sleep(max(0.0, due_s - time.monotonic()))
        late_ms.append(1e3 * (time.monotonic() - due_s))
    late_ms.sort()
    p99_ms, max_ms = late_ms[int(0.99 * (rounds - 1))], late_ms[-1]
    found = f"a 5 ms timer wakes {p99_ms:.2f} ms late at p99, {max_ms:.2f} ms at most"
    if not p99_ms <= LATE_MS[1]:
        to_do = "later than the queued output lasts: close other programs, use a faster machine"
        return DoctorCheck("timer", "fail", found, to_do)
    if not p99_ms <= LATE_MS[0]:
        return DoctorCheck(
            "timer", "warn", found, "close other programs, or set the power plan high"
        )
    return DoctorCheck("timer", "ok", found)


def real_time_priority() -> DoctorCheck:
    """See whether this user may have the priority of the rig's loop."""
    from frictus_service.processes import LOOP_PRIORITY

    if sys.platform == "win32" or not hasattr(os, "sched_setscheduler"):
        return DoctorCheck(
            "priority", "ok", "this system has no SCHED_FIFO; the loop runs as normal"
        )
    refused: list[OSError] = []

    def ask() -> None:
        # Linux gives it to the calling thread alone, which ends at once.
        try:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(LOOP_PRIORITY))
        except OSError as error:
            refused.append(error)

    thread = threading.Thread(target=ask, name="frictus-priority")
    thread.start()
    thread.join()
    asked = f"SCHED_FIFO {LOOP_PRIORITY}"
    if refused:
        to_do = f"LimitRTPRIO={LOOP_PRIORITY} in the unit file, or rtprio in limits.conf"
        return DoctorCheck("priority", "warn", f"{asked}: {refused[0].strerror}", to_do)
    return DoctorCheck("priority", "ok", f"this user may have {asked}")


BYTES_PER_SAMPLE: Final = 52
"""Force, acceleration, voltage and, where simulated, five channels of truth, as float32, and
a twelfth more for states; converters' counts take less."""
PIECES: Final = 20
SPARE: Final = 5.0
"""A disk less than so many times as fast as the rig leaves little for anything else."""
HOURS: Final = (1.0, 8.0)
"""Time left at which to fail, and to warn."""


def disk_rate(
    folder: Path,
    sample_rate_hz: float,
    now_s: Callable[[], float] = time.perf_counter,
    free_bytes: Callable[[Path], int] = lambda place: shutil.disk_usage(place).free,
) -> DoctorCheck:
    """Write ten seconds of a rig's streams, synced as a recorder does; the file is deleted.

    Parameters
    ----------
    folder : Path
        Of the recordings; where it is not there yet, the nearest that is takes its place.
    sample_rate_hz : float
        Samples per second of the device's clock.
    now_s, free_bytes : callable
        Clock, and what is left on the disk of a folder.
    """
    from frictus_service.recording.writer import SYNC_S

    above = (folder, *folder.absolute().parents)
    place = next(each for each in above if os.path.isdir(each))  # False below a closed one
    rate = BYTES_PER_SAMPLE * sample_rate_hz
    try:
        free = free_bytes(place)
        took_s = _written(place, os.urandom(round(rate * SYNC_S)), now_s)
    except OSError as error:
        to_do = "name another folder in `recordings`, or allow writing to it"
        return DoctorCheck("disk", "fail", f"{place} cannot be written: {error}", to_do)
    usual_s, worst_s = statistics.median(took_s), max(took_s)
    hours = free / rate / 3600.0
    found = (
        f"{place} takes {_digits(1e-6 * rate * SYNC_S / usual_s)} MB/s synced, "
        f"{_digits(SYNC_S / usual_s)} times what a rig makes ({1e-6 * rate:.2g} MB/s); the "
        f"slowest of {PIECES} syncs took {1e3 * worst_s:.0f} ms; {_digits(1e-9 * free)} GB are "
        f"free, {_digits(hours)} h of recording"
    )
    return _judged(found, SYNC_S / usual_s, hours)


def _digits(value: float) -> str:
    return f"{float(f'{value:.3g}'):,g}"  # 3 digits, and 1,020 where .3g alone writes 1.02e+03


def _judged(found: str, times: float, hours: float) -> DoctorCheck:
    verdict: Verdict = "ok"
    to_do = []
    if not times >= SPARE:
        verdict = "warn" if times >= 1.0 else "fail"
        to_do.append("record to a faster disk of this machine, not over a network")
    if not hours >= HOURS[1]:
        verdict = "fail" if verdict == "fail" or not hours >= HOURS[0] else "warn"
        to_do.append("make room, or name another folder in `recordings`")
    return DoctorCheck("disk", verdict, found, "; ".join(to_do))


def _written(place: Path, piece: bytes, now_s: Callable[[], float]) -> list[float]:
    """Return how long each piece took to be written and synced."""
    took_s = []
    with tempfile.TemporaryFile(dir=place) as file:
        for _ in range(PIECES):
            begun_s = now_s()
            file.write(piece)
            file.flush()
            os.fsync(file.fileno())
            took_s.append(now_s() - begun_s)
    return took_s


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


def clock_synchronised(ask: Callable[[], Kept | None] | None = None) -> DoctorCheck:
    """Look at the system clock.

    Parameters
    ----------
    ask : callable or None
        Says how the clock is kept, None for unknown. None: asks this system.
    """
    kept = (ask or _ask_system)()
    if kept is None:
        found = "it is not known whether the system clock is synchronised"
        return DoctorCheck("utc", "warn", found, _TO_DO)
    in_step, off_ms = kept
    within = "" if off_ms is None else f", off by at most {off_ms:.3g} ms"
    if not in_step:
        return DoctorCheck("utc", "warn", "the system clock is not synchronised", _TO_DO)
    if off_ms is not None and not off_ms <= FAR_MS:
        return DoctorCheck("utc", "warn", f"the system clock is synchronised{within}", _TO_DO)
    return DoctorCheck("utc", "ok", f"the system clock is synchronised{within}")


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
