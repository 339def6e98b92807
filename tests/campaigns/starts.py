"""Starts on what is torn, taken, full or too small: `python -m tests.campaigns.starts --help`.

`frictus serve` runs on a copy of a folder in which a service has worked, after something was
done to it. It must either serve, so that a client can arm, or end with a sentence and a code
that programs may rely on; and it must start once the fault is gone.
"""

import contextlib
import json
import os
import random
import shutil
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from tests.campaigns.lines import Line, asked, go_on
from tests.campaigns.service import START_S, Said, http_status, make_certificates, publish

import frictus
from frictus.errors import FrictusError
from frictus_service.config import Config
from frictus_service.config_file import load
from frictus_service.processes import free_port

MAIN: Final = "from frictus_service.cli import main; main()"
LIMITED: Final = f"""
import resource, sys
limit = getattr(resource, sys.argv.pop(1))
most = int(sys.argv.pop(1))
resource.setrlimit(limit, (most, most))
{MAIN}
"""
CLOCK: Final = Path(__file__).with_name("stepped_clock.c")
COMPILER: Final = shutil.which("cc") or shutil.which("gcc")
READY: Final = "ready; Ctrl-C stops"
TYPED: Final = (1, 2, 3, 4)
"""Exit codes of a service that did not start and said why; 1 is a part's that did not."""
STOP_S: Final = 30.0
RECORD_S: Final = 6.0
STEP_S: Final = 3_600


@dataclass
class Setting:
    """How `frictus serve` is run on a folder, and what is tried once it runs."""

    folder: Path
    script: str = MAIN
    before: list[str] = field(default_factory=list)
    arguments: list[str] = field(default_factory=list)
    environment: dict[str, str] = field(default_factory=dict)
    must_serve: bool = True
    """False where to refuse is right too."""
    keep: contextlib.ExitStack = field(default_factory=contextlib.ExitStack)
    trial: "Callable[[Served], list[str]]" = lambda _served: []


@dataclass
class Served:
    """A `frictus serve` that runs."""

    process: "subprocess.Popen[str]"
    said: Said
    config: Config
    folder: Path

    @property
    def ready(self) -> bool:
        """Whether it has said so."""
        return READY in self.said.lines


Break = Callable[[Setting, random.Random], None]


def config_text(api_port: int, router_port: int) -> str:
    """Return a configuration at two ports."""
    return (
        f'[router]\nendpoint = "tcp/127.0.0.1:{router_port}"\n\n[api]\nport = {api_port}\n\n'
        '[backend]\nkind = "simulated"\nfinger = { kind = "steady" }\n'
    )


@contextlib.contextmanager
def serve(setting: Setting) -> Iterator[Served]:
    """Run `frictus serve` until it is ready or has ended; end it with the context."""
    file = setting.folder / "frictus.toml"
    command = [*setting.before, sys.executable, "-c", setting.script, *setting.arguments]
    said = Said()
    with subprocess.Popen(
        [*command, "serve", "--config", str(file)],
        stderr=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        text=True,
        cwd=setting.folder,
        env=os.environ | setting.environment,
    ) as process:

        def listen() -> None:
            assert process.stderr is not None
            for line in process.stderr:
                said(line.rstrip("\n"))
            said("")  # wakes whoever waits: it has ended

        listener = threading.Thread(target=listen)
        listener.start()
        try:
            said.await_line(lambda line: line in (READY, ""), START_S)
            config = load(file) if READY in said.lines else Config()
            yield Served(process, said, config, setting.folder)
        finally:
            process.send_signal(signal.SIGINT)
            try:
                process.wait(STOP_S)
            except subprocess.TimeoutExpired:
                process.kill()
            listener.join()


