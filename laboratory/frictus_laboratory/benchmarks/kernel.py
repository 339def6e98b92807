"""How fast the kernel renders, beside the same algorithm in C."""

import ctypes
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any, Final

import numpy as np

from frictus.textures import Region, Scene
from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.friction import FrictionLaw
from frictus_hardware.physics.screen import Screen
from frictus_laboratory.benchmarks.figure import Figure, Target, interleaved, skipped
from frictus_service.errors import ServiceError
from frictus_service.library import SHIPPED, TextureLibrary
from frictus_service.synthesis import kernel
from frictus_service.synthesis.compensator import law_tuple
from frictus_service.synthesis.estimator import PredictedMotion
from frictus_service.synthesis.kernel import BlockMotion, SceneArrays
from frictus_service.synthesis.renderer import RAMP_S, Renderer
from frictus_service.synthesis.scene import CompiledScene, compile_scene

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


RATE_HZ: Final = 20_000.0
BLOCK_SAMPLES: Final = 100
SPAN_SAMPLES: Final = 10_000
"""Half a second: what a call costs no longer matters."""
TEXTURE: Final = "vinyl"
SCREEN: Final = Screen()
LAW: Final = FrictionLaw()
LAW_TUPLE: Final = law_tuple(LAW)
RAMP_STEP: Final = 1.0 / (RAMP_S * RATE_HZ)
AGREEMENT_V: Final = 1e-9
"""Largest difference from C that is accepted, volts at the screen."""


class DisagreementError(ServiceError, ArithmeticError):
    """The kernel and its counterpart in C render different volts."""


class Pass:
    """The kernel's four functions over a stretch of motion, as the renderer calls them.

    Parameters
    ----------
    functions : module or NativeKernel
        `synthesis.kernel`, or its counterpart in C.
    scene : CompiledScene
        The texture as tables.
    samples : int
        Length of the stretch.

    Attributes
    ----------
    voltage_v : ndarray, shape (samples,)
    """

    def __init__(
        self, functions: ModuleType | NativeKernel, scene: CompiledScene, samples: int
    ) -> None:
        self.samples = samples
        self.voltage_v = np.zeros(samples)
        self._functions = functions
        self._arrays = scene.arrays
        self._target = np.zeros(samples + 1)
        self._drive = np.zeros(samples)
        self._level = 0.0

    def render(self, motion: BlockMotion, first_sample: int) -> None:
        """Write the volts of a stretch to `voltage_v`."""
        for step in self.steps(motion, first_sample).values():
            step()

    def steps(self, motion: BlockMotion, first_sample: int) -> dict[str, Callable[[], Any]]:
        """Return what `render` does, by name and in order."""
        call, target, drive = self._functions, self._target, self._drive

        def ramp() -> None:
            self._level = call.envelope(self._level, 1.0, RAMP_STEP, drive)

        return {
            "target_friction": lambda: call.target_friction(
                self._arrays, motion, first_sample, RATE_HZ, target
            ),
            "invert": lambda: call.invert(
                LAW_TUPLE, motion, RATE_HZ, target[:-1], float(target[-1]), drive
            ),
            "envelope": ramp,
            "modulate": lambda: call.modulate(
                drive, first_sample, SCREEN.peak_v, SCREEN.carrier_hz, RATE_HZ, self.voltage_v
            ),
        }


def shipped_scene() -> CompiledScene:
    """Return a scene of one region with a shipped texture."""
    texture = TextureLibrary(SHIPPED).get(TEXTURE).texture
    return compile_scene(Scene(regions=[Region(texture=texture)]), LAW, SCREEN, RATE_HZ)


def strokes(stretches: int, samples: int) -> list[BlockMotion]:
    """Return stretches of strokes across the screen and back, 30 to 90 mm/s."""
    time_s = samples / RATE_HZ * np.arange(stretches + 1)
    x_mm = 35.0 - 15.0 * np.cos(2.0 * time_s)
    vx = 60.0 + 30.0 * np.sin(5.0 * time_s)
    return [
        BlockMotion(x, 17.0, v0, 0.0, v1, 0.0, v0, v1)
        for x, v0, v1 in zip(x_mm[:-1].tolist(), vx[:-1].tolist(), vx[1:].tolist(), strict=True)
    ]


