"""Python's bytecode, kept at install: a start then reads it instead of compiling sources."""

import py_compile
from collections.abc import Iterable
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import ModuleType


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
