"""Mutated payloads on every key: `python -m tests.campaigns.wire --help`.

A whole service runs; a stranger, an observer and the owner send it what is almost valid. No
process may end, no rig trip, no screen be driven without an owner, and every refusal must be a
`Reply` with a code.
"""

import contextlib
import random
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Literal, get_args

import zenoh
from tests.campaigns.lines import Line, asked, go_on
from tests.campaigns.mutations import Mutant, draw_mutant
from tests.campaigns.payloads import ANSWERED, KEYS, PUT
from tests.campaigns.service import (
    Certificates,
    DrivenSamples,
    Said,
    config_in,
    http_status,
    make_certificates,
    run_of,
    serving,
)

import frictus
from frictus.calls import Caller
from frictus.errors import FrameError, FrictusError, LinkError, RefusedError
from frictus.keys import CALLS, RigKeys, Topics
from frictus.messages import LeaseRenewal, RefusalCode, Reply
from frictus.stream import HEADER_BYTES, MAGIC
from frictus_hardware import SimulatedConfig
from frictus_hardware.simulated.config import FingerConfig
from frictus_hardware.simulated.guided import ClientFinger, GuidedStrokes
from frictus_hardware.simulated.strokes import SteadyStrokes
from frictus_service.config import Config
from frictus_service.daemon.processes.supervisor import Supervisor
from frictus_service.errors import RecordingError
from frictus_service.recording.reader import RecordingReader
from frictus_service.recording.summary import summarise

Role = Literal["stranger", "observer", "owner"]
Mode = Literal["disarmed", "armed", "owner", "free"]
ROLES: Final[tuple[Role, ...]] = get_args(Role)
MODES: Final[tuple[Mode, ...]] = get_args(Mode)
"""Nobody has armed, and nobody tries; the owner has, and others send; the owner sends; anybody
sends anything."""
FINGERS: Final[dict[str, FingerConfig]] = {
    "steady": SteadyStrokes(),
    "pointer": ClientFinger(),
    "guided": GuidedStrokes(),
    "secured": SteadyStrokes(),
}
"""Services, by their virtual finger; the last with certificates."""
BATCH: Final = 250
ANSWER_S: Final = 8.0
DENIED_S: Final = 0.3
"""How long to wait for an answer that must not come."""
LEASE_MS: Final = 10_000
SETTLED_BLOCKS: Final = 40
"""Of 5 ms: lead, ramp and publisher's queue are over by then."""
KEPT: Final = 12
"""Payloads that a failure is recorded with; whose effect shows later is among the last."""
KEPT_BYTES: Final = 4_096
PATHS: Final = ("/v1/ready", "/v1/rigs", "/v1/rigs/rig1")


@dataclass(frozen=True, slots=True)
class Sent:
    """A payload that was sent, and by whom."""

    role: Role
    key: str
    mutant: Mutant

    def as_json(self) -> dict[str, object]:
        """Return it as a line keeps it; of large ones the beginning."""
        payload = self.mutant.payload
        return {
            "role": self.role,
            "key": self.key,
            "how": self.mutant.how,
            "bytes": len(payload),
            "hex": payload[:KEPT_BYTES].hex(),
        }


