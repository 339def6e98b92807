"""The whole service at free ports, and an eye on whatever of it ends, trips or drives."""

import datetime
import http.client
import json
import re
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import zenoh
from zenoh.handlers import Callback

import frictus
from frictus.block import Block
from frictus.errors import FrameError
from frictus.keys import RigKeys, Topics
from frictus.tls import Tls
from frictus_hardware import BackendConfig
from frictus_service.config import (
    ApiConfig,
    Config,
    RegistryConfig,
    RouterConfig,
    SecurityConfig,
)
from frictus_service.daemon.processes.child_process import PartName
from frictus_service.daemon.processes.supervisor import ALL, Supervisor
from frictus_service.processes import free_endpoint, free_port
from frictus_service.security.authority import issue, make_authority
from frictus_service.security.files import AUTHORITY, write
from frictus_service.security.members import Member

START_S: Final = 300.0
"""The first start on a machine compiles, beside whatever else runs there."""
HTTP_S: Final = 20.0
END_S: Final = 2.0
"""Within which a supervisor tells that a process has ended."""
ENDED: Final = " process ended"


@dataclass(frozen=True, slots=True)
class Certificates:
    """What the members of a secured network present."""

    section: SecurityConfig
    controller: Tls
    observer: Tls
    stranger: Tls
    """Signed by the authority, and unknown to the router."""


def make_certificates(folder: Path) -> Certificates:
    """Make an authority, and a certificate for everybody, as `frictus pki` does."""
    now, day = datetime.datetime.now(datetime.UTC), datetime.timedelta(days=1)
    authority = make_authority("campaign", now, day)
    members, outside = folder / "pki", folder / "outside"
    root = write(authority, members, AUTHORITY)[0]

    def signed(name: str, to: Path = members) -> Path:
        member = Member.of(name)
        hosts = ["127.0.0.1"] if member.role == "router" else []
        return write(issue(authority, member, hosts, now, day), to, member.stem)[0]

    controller = signed("controller:owner")
    section = SecurityConfig(
        authority=root,
        router=signed("router:hall"),
        members=members,
        rig=signed("rig:lab/rig1"),
        client=controller,
    )
    return Certificates(
        section,
        Tls(root, controller),
        Tls(root, signed("observer:observer")),
        Tls(root, signed("controller:stranger", outside)),
    )


def config_in(
    folder: Path, backend: BackendConfig, security: SecurityConfig | None = None
) -> Config:
    """Return the configuration of a service that keeps everything in a folder."""
    endpoint = free_endpoint()
    return Config(
        backend=backend,
        router=RouterConfig(
            endpoint=endpoint if security is None else endpoint.replace("tcp/", "tls/")
        ),
        api=ApiConfig(port=free_port()),
        recordings=folder / "recordings",
        studies=folder / "studies",
        textures=folder / "textures",
        registry=RegistryConfig(url=f"sqlite:///{(folder / 'frictus.db').as_posix()}"),
        security=security,
    )


@dataclass
class Said:
    """What a supervisor says, and who can wait for it."""

    lines: list[str] = field(default_factory=list)
    _looked: int = 0
    _more: threading.Condition = field(default_factory=threading.Condition)

    def __call__(self, line: str) -> None:
        """Take a line."""
        with self._more:
            self.lines.append(line)
            self._more.notify_all()

    def new_ends(self) -> list[str]:
        """Return the lines by which a process ended, each once."""
        looked, self._looked = self._looked, len(self.lines)
        return [line for line in self.lines[looked : self._looked] if ENDED in line]

    def pid(self, part: str) -> int:
        """Return the process id of a part, as it was last ready."""
        ready = re.compile(rf"{part} is ready \(process (\d+)")
        found = [match[1] for line in self.lines if (match := ready.match(line))]
        return int(found[-1])

    def await_end(self, timeout_s: float = END_S) -> bool:
        """Wait until a process ends that `new_ends` has not returned; return whether."""
        with self._more:
            return self._more.wait_for(
                lambda: any(ENDED in line for line in self.lines[self._looked :]), timeout_s
            )

    def await_line(self, is_wanted: Callable[[str], bool], timeout_s: float) -> bool:
        """Wait until something was said; return whether it was."""
        with self._more:
            return self._more.wait_for(lambda: any(map(is_wanted, self.lines)), timeout_s)

    def await_ready(self, parts: Iterable[str], timeout_s: float) -> bool:
        """Wait until all of these parts have become ready; return whether they have."""
        with self._more:
            return self._more.wait_for(
                lambda: all(
                    any(line.startswith(f"{part} is ready") for line in self.lines)
                    for part in parts
                ),
                timeout_s,
            )

    def await_recovery(self, timeout_s: float = START_S) -> bool:
        """Wait until every process that ended is ready again; return whether they are."""
        with self._more:
            return self._more.wait_for(self._all_ready, timeout_s)

    def _all_ready(self) -> bool:
        ready: dict[str, bool] = {}
        for line in self.lines:
            if ENDED in line:
                ready[line.split("the ", 1)[1].split(ENDED)[0]] = False
            elif " is ready (process" in line:
                ready[line.split(" is ready")[0]] = True
        return all(ready.values())


