"""Who ended a lease, and why, is known by the time its end is seen."""

import pytest

from frictus_service.daemon.control import EndedLease, Interlock
from frictus_service.daemon.safety import (
    Arm,
    ClientVanished,
    Disarm,
    Event,
    FaultRaised,
    Renew,
    Stop,
    Tick,
)


@pytest.mark.parametrize(
    ("event", "now_s", "by", "reason"),
    [
        (Stop("bob"), 1.2, "bob", "stopped"),
        (Stop(""), 1.2, None, "stopped"),
        (Disarm("ann"), 1.2, "ann", "disarmed"),
        (ClientVanished("ann"), 1.2, None, "the owner's process or its link is gone"),
        (FaultRaised("safety", "apart"), 1.2, None, "safety fault: apart"),
        (Tick(), 1.5, None, "the lease of 500 ms was not renewed in time"),
        (Stop("bob"), 1.5, None, "the lease of 500 ms was not renewed in time"),
        (Arm("ann", 0.5), 1.5, None, "the lease of 500 ms was not renewed in time"),
        (Arm("bob", 0.5), 1.5, None, "the lease of 500 ms was not renewed in time"),
    ],
)
def test_the_end_of_a_lease_is_kept(
    event: Event, now_s: float, by: str | None, reason: str
) -> None:
    interlock = Interlock()
    interlock.feed(Arm("ann", 0.5), 1.0)
    interlock.feed(Renew("ann"), 1.0)
    assert interlock.ended is None
    interlock.feed(event, now_s)
    assert interlock.ended == EndedLease("ann", by, reason)


def test_what_ends_no_lease_keeps_the_last_end() -> None:
    interlock = Interlock()
    interlock.feed(Arm("ann", 0.5), 1.0)
    interlock.feed(Stop("bob"), 1.1)
    ended = interlock.ended
    interlock.feed(Stop("carl"), 1.2)
    interlock.feed(Tick(), 9.0)
    assert interlock.ended is ended is not None
