"""A stub of NI's driver library, compiled for the run, and a rig that calls it directly."""

import ctypes
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import nidaqmx._lib
import pytest
from tests.hardware.nidaq.bench import FingerTouch, conversion, wiring

from frictus_hardware.nidaq.backend import NiRig
from frictus_hardware.simulated.config import SimulatedConfig

SOURCE = Path(__file__).with_suffix(".c")


class StubDriver:
    """The library's side door."""

    def __init__(self, path: Path) -> None:
        self._library = ctypes.CDLL(str(path))
        self._library.stub_output_v.restype = ctypes.c_double

    @property
    def output_v(self) -> float:
        """What the device puts out."""
        return float(self._library.stub_output_v())

    def plan(self, code: int, at_sample: int) -> None:
        """Let the first call that may fail from a sample on fail."""
        self._library.stub_fail(code, at_sample)


@contextmanager
def installed(folder: Path) -> Iterator[StubDriver]:
    """Have nidaqmx find the stub; skip where it cannot be made."""
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None or not sys.platform.startswith("linux"):
        pytest.skip("the stub driver needs a C compiler on Linux")
    path = folder / "libnidaqmx.so"
    command = [compiler, "-O1", "-shared", "-fPIC", "-o", str(path), str(SOURCE)]
    subprocess.run(command, check=True)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(nidaqmx._lib, "find_library", lambda _: str(path))
        forget_driver(patch)
        yield StubDriver(path)


def forget_driver(patch: pytest.MonkeyPatch) -> None:
    """Have nidaqmx look for the driver anew."""
    patch.setattr(nidaqmx._lib.lib_importer, "_windll", None)
    patch.setattr(nidaqmx._lib.lib_importer, "_cdll", None)


def make_local_rig() -> NiRig:
    """Return a rig that calls the driver of this machine."""
    config = wiring()
    return NiRig(config, conversion(config), FingerTouch(SimulatedConfig()))