class Bench:
    """A service, its rig's owner and everybody else who sends.

    Parameters
    ----------
    name : str
        A key of `FINGERS`.
    folder : Path
    """

    def __init__(self, name: str, folder: Path) -> None:
        certificates = make_certificates(folder) if name == "secured" else None
        backend = SimulatedConfig(finger=FINGERS[name])
        self.config: Config = config_in(
            folder, backend, certificates.section if certificates else None
        )
        self.secured = certificates is not None
        self.said = Said()
        self.certificates: Certificates | None = certificates
        self.sessions: dict[Role, zenoh.Session] = {}

    @contextlib.contextmanager
    def running(self) -> Iterator["Bench"]:
        """Run the service and connect everybody."""
        with contextlib.ExitStack() as stack:
            self.supervisor: Supervisor = stack.enter_context(serving(self.config, self.said))
            for role in ROLES:
                tls = None
                if self.certificates is not None:
                    of_role = {
                        "owner": self.certificates.controller,
                        "observer": self.certificates.observer,
                        "stranger": self.certificates.stranger,
                    }
                    tls = of_role[role]
                client = stack.enter_context(
                    frictus.connect(self.config.router.endpoint, name=role, tls=tls)
                )
                self.sessions[role] = client.session
                if role == "owner":
                    self.rig = client.rig(self.config.rig, self.config.site)
            self.keys: RigKeys = self.config.keys
            self.caller = Caller(self.sessions["owner"], self.keys, "owner", ANSWER_S)
            session = self.sessions["owner"]
            token = session.liveliness().declare_token(self.keys.client_alive("owner"))
            stack.callback(token.undeclare)
            self.driven = DrivenSamples(session, self.keys, run_of(self.rig))
            stack.callback(self.driven.close)
            yield self

    def may(self, role: Role, key: str) -> bool:
        """Return whether what a role sends under a key reaches anybody."""
        if not self.secured or key == "stop":
            return role != "stranger" or not self.secured
        return role == "owner"

    def most_bytes(self, key: str) -> int:
        """Return the size that the reader of a key accepts."""
        limits = self.config.limits
        return limits.max_scene_bytes if key == "scene" else limits.max_payload_bytes

    def state(self) -> str:
        """Return the rig's state, by its own word."""
        return self.caller.call("close_stream").state