@contextmanager
def serving(
    config: Config, said: Said, parts: tuple[PartName, ...] = ALL
) -> Iterator[Supervisor]:
    """Run the service until the context ends."""
    with Supervisor(config, parts, say=said) as supervisor:
        supervisor.wait_ready(START_S)
        yield supervisor


class DrivenSamples:
    """Watches the monitored voltage of a rig, whoever else says something under its key."""

    def __init__(self, session: zenoh.Session, keys: RigKeys, run: int) -> None:
        self.run = run
        self.loud_s: list[float] = []
        """When a block with a voltage arrived, monotonic."""
        self._arrived = threading.Condition()
        self._subscriber = session.declare_subscriber(
            keys.of(Topics.VOLTAGE), Callback(self._note, indirect=False)
        )
        self._blocks = 0

    def _note(self, sample: zenoh.Sample) -> None:
        try:
            block = Block.unpack(sample.payload.to_bytes())
        except FrameError:
            return
        if block.run == self.run:
            with self._arrived:
                self._blocks += 1
                if block.data.any():
                    self.loud_s.append(time.monotonic())
                self._arrived.notify_all()

    def await_blocks(self, count: int, timeout_s: float = 10.0) -> bool:
        """Wait for so many blocks from now; return whether they came."""
        with self._arrived:
            until = self._blocks + count
            return self._arrived.wait_for(lambda: self._blocks >= until, timeout_s)

    def close(self) -> None:
        """Stop watching."""
        self._subscriber.undeclare()  # type: ignore[no-untyped-call]


def http_status(config: Config, path: str) -> int:
    """Return the status with which the API answers; 0 where it does not."""
    try:
        url = f"http://127.0.0.1:{config.api.port}{path}"
        with urllib.request.urlopen(url, timeout=HTTP_S) as answer:
            return int(answer.status)
    except urllib.error.HTTPError as error:
        with error:
            return error.code
    except (OSError, http.client.HTTPException):
        return 0


def publish(config: Config, token: str | None = None) -> tuple[int, str]:
    """Publish a model; return the API's status, 0 for none, and the reference."""
    model = {
        "schema": "model/1",
        "base": {
            "law": "first_order_speed",
            "gain_n": 0.4,
            "cutoff_0_hz": 400.0,
            "slope_hz_per_mm_s": 12.0,
        },
        "participant": "P01",
        "provenance": {"study_sha256": "ab" * 32, "code_version": "0.1.0", "settings": {}},
    }
    body = json.dumps({"name": "rig1/P01", "rig": "rig1", "model": model}).encode()
    headers = {"Content-Type": "application/json"}
    if token is not None:
        headers["Authorization"] = f"Bearer {token}"
    request = urllib.request.Request(
        f"http://127.0.0.1:{config.api.port}/v1/models", body, headers
    )
    try:
        with urllib.request.urlopen(request, timeout=HTTP_S) as answer:
            return int(answer.status), str(answer.headers["Location"]).rsplit("models/")[1]
    except urllib.error.HTTPError as error:
        with error:
            return error.code, ""
    except (OSError, http.client.HTTPException):
        return 0, ""


def run_of(rig: frictus.Rig) -> int:
    """Return the run of the rig itself, not of whoever speaks under its name."""
    with rig.watch(Topics.STATUS, timeout_s=START_S) as states:
        return next(
            state.run
            for state in states
            if isinstance(state, frictus.RigStatus) and state.site == rig.keys.site
        )
