"""What is installed, and what is configured."""

import importlib.metadata
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from frictus_service.cli.checks.check import Check
from frictus_service.config import Config, load
from frictus_service.errors import ConfigurationError

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


def rig_files(config: Config) -> Iterator[Check]:
    """See whether the files are here that the rig is made from, where it runs here."""
    for key, file in config.rig_files.items():
        if not file.is_file():
            dotted = ".".join(map(str, key))
            to_do = "put it there, or correct the key, where the rig runs on this machine"
            yield Check("rig files", "warn", f"{dotted}: there is no file {file}", to_do)


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