def require_agreement(one: Pass, other: Pass, motions: list[BlockMotion]) -> None:
    """Compare two passes, stretch by stretch.

    Raises
    ------
    DisagreementError
        If they differ by more than `AGREEMENT_V` anywhere.
    """
    for number, motion in enumerate(motions):
        one.render(motion, number * one.samples)
        other.render(motion, number * one.samples)
        apart = float(np.abs(one.voltage_v - other.voltage_v).max())
        if not apart <= AGREEMENT_V:
            raise DisagreementError(
                f"the kernel and kernel.c render volts that are {apart:.3g} V apart, "
                f"{AGREEMENT_V:g} V is accepted: bring kernel.c up to date"
            )


def measure(repeats: int = 31) -> list[Figure]:
    """Return the figures `kernel`, `kernel_functions` and `render_block`.

    Parameters
    ----------
    repeats : int
        Timings of each contender.

    Raises
    ------
    DisagreementError
        If C renders something else.
    """
    scene = shipped_scene()
    ours = Pass(kernel, scene, SPAN_SAMPLES)
    native: Pass | None = None
    why = ""
    with ExitStack() as stack:
        try:
            library = stack.enter_context(native_kernel())
        except NoCompilerError as error:
            why = f"not compared with C: {error}"
        else:
            native = Pass(library, scene, SPAN_SAMPLES)
            require_agreement(ours, native, strokes(3, SPAN_SAMPLES))
            short = [Pass(functions, scene, BLOCK_SAMPLES) for functions in (kernel, library)]
            require_agreement(short[0], short[1], strokes(50, BLOCK_SAMPLES))
        return [
            _whole(ours, native, repeats, why),
            _functions(ours, native, repeats, why),
            _block(scene, native, repeats, why),
        ]


def _timed_s(call: Callable[[], Any]) -> Callable[[], float]:
    def timed() -> float:
        begun = time.perf_counter()
        call()
        return time.perf_counter() - begun

    return timed


def _rendering(run: Pass) -> Callable[[], float]:
    (motion,) = strokes(1, run.samples)
    return _timed_s(lambda: run.render(motion, 0))


def _whole(ours: Pass, native: Pass | None, repeats: int, why: str) -> Figure:
    contenders = [_rendering(run) for run in (ours, native) if run is not None]
    taken_s = interleaved(repeats, *contenders)
    per_s = [SPAN_SAMPLES / seconds for seconds in taken_s]
    return Figure(
        "kernel",
        "samples/s",
        {"numba": per_s[0]},
        {"c": per_s[1]} if native else {},
        taken_s[0] / taken_s[1] if native else None,
        Target("ratio", "at most", 1.5),
        why or f"texture {TEXTURE!r}, {SPAN_SAMPLES} samples a call; ratio: time over C's",
    )


def _functions(ours: Pass, native: Pass | None, repeats: int, why: str) -> Figure:
    if native is None:
        return skipped("kernel_functions", "ns/sample", why)
    (motion,) = strokes(1, SPAN_SAMPLES)
    value, beside = {}, {}
    for name, step in ours.steps(motion, 0).items():
        in_c = native.steps(motion, 0)[name]
        taken_s = interleaved(repeats, _timed_s(step), _timed_s(in_c))
        value[name], beside[name] = (1e9 * seconds / SPAN_SAMPLES for seconds in taken_s)
    worst = max(value[name] / beside[name] for name in value)
    remark = "where the time goes, beside C; ratio: of the function that fares worst"
    return Figure("kernel_functions", "ns/sample", value, beside, worst, remark=remark)


def _block(scene: CompiledScene, native: Pass | None, repeats: int, why: str) -> Figure:
    renderer = Renderer(LAW, SCREEN, RATE_HZ, BLOCK_SAMPLES, scene)
    courses = [PredictedMotion(motion) for motion in strokes(100, BLOCK_SAMPLES)]

    def render() -> None:
        for number, course in enumerate(courses):
            renderer.render(number * BLOCK_SAMPLES, course, True)

    contenders = [_timed_s(render), *([_rendering(native)] if native else [])]
    taken_s = interleaved(repeats, *contenders)
    ours_us = 1e6 * taken_s[0] / len(courses)
    bare_us = 1e6 * taken_s[1] * BLOCK_SAMPLES / SPAN_SAMPLES if native else None
    return Figure(
        "render_block",
        "us/block",
        {"renderer": ours_us},
        {} if bare_us is None else {"c": bare_us},
        None if bare_us is None else ours_us / bare_us,
        remark=why
        or f"the renderer as the loop calls it, {BLOCK_SAMPLES} samples a block, beside C "
        "without any call from Python",
    )