def judge(setting: Setting) -> tuple[str, list[str]]:
    """Serve, and return what came of it and what was wrong with that."""
    with serve(setting) as served:
        if not served.ready:
            code = served.process.wait(STOP_S)
            why = next((line for line in reversed(served.said.lines) if line), "")
            wrong = [] if code in TYPED else [f"exit code {code}"]
            told = "\n".join(served.said.lines)
            wrong += [told[told.index("Traceback") :]] if "Traceback" in told else []
            wrong += [why] if setting.must_serve or "unexpected" in why else []
            return f"refused ({code}): {why}"[:300], wrong
        wrong = [
            f"the API answers {path} with {status}"
            for path in ("/v1/ready", "/v1/rigs")
            if (status := http_status(served.config, path)) != 200
        ]
        try:
            wrong += setting.trial(served)
        except FrictusError as error:
            wrong.append(f"{type(error).__name__}: {error}; {served.said.lines[-3:]}")
        wrong += _arm(served.config)
        wrong += [line for line in served.said.lines if " process ended" in line]
    return "served", wrong


def _arm(config: Config) -> list[str]:
    """Arm and disarm; return what was wrong."""
    try:
        with frictus.connect(
            config.router.endpoint, name="starter", tls=config.tls("client")
        ) as client:
            rig = client.rig(config.rig, config.site)
            if rig.status().state == "tripped":  # a machine too busy for it
                rig.reset()
            with rig.arm():
                pass
    except FrictusError as error:
        return [f"cannot be armed: {type(error).__name__}: {error}"]
    return []


def make_template(folder: Path) -> None:
    """Have a service work in a folder: a model, a texture, a recording."""
    folder.mkdir()
    (folder / "frictus.toml").write_text(config_text(free_port(), free_port()))
    with serve(Setting(folder)) as served:
        if not served.ready:
            raise RuntimeError(f"the service does not start: {served.said.lines}")
        publish(served.config)
        with frictus.connect(served.config.router.endpoint) as client:
            rig = client.rig(served.config.rig)
            rig.record("whole")
            time.sleep(1.0)
            rig.end_recording()


def _torn(pattern: str, must_serve: bool = True) -> Break:
    def tear(setting: Setting, rng: random.Random) -> None:
        setting.must_serve = must_serve
        for file in sorted(setting.folder.glob(pattern)):
            content = bytearray(file.read_bytes())
            way = rng.choice(["cut", "empty", "flipped", "zeros"])
            if way == "flipped" and content:
                for _ in range(20):
                    content[rng.randrange(len(content))] ^= 1 << rng.randrange(8)
            kept = {"cut": rng.randrange(len(content) + 1), "empty": 0}.get(way, len(content))
            whole = bytes(len(content)) if way == "zeros" else bytes(content)
            file.write_bytes(whole[:kept])

    return tear


def _certificates(setting: Setting, rng: random.Random) -> None:
    section = make_certificates(setting.folder).section
    file = setting.folder / "frictus.toml"
    keys = {name: str(path) for name, path in section if path is not None}
    lines = "".join(f"{name} = {json.dumps(value)}\n" for name, value in keys.items())
    file.write_text(file.read_text().replace("tcp/", "tls/") + f"\n[security]\n{lines}")
    whose = rng.choice(["authority", "router", "rig", "client"])
    torn = Path(keys[whose])
    torn = rng.choice([torn, torn.with_suffix(".key")]) if whose != "authority" else torn
    torn.write_bytes(torn.read_bytes()[: rng.randrange(100)])
    setting.must_serve = False


def _taken(which: str) -> Break:
    def take(setting: Setting, _rng: random.Random) -> None:
        config = load(setting.folder / "frictus.toml")
        of_router = int(config.router.endpoint.rsplit(":", 1)[1])
        listener = setting.keep.enter_context(socket.socket())
        listener.bind(("127.0.0.1", of_router if which == "router" else config.api.port))
        listener.listen()
        setting.must_serve = False

    return take


def _limited(limit: str, most: int, must_serve: bool, trial: Any = None) -> Break:
    def restrict(setting: Setting, _rng: random.Random) -> None:
        setting.script, setting.arguments = LIMITED, [limit, str(most)]
        setting.must_serve = must_serve
        setting.trial = trial or setting.trial

    return restrict


