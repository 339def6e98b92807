"""An armed rig beside a stranger who sends the worst payloads that it takes in."""

import json
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass

import pytest
import zenoh

import frictus
from frictus.keys import RigKeys, Topics
from frictus.messages import Reply, RigStatus
from frictus.session import open_session
from frictus_hardware import SimulatedConfig
from frictus_service.command_validation import MAX_VALUES
from frictus_service.config import Config, RouterConfig
from frictus_service.daemon.commands import UNNAMED_BYTES
from frictus_service.daemon.processes.supervisor import Supervisor
from frictus_service.processes import free_endpoint

SECONDS = 6.0
"""Longer than the window of `LoopTiming.margin_min_ms`, 5 s."""


def numbers(number: bytes, count: int, client: bytes = b"ben") -> bytes:
    """A scene with a list of numbers in a field that no texture has."""
    head = b'{"client":"%b","utc_ns":%d,"scene":{"x":[' % (client, time.time_ns() - 10**10)
    return head + (number + b",") * (count - 1) + number + b"]}}"


def profile() -> bytes:
    """As many samples as a profile holds, with all their digits."""
    friction = ",".join(f"{0.1 * (n % 7) - 0.3:.17e}" for n in range(65_536))
    return (
        b'{"client":"ben","utc_ns":%d,"ttl_ms":1,"scene":{"regions":[{"texture":'
        b'{"kind":"profile","period_mm":60,"friction_n":[%b]}}]}}'
    ) % (time.time_ns() - 10**9, friction.encode())  # stale: read in full, and refused


STRANGERS = {
    "by its own name": ("ben", profile),
    "by the owner's name": (
        "ann",
        lambda: numbers(b"0.1234567890123456", MAX_VALUES - 10, b"ann"),
    ),
    "nameless": ("", lambda: numbers(b"1", UNNAMED_BYTES // 2 - 40)),
}


@pytest.fixture
def endpoint() -> Iterator[str]:
    config = Config(router=RouterConfig(endpoint=free_endpoint()), backend=SimulatedConfig())
    with Supervisor(config, parts=("rig",), say=lambda line: None) as supervisor:
        supervisor.wait_ready(100.0)
        yield config.router.endpoint


@dataclass
class Sent:
    """What a stranger has sent, and how it was answered."""

    count: int = 0
    codes: frozenset[str | None] = frozenset()


def send(session: zenoh.Session, key: str, name: str, payload: bytes, seconds: float) -> Sent:
    """Send one payload after the other, each when the one before is answered."""
    count, codes = 0, set()
    until_s = time.monotonic() + seconds
    while time.monotonic() < until_s:
        for answer in session.get(key, payload=payload, attachment=name, timeout=10.0):
            assert answer.ok is not None
            codes.add(Reply.from_json(answer.ok.payload.to_bytes()).code)
        count += 1
    return Sent(count, frozenset(codes))


def timed(rig: frictus.Rig) -> RigStatus:
    """The next status that is published."""
    now_ns = time.time_ns()
    with rig.watch(Topics.STATUS, timeout_s=30.0) as states:
        return next(
            state for state in states if isinstance(state, RigStatus) and state.utc_ns > now_ns
        )


@pytest.mark.load
@pytest.mark.parametrize("who", STRANGERS)
def test_a_strangers_payloads_leave_an_armed_rig_armed(
    who: str, endpoint: str, capsys: pytest.CaptureFixture[str]
) -> None:
    name, make = STRANGERS[who]
    with frictus.connect(endpoint, name="ann") as client:
        rig = client.rig("rig1")
        stranger = open_session(endpoint, 10.0)
        try:
            with rig.arm(5_000) as lease:
                stop_s = time.monotonic() + SECONDS
                with rig.watch(Topics.STATUS, timeout_s=30.0) as states:
                    while time.monotonic() < stop_s:
                        next(states)
                quiet = timed(rig)
                sent = send(
                    stranger, RigKeys("lab", "rig1").call("scene"), name, make(), SECONDS
                )
                beside = timed(rig)
                assert lease.loss is None
        finally:
            stranger.close()  # type: ignore[no-untyped-call]
    figures = {
        "who": who,
        "sent": sent.count,
        "codes": sorted(map(str, sent.codes)),
        "late_p99_ms": [state.timing.lateness_p99_ms for state in (quiet, beside)],
        "margin_min_ms": [state.timing.margin_min_ms for state in (quiet, beside)],
        "underruns": [state.counters.underruns for state in (quiet, beside)],
    }
    with capsys.disabled():
        sys.stdout.write(json.dumps(figures) + "\n")
    assert None not in sent.codes
    assert beside.timing.lateness_p99_ms < beside.lead_ms
    assert beside.state == "armed"
    assert beside.counters.trips == 0
