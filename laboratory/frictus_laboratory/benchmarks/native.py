"""The kernel in C: built with what compiler there is, called through ctypes."""

import ctypes
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from frictus_hardware.arrays import FloatArray
from frictus_service.errors import ServiceError
from frictus_service.synthesis.kernel import BlockMotion, SceneArrays

SOURCE: Final = Path(__file__).with_name("kernel.c")
COMPILERS: Final = ("gcc", "cc", "clang")
OPTIONS: Final = ("-O3", "-std=c99", "-shared", "-fPIC")


class NoCompilerError(ServiceError, RuntimeError):
    """There is no C compiler here, or it fails on the kernel."""


class _Scene(ctypes.Structure):
    _fields_ = [
        ("real", ctypes.c_void_p),
        ("whole", ctypes.c_void_p),
        ("points", ctypes.c_void_p),
        ("levels", ctypes.c_void_p),
        ("pixels", ctypes.c_void_p),
        ("layers", ctypes.c_int64),
        ("bias_n", ctypes.c_double),
    ]


_Motion = ctypes.c_double * 8
_Law = ctypes.c_double * 5


@dataclass(frozen=True, slots=True)
class NativeKernel:
    """The functions of `kernel.c`, with the arguments of `synthesis.kernel`."""

    library: ctypes.CDLL

    def target_friction(
        self,
        scene: SceneArrays,
        motion: BlockMotion,
        first_sample: int,
        sample_rate_hz: float,
        out: FloatArray,
    ) -> None:
        """See `synthesis.kernel.target_friction`."""
        given = _Scene(
            *(array.ctypes.data for array in scene[:5]), scene.real.shape[0], scene.bias_n
        )
        self.library.target_friction(
            ctypes.byref(given),
            _Motion(*motion),
            ctypes.c_int64(first_sample),
            ctypes.c_double(sample_rate_hz),
            ctypes.c_int64(out.size),
            _pointer(out),
        )

    def invert(
        self,
        law: tuple[float, float, float, float, float],
        motion: BlockMotion,
        sample_rate_hz: float,
        friction_n: FloatArray,
        next_n: float,
        out: FloatArray,
    ) -> tuple[int, int]:
        """See `synthesis.kernel.invert`."""
        counts = (ctypes.c_int64 * 2)()
        self.library.invert(
            _Law(*law),
            _Motion(*motion),
            ctypes.c_double(sample_rate_hz),
            _pointer(friction_n),
            ctypes.c_double(next_n),
            ctypes.c_int64(out.size),
            _pointer(out),
            counts,
        )
        return counts[0], counts[1]

    def envelope(self, level: float, goal: float, step: float, drive: FloatArray) -> float:
        """See `synthesis.kernel.envelope`."""
        after: float = self.library.envelope(
            ctypes.c_double(level),
            ctypes.c_double(goal),
            ctypes.c_double(step),
            ctypes.c_int64(drive.size),
            _pointer(drive),
        )
        return after

    def modulate(
        self,
        drive: FloatArray,
        first: int,
        peak_v: float,
        carrier_hz: float,
        sample_rate_hz: float,
        out: FloatArray,
    ) -> None:
        """See `synthesis.kernel.modulate`."""
        self.library.modulate(
            _pointer(drive),
            ctypes.c_int64(first),
            ctypes.c_double(peak_v),
            ctypes.c_double(carrier_hz),
            ctypes.c_double(sample_rate_hz),
            ctypes.c_int64(drive.size),
            _pointer(out),
        )


def _pointer(array: FloatArray) -> Any:
    return ctypes.c_void_p(array.ctypes.data)


@contextmanager
def native_kernel() -> Iterator[NativeKernel]:
    """Build the kernel for as long as the context lasts.

    Raises
    ------
    NoCompilerError
        The text says why there is none.
    """
    compiler = next(filter(None, map(shutil.which, COMPILERS)), None)
    if compiler is None:
        raise NoCompilerError(f"no C compiler on the path: {', '.join(COMPILERS)} looked for")
    # Windows keeps a loaded library from being deleted.
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        library = Path(folder) / "kernel.so"
        command = [compiler, *OPTIONS, str(SOURCE), "-o", str(library), "-lm"]
        try:
            subprocess.run(command, check=True, capture_output=True, text=True, timeout=60.0)
            loaded = ctypes.CDLL(str(library))
        except subprocess.CalledProcessError as error:
            raise NoCompilerError(f"{compiler} fails: {error.stderr.strip()[:500]}") from error
        except (OSError, subprocess.TimeoutExpired) as error:
            raise NoCompilerError(f"{compiler}: {error}") from error
        loaded.envelope.restype = ctypes.c_double
        for name in ("target_friction", "invert", "modulate"):
            getattr(loaded, name).restype = None
        yield NativeKernel(loaded)