@dataclass
class Batch:
    """So many payloads in one mode.

    Parameters
    ----------
    bench : Bench
    mode : str
    seed : int
    """

    bench: Bench
    mode: Mode
    seed: int
    outcomes: Counter[str] = field(default_factory=Counter)
    keys: Counter[str] = field(default_factory=Counter)
    failures: list[dict[str, Any]] = field(default_factory=list)
    recent: list[Sent] = field(default_factory=list)
    sent_bytes: int = 0
    ticket: int = 0
    updates: int = 0
    renewed_s: float = 0.0

    def run(self, cases: int) -> Line:
        """Send so many payloads; return what came of it."""
        began_s = time.monotonic()
        rng = random.Random(self.seed)
        self._begin()
        quiet_from_s = time.monotonic()
        self._record()
        for _ in range(cases):
            self._keep()
            self._send(self._draw(rng))
            self._note_ends()
        self._end(quiet_from_s)
        return {
            "mode": self.mode,
            "cases": cases,
            "outcomes": dict(self.outcomes),
            "keys": dict(self.keys),
            "bytes": self.sent_bytes,
            "seconds": round(time.monotonic() - began_s, 2),
            "failures": self.failures,
        }

    def _draw(self, rng: random.Random) -> Sent:
        if self.mode == "owner":
            role: Role = "owner"
        elif self.mode == "armed":
            role = rng.choice(("stranger", "observer"))
        else:
            role = rng.choice(ROLES)
        left_out = {"disarmed": ("arm",), "armed": ("stop",)}.get(self.mode, ())
        weights = [4 if key in ANSWERED or key.startswith("cmd/") else 1 for key in KEYS]
        (key,) = rng.choices(KEYS, weights)
        while key in left_out:
            (key,) = rng.choices(KEYS, weights)
        most = self.bench.most_bytes(key)
        mutant = draw_mutant(key, role, time.time_ns(), most, rng)
        if key == Topics.TEXTURE.suffix and rng.random() < 0.5:
            mutant = self._aimed(mutant)
        return Sent(role, key, mutant)

    def _aimed(self, mutant: Mutant) -> Mutant:
        """Make a frame one of the stream that is open, newer than those before."""
        payload = bytearray(mutant.payload)
        if len(payload) < HEADER_BYTES or not payload.startswith(MAGIC):
            return mutant
        self.updates += 1
        payload[8:12] = self.ticket.to_bytes(4, "little")
        payload[16:24] = self.updates.to_bytes(8, "little")
        return Mutant(mutant.how, bytes(payload))

    def _send(self, sent: Sent) -> None:
        bench, payload = self.bench, sent.mutant.payload
        self.recent = [*self.recent, sent][-KEPT:]
        self.keys[sent.key] += 1
        self.sent_bytes += len(payload)
        session = bench.sessions[sent.role]
        if sent.key in PUT:
            qos = PUT[sent.key].qos
            session.put(
                f"{bench.keys.base}/{sent.key}",
                payload,
                congestion_control=zenoh.CongestionControl.BLOCK,
                priority=getattr(zenoh.Priority, qos.priority),
            )
            self.outcomes["put"] += 1
            return
        may = bench.may(sent.role, sent.key)
        answers = list(
            session.get(
                bench.keys.call(sent.key),
                payload=payload,
                timeout=ANSWER_S if may else DENIED_S,
                congestion_control=zenoh.CongestionControl.BLOCK,
            )
        )
        replies = [each.ok.payload.to_bytes() for each in answers if each.ok is not None]
        if not may:
            self._check(not replies, "answered although the router denies it", sent)
            self.outcomes["denied"] += 1
        elif len(replies) == 1:
            self._judge(sent, replies[0])
        elif not bench.said.await_end():  # told of with its last payloads
            self._check(False, f"{len(replies)} replies", sent)

    def _judge(self, sent: Sent, payload: bytes) -> None:
        try:
            reply = Reply.from_json(payload)
        except FrameError as error:
            self._check(False, f"no Reply: {error}", sent)
            return
        typed = reply.ok or reply.code in get_args(RefusalCode)
        self._check(typed and "failed on it" not in reply.message, reply.message, sent)
        if reply.state == "tripped":
            fault = self.bench.rig.status().fault
            self._check(False, f"tripped: {fault.reason if fault else '?'}")
            self._begin()
            return
        self.outcomes["accepted" if reply.ok else str(reply.code)] += 1
        if reply.ticket is not None:
            self.ticket, self.updates = reply.ticket, 0
        if sent.key in CALLS and self.mode in ("armed", "disarmed"):
            expected = {"armed": ("armed",), "disarmed": ("disarmed", "stopping")}[self.mode]
            if not self._check(reply.state in expected, f"the rig is {reply.state}", sent):
                self._begin()

    def _check(self, holds: bool, what: str, sent: Sent | None = None) -> bool:
        if not holds:
            payloads = self.recent if sent is None else [sent]
            self.failures.append(
                {"what": what[:500], "payloads": [each.as_json() for each in payloads]}
            )
        return holds

    def _note_ends(self) -> None:
        """Take note where a process has ended; go on once it is back."""
        bench = self.bench
        ends = bench.said.new_ends()
        for line in ends:
            self._check(False, line)
        if ends:
            if not bench.said.await_recovery():
                raise RuntimeError("the service did not come back")
            bench.driven.run = run_of(bench.rig)
            self._begin()

    def _begin(self) -> None:
        """Bring the rig to the state that the mode begins with."""
        bench = self.bench
        for call in ("stop", "reset"):
            with contextlib.suppress(RefusedError):
                bench.caller.call(call)
        bench.driven.await_blocks(SETTLED_BLOCKS)
        if self.mode in ("armed", "owner"):
            bench.caller.call("arm", lease_ms=LEASE_MS)
        self.renewed_s = time.monotonic()

    def _keep(self) -> None:
        """Renew the lease, and take it again where the owner's own payloads gave it away."""
        bench = self.bench
        if self.mode not in ("armed", "owner") or time.monotonic() - self.renewed_s < 1.0:
            return
        renewal = LeaseRenewal(client="owner", utc_ns=time.time_ns(), ttl_ms=LEASE_MS)
        bench.sessions["owner"].put(bench.keys.of(Topics.LEASE), renewal.to_json())
        if self.mode == "owner" and bench.state() != "armed":
            bench.caller.call("arm", lease_ms=LEASE_MS)
        self.renewed_s = time.monotonic()

    def _record(self) -> None:
        with contextlib.suppress(RefusedError):
            self.bench.caller.call("record", name=f"batch-{self.seed}")

    def _end(self, quiet_from_s: float) -> None:
        """Check what shows only afterwards: voltage, recordings, the API."""
        bench = self.bench
        quiet = bench.driven.await_blocks(SETTLED_BLOCKS)
        if self.mode == "disarmed":
            loud = [when for when in bench.driven.loud_s if when >= quiet_from_s]
            self._check(not loud, f"{len(loud)} blocks driven although nobody had armed")
        with contextlib.suppress(RefusedError):
            bench.caller.call("stop")
        self._check(quiet and bench.driven.await_blocks(SETTLED_BLOCKS), "no blocks come")
        stopped_s = time.monotonic()
        bench.driven.await_blocks(SETTLED_BLOCKS)
        loud = [when for when in bench.driven.loud_s if when >= stopped_s]
        self._check(not loud, f"{len(loud)} blocks driven after a stop")
        self._check(bench.state() == "disarmed", "not disarmed after a stop")
        bench.driven.loud_s.clear()
        self._end_recording()
        for path in PATHS:
            status = http_status(bench.config, path)
            self._check(status == 200, f"the API answers {path} with {status}")
        self._note_ends()

    def _end_recording(self) -> None:
        bench = self.bench
        try:
            bench.caller.call("end_recording")
        except RefusedError as error:
            self._check(error.code == "conflict", f"end_recording: {error}")
        except LinkError as error:
            self._check(False, str(error))
        for path in bench.config.recordings.glob("*.mcap"):
            try:
                with RecordingReader(path) as reader:
                    ending = summarise(reader).ending
                self._check(ending.complete, f"{path.name}: {ending}")
            except RecordingError as error:
                self._check(False, f"{path.name}: {error}")
            path.unlink()


