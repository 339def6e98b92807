"""The checks of `frictus doctor`: what was found, and what to do about it."""

import importlib.metadata
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

import frictus
from frictus.errors import CertificateError, LinkError
from frictus_service.config import Config, SecurityConfig, load
from frictus_service.errors import ConfigurationError

Verdict = Literal["ok", "warn", "fail"]

NEEDED: Final = (
    "eclipse-zenoh",
    "numpy",
    "pydantic",
    "fastapi",
    "uvicorn",
    "numba",
    "scipy",
    "prometheus-client",
    "rich",
    "typer",
)
CLOCK_NS: Final = 100_000
"""A clock that steps in more than this cannot time 5 ms blocks well."""
ANSWER_S: Final = 1.0
LATE_MS: Final = (2.0, 20.0)
"""Lateness of a 5 ms timer at which to warn, and at which the loop must fail."""


@dataclass(frozen=True, slots=True)
class Check:
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


def all_checks(config_file: Path | None, router: str | None) -> Iterator[Check]:
    """Make every check, one after another."""
    yield python_version()
    yield packages()
    yield compiler_cache()
    config, found = configuration(config_file)
    yield found
    if config is not None:
        yield library_folder(config.textures)
    settings = config or Config()
    yield from router_and_rigs(router or settings.router.endpoint, settings.security)
    yield clock_resolution()
    yield timer_lateness()


def python_version() -> Check:
    """Look at the interpreter."""
    return Check("python", "ok", f"{sys.version.split()[0]} on {sys.platform}")


def packages(needed: tuple[str, ...] = NEEDED) -> Check:
    """Look for the packages that the service needs."""
    missing = []
    for name in needed:
        try:
            importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            missing.append(name)
    if missing:
        to_do = "pip install 'frictus[service]'"
        return Check("packages", "fail", f"missing: {', '.join(missing)}", to_do)
    return Check("packages", "ok", f"all {len(needed)} are installed")


def compiler_cache() -> Check:
    """See whether compiled code can be kept: without, every start takes seconds longer."""
    from frictus_service.synthesis.kernel import target_friction

    folder = Path(str(target_friction.stats.cache_path))
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        to_do = "set NUMBA_CACHE_DIR to a folder that can be written"
        return Check("compiled code", "warn", f"{folder} cannot be written: {error}", to_do)
    return Check("compiled code", "ok", f"is kept in {folder}")


def configuration(path: Path | None) -> tuple[Config | None, Check]:
    """Read the configuration; None if it cannot be used."""
    try:
        config = load(path)
    except ConfigurationError as error:
        return None, Check("configuration", "fail", str(error), "correct the lines named")
    where = path or "frictus.toml or the defaults"
    return config, Check("configuration", "ok", f"{where}: rig {config.rig} at {config.site}")


def library_folder(folder: Path) -> Check:
    """See whether the texture library can be read, file by file."""
    from frictus_service.library import DamagedTextureError, TextureLibrary

    library = TextureLibrary(folder)
    damaged = []
    names = library.names()
    for name in names:
        try:
            library.get(name)
        except DamagedTextureError:
            damaged.append(name)
    if damaged:
        found = f"{len(damaged)} of {len(names)} files are damaged: {', '.join(damaged)}"
        return Check("textures", "warn", found, f"replace or delete them in {folder}")
    return Check("textures", "ok", f"{len(names)} in the library, those shipped among them")


def router_and_rigs(endpoint: str, security: SecurityConfig | None = None) -> Iterator[Check]:
    """Look for the router, and for rigs behind it."""
    try:
        tls = None if security is None else security.of("client")
        with frictus.connect(endpoint, timeout_s=ANSWER_S, tls=tls) as client:
            yield Check("router", "ok", f"answers at {endpoint}")
            rigs = client.rigs()
            for rig in rigs:
                yield _rig(client, rig)
    except (CertificateError, ConfigurationError) as error:
        yield Check("router", "fail", str(error), "see docs/security.md")
        return
    except LinkError as error:
        yield Check("router", "warn", str(error), "start `frictus serve`, or name its --router")
        return
    if not rigs:
        to_do = "start `frictus serve` or `frictus rig`"
        yield Check("rigs", "warn", "none is present", to_do)


def _rig(client: frictus.Client, which: frictus.RigName) -> Check:
    name = f"rig {which.name} at {which.site}"
    try:
        status = client.rig(which.name, which.site).status()
    except (frictus.FrictusError, OSError) as error:
        return Check(name, "fail", str(error), "look at the output of its `frictus serve`")
    found = f"{status.state}, {status.backend}, version {status.version}"
    if status.fault is not None:
        return Check(name, "fail", f"{found}: {status.fault.reason}", status.fault.action)
    if status.model_placeholder:
        to_do = "measure and set a model; until then friction is not true to scale"
        return Check(name, "warn", f"{found}, with a placeholder model", to_do)
    return Check(name, "ok", found)


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
