"""Two rigs, a router, an API and clients, each on its own host: what a torn network does."""

import contextlib
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Final

import pytest

from .hosts import Host, Star, star

pytestmark = [pytest.mark.separate, pytest.mark.timeout(300.0)]

RIGS: Final = ("rig1", "rig2")
LEASE_MS: Final = 500
LIMIT_S: Final = 0.1
"""From the moment the daemon can know to zero at the screen."""
RATE_HZ: Final = 20_000
DEVICE: Final = "127.0.0.1:7450"
"""The same on every host: its loopback is its own."""
QUIET_SAMPLES: Final = 4_000
"""Longer than any ramp, and than the finger rests where it turns."""
KEPT_S: Final = 2.0
"""What the device remembers of its output."""
SIMULATED: Final = '{ kind = "simulated", lead_ms = 100.0, finger = { kind = "steady" } }'
BACKENDS: Final = {
    "rig1": f'{{ kind = "simulated_device", address = "{DEVICE}", rig = {SIMULATED} }}'
}
"""With a long lead: it is the network that is torn here, on however busy a machine."""
PORT: Final = 7447
MEMBER: Final = str(Path(__file__).with_name("member.py"))
FRICTUS: Final = "from frictus_service.cli import main; main()"
GET: Final = "import sys, urllib.request as u; print(u.urlopen(sys.argv[1]).read().decode())"
WAIT_S: Final = 60.0


class Member:
    """A client on a host, asked from here."""

    def __init__(self, host: Host, *arguments: str) -> None:
        self.process = host.python(MEMBER, *arguments)

    def answer(self) -> Any:
        assert self.process.stdout is not None
        return json.loads(self.process.stdout.readline())

    def ask(self, *words: object) -> Any:
        assert self.process.stdin is not None
        self.process.stdin.write(" ".join(map(str, words)) + "\n")
        self.process.stdin.flush()
        return self.answer()


class Lab:
    """All of it, running."""

    def __init__(self, net: Star, folder: Path, undo: ExitStack) -> None:
        self.net, self._folder, self._undo = net, folder, undo
        self.router = self._router()
        undo.callback(lambda: _ended(self.router))  # the last to go
        device = self._device(net.hosts["rig1"])
        assert device.stdout is not None
        assert device.stdout.readline().strip() == DEVICE
        with contextlib.suppress(PermissionError):  # hardware waits for no scheduler
            os.sched_setscheduler(device.pid, os.SCHED_FIFO, os.sched_param(30))
        parts = [(net.hosts[rig], "rig") for rig in RIGS] + [(net.hosts["api"], "api")]
        for process in [self._kept(self._start(*part)) for part in parts]:
            _await_ready(process)
        self.owner = self._member("desk", "owner", self._at("desk"), "rig1", str(LEASE_MS))
        self.watcher = self._member("wall", "watcher", self._at("wall"), *RIGS)
        self.gauge = self._member("rig1", "gauge", DEVICE)
        for member in (self.owner, self.watcher, self.gauge):
            assert member.answer() == {"ready": True}

    def _at(self, host: str) -> str:
        return f"tcp/{self.net.hub_address(host)}:{PORT}"

    def _device(self, host: Host) -> "subprocess.Popen[str]":
        module = "frictus_hardware.simulated.device"
        return self._kept(host.python("-m", module, "--address", DEVICE))

    def _member(self, host: str, *arguments: str) -> Member:
        member = Member(self.net.hosts[host], *arguments)
        self._kept(member.process)
        return member

    def _kept(self, process: "subprocess.Popen[str]") -> "subprocess.Popen[str]":
        self._undo.callback(_ended, process)
        return process

    def _start(self, host: Host, part: str) -> "subprocess.Popen[str]":
        endpoint = f"tcp/0.0.0.0:{PORT}" if part == "router" else self._at(host.name)
        file = self._folder / f"{host.name}.toml"
        file.write_text(
            f'rig = "{host.name}"\n'
            f'router.endpoint = "{endpoint}"\n'
            "limits = { freeze_ms = 5000, missed_deadlines = 1000 }\n"
            f'registry.url = "sqlite:///{host.name}.db"\n'
            f"backend = {BACKENDS.get(host.name, SIMULATED)}\n",
            encoding="utf-8",
        )
        command = ("-c", FRICTUS, part, "--config", str(file), "--json")
        return host.python(*command, cwd=self._folder)

    def _router(self) -> "subprocess.Popen[str]":
        process = self._start(self.net.hub, "router")
        _await_ready(process)
        return process

    def restart_router(self) -> None:
        _ended(self.router)
        self.router = self._router()

    def drive(self) -> None:
        """Have the owner arm the first rig, and see it on the wall."""
        _until(lambda: self.owner.ask("arm"), lambda answer: "error" not in answer)
        self.watcher.ask("until_now", "rig1")
        self.watcher.ask("until", "rig1", "driven")

    def rigs_of_api(self) -> list[str]:
        """Return what the API says which rigs are present."""
        command = self.net.hosts["api"].inside(
            sys.executable, "-I", "-c", GET, "http://127.0.0.1:8420/v1/rigs"
        )
        answer = subprocess.run(command, capture_output=True, text=True)
        if answer.returncode:
            return []  # it is not linked just now
        rigs: list[str] = json.loads(answer.stdout)["rigs"]
        return rigs

    def await_rigs_of_api(self, *rigs: str) -> None:
        _until(self.rigs_of_api, lambda found: found == sorted(rigs))

    def quiet_within_the_limit(self, breaks: Callable[[], object]) -> None:
        """Break something; the device of the first rig must be at zero in time."""
        before, began_s = self.gauge.ask("output", 0.1), time.monotonic()
        assert before["armed"]
        breaks()
        took_s = time.monotonic() - began_s
        after = _until(
            lambda: self.gauge.ask("output", KEPT_S),
            lambda output: output["now_sample"] - output["driven_sample"] > QUIET_SAMPLES,
        )
        assert not after["armed"]
        known_sample = before["now_sample"] + (took_s + 1e-3 * LEASE_MS) * RATE_HZ
        assert after["driven_sample"] <= known_sample + LIMIT_S * RATE_HZ

    def all_is_accounted_for(self, rig: str) -> dict[str, Any]:
        """Return what the wall saw of a rig: every block came, or was counted as lost."""
        tally: dict[str, Any] = self.watcher.ask("until_now", rig)
        assert tally["same_run"]
        assert tally["made"] == tally["received"] + tally["lost"]
        assert tally["lost"] == sum(missing for _, missing, _ in tally["gaps"])
        for reason, missing, samples in tally["gaps"]:
            assert reason == "lost"
            assert samples == missing * tally["block_samples"]
        return tally