def batches(cases: int, each: int = BATCH) -> list[str]:
    """Return the names of the batches that together send so many payloads."""
    kinds = [f"{finger}/{mode}" for finger in FINGERS for mode in MODES]
    count = -(-cases // each)
    # In the order of their services, so that each is started once.
    names = [f"{kinds[place % len(kinds)]}/{place // len(kinds)}" for place in range(count)]
    return sorted(names, key=lambda name: list(FINGERS).index(name.split("/")[0]))


class Campaign:
    """Runs batches, one service after the other; a context manager."""

    def __init__(self, each: int = BATCH) -> None:
        self._each = each
        self._name = ""
        self._stack = contextlib.ExitStack()

    def run(self, name: str, seed: int) -> Line:
        """Return the line of a batch."""
        finger, mode, _ = name.split("/")
        if finger != self._name:
            self.close()
            folder = Path(self._stack.enter_context(tempfile.TemporaryDirectory()))
            self._bench = self._stack.enter_context(Bench(finger, folder).running())
            self._name = finger
        batch = Batch(self._bench, mode, seed)  # type: ignore[arg-type]
        try:
            return batch.run(self._each)
        except (FrictusError, RuntimeError) as error:
            # Whatever goes wrong is in the line: the campaign goes on with a service anew.
            batch._check(
                False, f"{type(error).__name__}: {error}; {self._bench.said.lines[-3:]}"
            )
            self.close()
            return {"mode": mode, "cases": 0, "failures": batch.failures}

    def close(self) -> None:
        """End the service."""
        self._name = ""
        self._stack.close()

    def __enter__(self) -> "Campaign":
        """Return self."""
        return self

    def __exit__(self, *_error: object) -> None:
        """Close."""
        self.close()


def main() -> None:
    """Run the campaign, or a part of it."""
    wanted = asked(__doc__, "cases", 50_000, "payloads", batches)
    with Campaign() as campaign:
        for line in go_on(*wanted, campaign.run):
            told = [failure["what"][:160] for failure in line["failures"]]
            head = f"{line['name']} seed {line['seed']}: {line.get('outcomes')}"
            print(head, *told, sep="\n  ", flush=True)  # noqa: T201


if __name__ == "__main__":
    main()
