"""Real-time priority for a rig's threads, as long as a share of the cores stays free.

A real-time thread runs whenever it wants to. Where those of all rigs of a machine together want
most of it, neither the API nor a command answers any more, a stop among them.
"""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Final

LOOP_PRIORITY: Final = 20
PUBLISHER_PRIORITY: Final = 10
"""Real time too: a publisher that is set aside while it holds the interpreter's lock holds up
the loop, whatever the loop's own priority is."""
FREE_SHARE: Final = 0.25
"""Of the cores; real-time threads leave it to everything else."""
WHOLE_OVER_LOOP: Final = 2.5
"""What a rig's process takes over what its blocks take: 1.7 measured without readers."""
YOUNG_S: Final = 1.0
"""A thread that has not run so long does not show yet what it takes."""

_REAL_TIME: Final = {"1", "2"}
"""SCHED_FIFO and SCHED_RR, as Linux numbers them."""
_UTIME, _STIME, _START, _POLICY = 11, 12, 19, 38
"""Fields of /proc/PID/task/TID/stat, counted from the one behind the name (proc(5))."""


@dataclass(frozen=True, slots=True)
class RealTimeBudget:
    """What real-time threads may take of this machine, and what they would.

    Attributes
    ----------
    cores : int
        That this process may use.
    others : float
        Cores that the real-time threads of other processes take.
    rig : float
        Cores that this rig takes.
    """

    cores: int
    others: float
    rig: float

    @property
    def accepted(self) -> float:
        """How many cores all real-time threads together may take."""
        return (1.0 - FREE_SHARE) * self.cores

    @property
    def fits(self) -> bool:
        """Whether this rig may have real-time priority."""
        return self.others + self.rig <= self.accepted

    def __str__(self) -> str:
        """Return the sum, what is accepted and what to do."""
        return (
            f"real-time threads would take {self.others + self.rig:.2f} of {self.cores} cores, "
            f"{self.rig:.2f} of them this rig's; at most {self.accepted:.2f} are accepted, so "
            "that the API and commands answer: run fewer rigs on this machine, or lower "
            "sample_rate_hz"
        )


def budget_for(loop: float) -> RealTimeBudget:
    """Return what this machine has for a rig.

    Parameters
    ----------
    loop : float
        Time that the rig's blocks take, over their duration.
    """
    affinity = getattr(os, "sched_getaffinity", None)
    cores = len(affinity(0)) if affinity else os.cpu_count() or 1
    rig = WHOLE_OVER_LOOP * loop
    return RealTimeBudget(cores, taken_by_others(0.5 * rig), rig)


def taken_by_others(young: float, proc: Path = Path("/proc")) -> float:
    """Return how many cores the real-time threads of other processes take.

    Each counts with what it took on average since it began. On a system that does not list
    them, none is known of, and 0 is returned.

    Parameters
    ----------
    young : float
        What a thread counts with that is younger than `YOUNG_S`: two rigs may start at once.
    proc : Path
        Where Linux lists threads.
    """
    try:
        now_s = float((proc / "uptime").read_text().split()[0])
    except OSError:
        return 0.0
    tick_s = 1.0 / os.sysconf("SC_CLK_TCK")
    taken = 0.0
    for stat in proc.glob("[0-9]*/task/[0-9]*/stat"):
        if stat.parts[-4] == str(os.getpid()):
            continue
        try:
            fields = stat.read_text().rpartition(")")[2].split()
        except OSError:
            continue  # it has ended meanwhile
        if fields[_POLICY] in _REAL_TIME:
            age_s = now_s - tick_s * int(fields[_START])
            used_s = tick_s * (int(fields[_UTIME]) + int(fields[_STIME]))
            taken += used_s / age_s if age_s >= YOUNG_S else young
    return taken


def raise_priority(priority: int, budget: RealTimeBudget) -> str:
    """Ask for real-time priority for this thread if it fits; return what came of it.

    Not having it is no fault: the loop then is later now and then, which is counted.

    Parameters
    ----------
    priority : int
        1 to 99, of SCHED_FIFO.
    budget : RealTimeBudget
        What the rigs of this machine take.
    """
    if not budget.fits:
        return f"normal: {budget}"
    if not hasattr(os, "sched_setscheduler"):
        return "normal (this system has no SCHED_FIFO)"
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except OSError as error:
        return (
            f"normal ({error.strerror}); allow real time by "
            "LimitRTPRIO in the unit file or rtprio in limits.conf"
        )
    return f"real time (SCHED_FIFO {priority})"
