"""What importing and leaving costs, and whether everything public is documented."""

import importlib
import inspect
import pkgutil
import re
import subprocess
import sys
from collections.abc import Iterator
from typing import Any

import pytest
from pydantic import BaseModel

import frictus

SERVER = (
    "fastapi scipy uvicorn websockets numba matplotlib typer rich starlette prometheus_client "
    "frictus_service frictus_hardware"
).split()


def run(program: str) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(
        [sys.executable, "-W", "error", "-c", program],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )


def test_the_client_loads_no_server_package() -> None:
    names = [module.name for module in pkgutil.iter_modules(frictus.__path__, "frictus.")]
    imports = "\n".join(f"import {name}" for name in ["frictus", *names])
    loaded = f"[name for name in {SERVER} if name in sys.modules]"
    result = run(f"import sys\n{imports}\nassert not {loaded}, {loaded}")
    assert result.returncode == 0, result.stderr


@pytest.mark.parametrize("leave", ["client.close()", "pass", "raise SystemExit(0)"])
def test_a_program_that_receives_ends_cleanly(router: str, fake: Any, leave: str) -> None:
    program = f"""
import frictus
client = frictus.connect({router!r})
rig = client.rig("sim")
rig.arm()
feed, fingers, presence = rig.blocks("force"), rig.fingers(), client.presence()
print(rig.status().rig)
{leave}
"""
    result = run(program)
    assert (result.returncode, result.stdout, result.stderr) == (0, "sim\n", "")
    fake.asked("arm")
    fake.asked("disarm")


def test_everything_in_all_exists() -> None:
    for module in pkgutil.walk_packages(frictus.__path__, "frictus."):
        loaded = importlib.import_module(module.name)
        named = getattr(loaded, "__all__", ())
        assert [name for name in named if not hasattr(loaded, name)] == [], module.name
    for name in frictus.__all__:
        assert hasattr(frictus, name), name
    assert list(frictus.__all__) == sorted(
        frictus.__all__, key=lambda name: (not name.isupper(), name[0].islower(), name)
    )


def is_protocol(member: type) -> bool:
    return bool(getattr(member, "_is_protocol", False))


def public() -> Iterator[tuple[str, Any]]:
    for module_info in pkgutil.iter_modules(frictus.__path__, "frictus."):
        module = importlib.import_module(module_info.name)
        yield module.__name__, module
        for name, member in vars(module).items():
            if name.startswith("_") or getattr(member, "__module__", None) != module.__name__:
                continue
            if inspect.isclass(member) or inspect.isfunction(member):
                yield f"{module.__name__}.{name}", member


def functions() -> Iterator[tuple[str, Any, str]]:
    """Yield name, function and the text that must name its parameters."""
    for name, member in public():
        if inspect.isfunction(member):
            yield name, member, member.__doc__ or ""
        elif inspect.isclass(member):
            document = member.__doc__ or ""
            made_elsewhere = issubclass(member, BaseModel | tuple) or is_protocol(member)
            if "__init__" in vars(member) and not made_elsewhere:
                yield f"{name}.__init__", member.__init__, document
            for part, method in vars(member).items():
                method = getattr(method, "__func__", method)
                if inspect.isfunction(method) and not part.startswith("_"):
                    yield f"{name}.{part}", method, method.__doc__ or ""


@pytest.mark.parametrize(
    ("name", "member"), [pytest.param(*each, id=each[0]) for each in public()]
)
def test_everything_public_has_a_docstring(name: str, member: Any) -> None:
    assert (member.__doc__ or "").strip(), name


@pytest.mark.parametrize(
    ("name", "function", "document"), [pytest.param(*each, id=each[0]) for each in functions()]
)
def test_every_parameter_is_documented(name: str, function: Any, document: str) -> None:
    assert document.strip(), name
    for parameter in inspect.signature(function).parameters:
        entry = rf"^\s*([\w*]+, )*\**{parameter}(, [\w*]+)*( :|$)"
        if parameter not in ("self", "cls"):
            assert re.search(entry, document, re.MULTILINE), f"{name}: {parameter}"
