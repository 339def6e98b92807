"""Whether this machine can keep the pace of a block loop."""

import os
import threading
import time
from collections.abc import Callable
from typing import Final

from frictus_service.cli.checks.check import Check

CLOCK_NS: Final = 100_000
"""A clock that steps in more than this cannot time 5 ms blocks well."""
LATE_MS: Final = (2.0, 20.0)
"""Lateness of a 5 ms timer at which to warn, and at which the loop must fail."""


def clock_resolution(clock_ns: Callable[[], int] = time.monotonic_ns) -> Check:
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
        return Check("clock", "warn", found, "loop deadlines will be coarse on this machine")
    return Check("clock", "ok", found)


def timer_lateness(rounds: int = 200, period_s: float = 0.005) -> Check:
    """Measure how late a 5 ms timer wakes on this machine, as it is loaded now."""
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
        return Check("timer", "fail", found, to_do)
    if not p99_ms <= LATE_MS[0]:
        return Check("timer", "warn", found, "close other programs, or set the power plan high")
    return Check("timer", "ok", found)


def real_time_priority() -> Check:
    """See whether this user may have the priority of the rig's loop."""
    from frictus_service.daemon.real_time import LOOP_PRIORITY

    if not hasattr(os, "sched_setscheduler"):
        return Check("priority", "ok", "this system has no SCHED_FIFO; the loop runs as normal")
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
        return Check("priority", "warn", f"{asked}: {refused[0].strerror}", to_do)
    return Check("priority", "ok", f"this user may have {asked}")
