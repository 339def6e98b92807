"""Minutes of real time: a rig, 16 subscribers, one more that is frozen, and a busy API.

`FRICTUS_LOAD_S` says for how long; 300 s unless told. The figures are printed.
"""

import json
import os
import signal
import sys
import threading
import time

import pytest

import frictus
from frictus.messages import RigStatus
from frictus_laboratory.benchmarks.load import STREAMS, Tally, loaded, subscribe
from frictus_laboratory.benchmarks.processes import (
    RIG,
    Neighbour,
    config_of,
    neighbour,
    serving,
)
from frictus_service.library import SHIPPED, TextureLibrary

SECONDS = float(os.environ.get("FRICTUS_LOAD_S", "300"))
SUBSCRIBERS = 16
LARGEST_LOSS = 1e-4
SLACK_BLOCKS = 400
"""Counts are not taken at one instant: 2 s of blocks."""


def lost_share(tallies: list[Tally]) -> float:
    lost = sum(tally.lost for tally in tallies)
    return lost / (lost + sum(tally.received for tally in tallies))


def counted(before: RigStatus, after: RigStatus) -> dict[str, int]:
    return {
        name: getattr(after.counters, name) - getattr(before.counters, name)
        for name in ("blocks", "deadline_misses", "overruns", "underruns", "blocks_dropped")
    }


def caught_up(frozen: Neighbour, blocks: int) -> Tally:
    """Return what a subscriber counts once it knows of so many blocks of each stream."""
    deadline_s = time.monotonic() + 30.0
    while True:
        tally: Tally = frozen.ask("tally")[0]
        known = tally.received + tally.lost
        if known >= blocks * len(STREAMS) or time.monotonic() > deadline_s:
            return tally
        threading.Event().wait(0.2)


def load_average() -> list[float]:
    return list(os.getloadavg()) if hasattr(os, "getloadavg") else []


@pytest.mark.load
@pytest.mark.timeout(SECONDS + 240.0)
def test_minutes_under_load(capsys: pytest.CaptureFixture[str]) -> None:
    config = config_of()
    with (
        serving(config, ("rig", "api")),
        frictus.connect(config.router.endpoint) as client,
        neighbour(subscribe, config.router.endpoint, [RIG]) as frozen,
        loaded(config, SUBSCRIBERS) as load,
    ):
        rig = client.rig(RIG)
        rig.set_scene(TextureLibrary(SHIPPED).get("vinyl").texture)
        with rig.arm(lease_ms=5_000) as lease:
            if sys.platform != "win32":
                os.kill(frozen.pid, signal.SIGSTOP)
            at_first = load.tallies()
            before, begun_s = rig.status(), time.monotonic()
            worst_p99_ms = 0.0
            while time.monotonic() - begun_s < SECONDS:
                threading.Event().wait(4.0)
                worst_p99_ms = max(worst_p99_ms, rig.status().timing.lateness_p99_ms)
            after, tallies = rig.status(), load.tallies()
            assert not lease.lost
        answers = load.answers()
        if sys.platform != "win32":
            os.kill(frozen.pid, signal.SIGCONT)
            thawed = caught_up(frozen, after.counters.blocks - before.counters.blocks)
    counts = counted(before, after)
    report = {
        "seconds": round(time.monotonic() - begun_s, 1),
        "load_average": load_average(),
        "received": sum(tally.received for tally in tallies),
        "lost": sum(tally.lost for tally in tallies),
        "lost_share": lost_share(tallies),
        "gaps": [tally.gaps for tally in tallies if tally.gaps],
        "rig": counts,
        "timing": after.timing.model_dump(),
        "worst_p99_ms": worst_p99_ms,
        "api_answers": answers,
    }
    if sys.platform != "win32":
        assert thawed.lost == thawed.gap_blocks
        assert thawed.received + thawed.lost >= counts["blocks"] * len(STREAMS)
        report["frozen"] = {"received": thawed.received, "lost": thawed.lost}
    with capsys.disabled():
        sys.stdout.write("\n" + json.dumps(report, indent=1) + "\n")

    sent = counts["blocks"] * len(STREAMS)
    for first, tally in zip(at_first, tallies, strict=True):
        assert tally.lost == tally.gap_blocks, "a loss that no gap told of"
        seen = tally.received + tally.lost - first.received - first.lost
        assert abs(seen - sent) <= SLACK_BLOCKS * len(STREAMS)
    assert lost_share(tallies) < LARGEST_LOSS
    assert counts["blocks"] > 0.99 * 200.0 * SECONDS
    assert set(answers) == {200}
