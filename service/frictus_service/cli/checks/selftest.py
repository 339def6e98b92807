"""`frictus selftest` and `zero`: whether a rig senses what it plays, and its output to zero."""

import json
import sys
import time
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from frictus_service.cli.options import (
    AsJson,
    ConfigFile,
    Exit,
    check_out,
    wants_lines,
    write_line,
    write_out,
)

if TYPE_CHECKING:
    from frictus_hardware import BackendConfig
    from frictus_service.config import Config
    from frictus_service.selftest.report import Outcome

FORMAT: Final = "selftest/1"
ANSWER_S: Final = 1.0
COLOUR: Final = {"ok": "green", "warn": "yellow", "fail": "red", "skip": "dim"}


def selftest(
    named: Annotated[
        Path | None,
        typer.Argument(metavar="[CONFIG]", help="Configuration, as --config names it."),
    ] = None,
    yes: Annotated[
        bool, typer.Option("--yes", help="Nobody touches the screen: ask nothing.")
    ] = False,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="FILE", help="Write a report, JSON.")
    ] = None,
    config: ConfigFile = None,
    as_json: AsJson = False,
) -> None:
    """Test the configured rig itself: noise, loop-back, step latency, sensors.

    No service may run on it. The output stays within 5 V at the screen.
    """
    from frictus_service.config_file import load
    from frictus_service.selftest.report import worst

    if named is not None and config is not None:
        raise typer.BadParameter("one configuration is tested; name it once")
    loaded = load(named or config)
    lines = wants_lines(as_json)
    interactive = not lines and not yes and sys.stdin.isatty()
    check_out(out)
    begun_utc_ns = time.time_ns()
    done = []
    for outcome in _outcomes(loaded, yes, interactive):
        done.append(outcome)
        show(outcome, lines)
    verdict = worst(outcome.verdict for outcome in done)
    if out is not None:
        report = {
            "format": FORMAT,
            "site": loaded.site,
            "rig": loaded.rig,
            "backend": loaded.backend.model_dump(mode="json", exclude={"authkey"}),
            "begun_utc_ns": begun_utc_ns,
            "verdict": verdict,
            "tests": [asdict(outcome) for outcome in done],
        }
        write_out(out, json.dumps(report, indent=2, allow_nan=False).encode())
    if verdict == "fail":
        raise typer.Exit(Exit.CHECK_FAILED)


def _outcomes(config: "Config", yes: bool, interactive: bool) -> "Iterator[Outcome]":
    from frictus_hardware.errors import HardwareError
    from frictus_service.selftest.report import Outcome
    from frictus_service.selftest.suite import RigUnderTest, run_tests

    simulated = config.backend.kind == "simulated"
    if not simulated and _runs(config):
        found = f"rig {config.rig} at {config.site} is running, and its device is taken"
        yield Outcome("device", "fail", found, "end `frictus serve`, or the rig's unit")
        return
    if not simulated and not yes:
        _require_nobody(interactive)
    try:
        backend = _without_finger(config.backend).make()
        stroked = config.backend.make() if backend.info.simulated else None
    except HardwareError as error:
        yield Outcome("device", "fail", str(error), "correct the configuration")
        return
    if backend.info.backend == "replay":
        found = "a recording that is played as a rig is no rig to be tested"
        yield Outcome("device", "fail", found, "configure another backend")
        return
    rig = RigUnderTest(backend, config.block_samples, stroked)
    yield from run_tests(rig, _ask if interactive else None)


def _runs(config: "Config") -> bool:
    """Return whether the rig is present on the network."""
    import frictus
    from frictus.errors import CertificateError, LinkError

    try:
        tls = config.tls("client")
        with frictus.connect(config.router.endpoint, timeout_s=ANSWER_S, tls=tls) as client:
            return config.rig in [rig.name for rig in client.rigs(config.site)]
    except CertificateError:
        raise
    except LinkError:
        return False  # without a router no rig runs


def _require_nobody(interactive: bool) -> None:
    """Have someone say that nobody touches the screen.

    Raises
    ------
    typer.BadParameter
        If nobody can be asked.
    typer.Exit
        If the answer is no.
    """
    if not interactive:
        raise typer.BadParameter(
            "nobody can be asked whether the screen is free; say so with it", param_hint="--yes"
        )
    from frictus_service.selftest.playing import PEAK_V

    question = f"Up to {PEAK_V:g} V will be on the screen. Does nobody touch it?"
    if not typer.confirm(question):
        raise typer.Exit(Exit.USAGE)


def _ask(request: str) -> bool:
    return typer.confirm(f"{request}. Ready?", default=True)


def _without_finger(backend: "BackendConfig") -> "BackendConfig":
    """Return a simulated rig that nobody touches; a real one as it is."""
    from frictus_hardware import SimulatedConfig, SimulatedDeviceConfig
    from frictus_hardware.simulated.guided import ClientFinger

    away = {"finger": ClientFinger()}
    if isinstance(backend, SimulatedDeviceConfig):
        return backend.model_copy(update={"rig": backend.rig.model_copy(update=away)})
    if isinstance(backend, SimulatedConfig):
        return backend.model_copy(update=away)
    return backend


def show(outcome: "Outcome", lines: bool) -> None:
    """Write an outcome: a JSON line, or what it says with its figures below."""
    if lines:
        write_line(event="test", **asdict(outcome))
        return
    from rich.console import Console
    from rich.text import Text

    verdict = (f"{outcome.verdict:4s} ", f"bold {COLOUR[outcome.verdict]}")
    line = Text.assemble(verdict, f"{outcome.test}: {outcome.found}")
    if outcome.to_do:
        line.append(f"\n     {outcome.to_do}", style="italic")
    for figure in outcome.figures:
        line.append(f"\n     {figure.text}", style="dim")
    Console().print(line, soft_wrap=True)


def zero(config: ConfigFile = None, as_json: AsJson = False) -> None:
    """Reset the configured device, which brings its output to zero; nothing need be running.

    A rig that drives the device loses it, and trips.
    """
    from frictus_service.config_file import load

    backend = load(config).backend
    backend.reset()
    if wants_lines(as_json):
        write_line(event="reset", backend=backend.kind)
    else:
        import typer

        typer.echo(f"the device ({backend.kind}) was reset: its output is zero")