def _mounted(script: str, must_serve: bool, trial: Any = None) -> Break:
    """Run it where a folder is mounted otherwise, seen by nobody else."""

    def mount(setting: Setting, _rng: random.Random) -> None:
        inside = f'{script} && exec "$@"'
        folder = str(setting.folder)
        setting.before = ["unshare", "-m", "env", f"F={folder}", "sh", "-c", inside, "sh"]
        setting.must_serve = must_serve
        setting.trial = trial or setting.trial

    return mount


def _two_services(setting: Setting, _rng: random.Random) -> None:
    """Have another service work in the same folder, at ports of its own."""
    other = setting.folder / "other.toml"
    other.write_text(config_text(free_port(), free_port()))
    first = setting.folder / "frictus.toml"
    mine = first.read_text()
    first.write_text(other.read_text())
    served = setting.keep.enter_context(serve(Setting(setting.folder)))
    first.write_text(mine)

    def trial(second: Served) -> list[str]:
        statuses = [publish(each.config)[0] for each in (served, second) for _ in range(5)]
        return [f"publishing: {status}" for status in statuses if status != 201]

    setting.trial = trial
    setting.must_serve = False


def _record_until_full(served: Served) -> list[str]:
    """Record until nothing more can be written: it must be said, and stop nothing else."""
    config, wrong = served.config, []
    try:
        with frictus.connect(config.router.endpoint, name="writer") as client:
            rig = client.rig(config.rig, config.site)
            rig.record("full")
            until_s = time.monotonic() + RECORD_S * 4
            while (state := rig.recording()).recording and time.monotonic() < until_s:
                time.sleep(0.2)
            if state.recording or not state.problem:
                wrong.append(f"the recorder does not tell: {state}")
    except FrictusError as error:
        if "written" not in str(error):
            wrong.append(f"record: {type(error).__name__}: {error}")
    for _ in range(3):
        if (status := publish(config)[0]) not in (201, 503, 507):
            wrong.append(f"publishing where nothing can be written: {status}")
    return wrong


def _step_clock(served: Served) -> list[str]:
    """Step the service's UTC while armed; whoever keeps the true time loses the rig, safely."""
    wrong: list[str] = []
    config = served.config
    file = served.folder / "step"
    with frictus.connect(config.router.endpoint, name="stepper") as client:
        rig = client.rig(config.rig, config.site)
        for step_s in (STEP_S, -STEP_S):
            with contextlib.suppress(FrictusError), rig.arm() as lease:
                _step(file, step_s)
                if not lease.wait_lost(10.0):
                    wrong.append(f"a lease outlived a step of {step_s} s")
            _step(file, 0)
            status = rig.status()
            if status.fault is not None and "late" not in status.fault.reason:
                wrong.append(f"a step of {step_s} s: {status.fault.reason}")
            if not _can_be_armed(config):
                wrong.append(f"cannot be armed after a step of {step_s} s and back")
    return wrong


def _can_be_armed(config: Config) -> bool:
    until_s = time.monotonic() + 10.0
    while time.monotonic() < until_s:
        if not _arm(config):
            return True
    return False


def _step(file: Path, step_s: int) -> None:
    """Set how far the clock is off; in place, since whoever is stepped has mapped the file."""
    with file.open("r+b") as opened:
        opened.write(struct.pack("=q", step_s))


def _clock(setting: Setting, _rng: random.Random) -> None:
    """Give the service a clock of its own; libfaketime would disturb its monotonic waits."""
    library, file = setting.folder / "clock.so", setting.folder / "step"
    assert COMPILER is not None
    subprocess.run([COMPILER, "-shared", "-fPIC", "-o", library, CLOCK], check=True)
    file.write_bytes(bytes(8))
    setting.environment = {"LD_PRELOAD": str(library), "CLOCK_STEP_FILE": str(file)}
    setting.trial = _step_clock