def _await_ready(process: "subprocess.Popen[str]") -> None:
    assert process.stdout is not None
    said: list[str] = []
    while not said or not said[-1].startswith("ready;"):
        line = process.stdout.readline()
        assert line, f"it ended: {said}"
        said.append(json.loads(line)["text"])


def _ended(process: "subprocess.Popen[str]") -> None:
    process.terminate()  # a supervisor then ends its parts
    try:
        process.communicate(timeout=WAIT_S)
    finally:
        process.kill()


def _until(look: Callable[[], Any], holds: Callable[[Any], bool]) -> Any:
    """Look again and again, for a minute at most, until something holds."""
    deadline_s = time.monotonic() + WAIT_S
    while not holds(found := look()):
        assert time.monotonic() < deadline_s, f"still {found}"
    return found


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Lab]:
    folder = tmp_path_factory.mktemp("hosts")
    with star("rig1", "rig2", "api", "desk", "wall") as net, ExitStack() as undo:
        yield Lab(net, folder, undo)


@pytest.fixture(autouse=True)
def driven(lab: Lab) -> None:
    lab.drive()


def test_owner_that_is_cut_off_loses_its_rig(lab: Lab) -> None:
    before = {rig: lab.all_is_accounted_for(rig)["lost"] for rig in RIGS}
    lab.quiet_within_the_limit(lambda: lab.net.cut("desk"))
    lab.watcher.ask("status", "rig1", "disarmed")
    lab.net.heal("desk")
    assert lab.owner.ask("wait_lost")["lost"]
    lab.drive()
    for rig in RIGS:
        assert lab.all_is_accounted_for(rig)["lost"] == before[rig], "nobody else noticed"


def test_rig_that_is_cut_off_is_quiet_and_comes_back(lab: Lab) -> None:
    before = {rig: lab.all_is_accounted_for(rig)["lost"] for rig in RIGS}
    lab.quiet_within_the_limit(lambda: lab.net.cut("rig1"))
    lab.await_rigs_of_api("rig2")
    assert lab.owner.ask("wait_lost")["lost"]
    lab.net.heal("rig1")
    lab.watcher.ask("until", "rig1", "gap")
    assert lab.all_is_accounted_for("rig1")["lost"] > before["rig1"]
    assert lab.all_is_accounted_for("rig2")["lost"] == before["rig2"]
    lab.await_rigs_of_api(*RIGS)
    lab.drive()


def test_router_that_is_killed_and_started_again(lab: Lab) -> None:
    before = {rig: lab.all_is_accounted_for(rig)["lost"] for rig in RIGS}
    lab.quiet_within_the_limit(lab.router.kill)
    lab.restart_router()
    for rig in RIGS:
        lab.watcher.ask("until", rig, "gap")
        assert lab.all_is_accounted_for(rig)["lost"] > before[rig]
    assert lab.owner.ask("wait_lost")["lost"]
    lab.await_rigs_of_api(*RIGS)
    lab.drive()


@pytest.mark.parametrize("ahead_s", [30.0, -30.0])
def test_owner_whose_clock_jumps_is_refused_until_it_is_right(lab: Lab, ahead_s: float) -> None:
    refused = lab.watcher.ask("status", "rig1", "armed")["counters"]["refused_commands"]
    lab.quiet_within_the_limit(lambda: lab.owner.ask("set_clock", ahead_s))
    status = lab.watcher.ask("status", "rig1", "disarmed")
    assert status["counters"]["refused_commands"] > refused, "each stale renewal is counted"
    assert lab.owner.ask("wait_lost")["lost"]
    assert "clock" in lab.owner.ask("arm")["error"]
    lab.owner.ask("set_clock", 0.0)
    lab.drive()
