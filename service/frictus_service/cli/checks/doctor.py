"""`frictus doctor`: whether everything is here that the service needs."""

import py_compile
from collections.abc import Iterable
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Annotated

import typer

from frictus_service.cli.options import AsJson, ConfigFile, Exit, RouterOption, write_line

if TYPE_CHECKING:
    from frictus_service.cli.checks.machine_checks import DoctorCheck

COLOUR = {"ok": "green", "warn": "yellow", "fail": "red"}


def keep_bytecode(modules: Iterable[ModuleType]) -> int:
    """Write the bytecode of modules that have none yet; return of how many.

    Python does so itself as it loads them, but not where `PYTHONDONTWRITEBYTECODE` is set, nor
    where whoever runs the service may not write to what somebody else installed.

    Parameters
    ----------
    modules : iterable of module
        Those without a source are left out, and those whose bytecode is newer than it.

    Raises
    ------
    OSError
        If it cannot be written.
    """
    kept = 0
    for module in modules:
        spec = getattr(module, "__spec__", None)
        if spec is None or not isinstance(spec.loader, SourceFileLoader) or not spec.cached:
            continue
        assert spec.origin is not None
        source, cached = Path(spec.origin), Path(spec.cached)
        if cached.exists() and cached.stat().st_mtime >= source.stat().st_mtime:
            continue
        py_compile.compile(spec.origin, spec.cached, doraise=True)
        kept += 1
    return kept


Warm = Annotated[
    bool,
    typer.Option(
        "--warm",
        help="First compile what a service needs, told function by function, so that it "
        "starts at once.",
    ),
]


def doctor(
    config: ConfigFile = None,
    router: RouterOption = None,
    as_json: AsJson = False,
    warm: Warm = False,
) -> None:
    """Check installation, configuration, device, disk, router, rigs, clocks and timer."""
    from frictus_service.cli.checks.service_checks import all_checks

    if warm:
        _compile(as_json)
        _keep_bytecode(as_json)

    worst = "ok"
    for check in all_checks(config, router):
        _write(check, as_json)
        worst = max(worst, check.verdict, key=list(COLOUR).index)
    if worst == "fail":
        raise typer.Exit(Exit.CHECK_FAILED)


def _compile(as_json: bool) -> None:
    """Fill the cache of compiled functions, each of which is kept as soon as it is made."""
    from frictus_service.config import Config
    from frictus_service.daemon.preparation import warm_up
    from frictus_service.daemon.processes.child_process import (
        COMPILING_S,
        StartProgress,
        compiling_told,
    )

    progress = StartProgress()

    def tell(name: str, far: str) -> None:
        progress.move()
        if as_json:
            write_line(event="compiling", function=name)
        elif progress.due(COMPILING_S):
            typer.echo(f"compiling {name}, {far}")

    defaults = Config()  # which rates are rendered makes no difference to what is compiled
    with compiling_told(tell, lambda: None):
        warm_up(defaults.sample_rate_hz, defaults.block_samples)


def _keep_bytecode(as_json: bool) -> None:
    """Keep the bytecode of all that a service loads."""
    import sys

    # What the processes of a service run: to be in `sys.modules`.
    from frictus_service.api import server  # noqa: F401
    from frictus_service.daemon import rig  # noqa: F401
    from frictus_service.recording import recorder  # noqa: F401
    from frictus_service.tracking import process  # noqa: F401

    try:
        told = f"bytecode of {keep_bytecode(tuple(sys.modules.values()))} more modules is kept"
    except OSError as error:
        told = f"bytecode cannot be kept: {error}; run this as who installed the package"
    if as_json:
        write_line(event="bytecode", text=told)
    else:
        typer.echo(told)


def _write(check: "DoctorCheck", as_json: bool) -> None:
    if as_json:
        write_line(
            event="check",
            name=check.name,
            verdict=check.verdict,
            found=check.found,
            to_do=check.to_do,
        )
        return
    from rich.console import Console
    from rich.text import Text

    from frictus.errors import printable

    verdict = (f"{check.verdict:4s} ", f"bold {COLOUR[check.verdict]}")
    line = Text.assemble(verdict, printable(f"{check.name}: {check.found}"))
    if check.to_do:
        line.append(f"\n     {check.to_do}", style="italic")
    Console().print(line, soft_wrap=True)