FAULTS: Final[dict[str, Break]] = {
    "torn database": _torn("*.db"),
    "torn recording": _torn("recordings/*"),
    "torn configuration": _torn("frictus.toml", must_serve=False),
    "torn certificate": _certificates,
    "port of the router in use": _taken("router"),
    "port of the API in use": _taken("api"),
    "two services in one folder": _two_services,
    "64 descriptors": _limited("RLIMIT_NOFILE", 64, must_serve=False),
    "1 GB of addresses": _limited("RLIMIT_AS", 10**9, must_serve=False),
    "files of 500 kB": _limited("RLIMIT_FSIZE", 500_000, True, _record_until_full),
    "full disk for recordings": _mounted(
        'mount -t tmpfs -o size=600k tmpfs "$F/recordings"', True, _record_until_full
    ),
    "full disk": _mounted(
        'cp -a "$F" "$F.kept" && mount -t tmpfs -o size=2m tmpfs "$F" && cp -a "$F.kept/." "$F"'
        ' && rm -r "$F.kept" && cd "$F"',
        True,
        _record_until_full,
    ),
    "read-only folder": _mounted(
        'mount --bind "$F" "$F" && mount -o remount,ro,bind "$F" && cd "$F"', False
    ),
    "clock steps of an hour": _clock,
}


def names(repeats: int) -> list[str]:
    """Return the names of so many starts on each fault."""
    return [f"{fault}/{number}" for number in range(repeats) for fault in FAULTS]


def impossible(name: str) -> str:
    """Return why a fault cannot be made on this machine; empty where it can."""
    if sys.platform == "win32" and name.split()[0] in ("64", "1", "files"):
        return "Windows has no such limits"
    if FAULTS[name].__qualname__.startswith("_mounted"):
        test = ["unshare", "-m", "true"]
        if shutil.which("unshare") is None or subprocess.run(test, check=False).returncode != 0:
            return "no mounts of one's own: needs Linux and root"
    if name.startswith("clock") and (COMPILER is None or sys.platform != "linux"):
        return "a clock of one's own needs Linux and a C compiler"
    return ""


class Campaign:
    """Starts on copies of one folder."""

    def __init__(self) -> None:
        self._stack = contextlib.ExitStack()
        self._template: Path | None = None

    def run(self, name: str, seed: int) -> Line:
        """Return the line of a start."""
        fault = name.rsplit("/", 1)[0]
        why_not = impossible(fault)
        if why_not:
            return {"came": f"skipped: {why_not}", "failures": []}
        if self._template is None:
            folder = Path(self._stack.enter_context(tempfile.TemporaryDirectory()))
            make_template(folder / "template")
            self._template = folder / "template"
        began_s = time.monotonic()
        folder = self._template.with_name("broken")
        text = config_text(free_port(), free_port())

        def renew() -> Setting:
            shutil.rmtree(folder, ignore_errors=True)
            assert self._template is not None
            shutil.copytree(self._template, folder)
            (folder / "frictus.toml").write_text(text)
            return Setting(folder)

        setting = renew()
        with setting.keep:
            FAULTS[fault](setting, random.Random(seed))
            came, wrong = judge(setting)
        if came != "served":
            again, wrong_again = judge(renew())
            wrong += [f"afterwards: {what}" for what in wrong_again]
            came += f"; then {again}"
        seconds = round(time.monotonic() - began_s, 2)
        return {
            "came": came,
            "seconds": seconds,
            "failures": [{"what": each} for each in wrong],
        }

    def close(self) -> None:
        """Remove the folders."""
        self._stack.close()


def main() -> None:
    """Run the campaign, or a part of it."""
    wanted = asked(__doc__, "repeats", 5, "of each fault", names)
    campaign = Campaign()
    with contextlib.closing(campaign):
        for line in go_on(*wanted, campaign.run):
            wrong = [failure["what"][:300] for failure in line["failures"]]
            print(line["name"], line["seed"], line["came"], *wrong, sep="\n  ", flush=True)  # noqa: T201


if __name__ == "__main__":
    main()
