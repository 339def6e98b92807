"""How fast the kernel renders, beside the same algorithm in C."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from frictus.textures import Region, Scene
from frictus_hardware.physics.friction import FrictionLaw
from frictus_hardware.physics.screen import Screen
from frictus_service.benchmarks.figure import Figure, Target, interleaved
from frictus_service.benchmarks.native import NativeKernel, NoCompilerError, native_kernel
from frictus_service.errors import ServiceError
from frictus_service.library import SHIPPED, TextureLibrary
from frictus_service.synthesis import kernel
from frictus_service.synthesis.estimator import Course
from frictus_service.synthesis.kernel import Motion, SceneArrays
from frictus_service.synthesis.renderer import Renderer
from frictus_service.synthesis.scene import CompiledScene, compile_scene

FloatArray = NDArray[np.float64]

RATE_HZ: Final = 20_000.0
BLOCK_SAMPLES: Final = 100
SPAN_SAMPLES: Final = 10_000
"""Half a second: what a call costs no longer matters."""
TEXTURE: Final = "vinyl"
SCREEN: Final = Screen()
LAW: Final = FrictionLaw()
RAMP_STEP: Final = 1.0 / (0.02 * RATE_HZ)
AGREEMENT: Final = 1e-9
"""Largest difference from C that is accepted, as a share of the screen's peak volts."""
BLOCKS: Final = 100
"""Blocks in one timing of block after block."""


class Functions(Protocol):
    """The kernel's functions: of the module, or of the library in C."""

    target_friction: Any
    invert: Any
    envelope: Any
    modulate: Any


class Pass:
    """The kernel's four functions over a stretch of motion, as the renderer calls them.

    Parameters
    ----------
    functions : Functions
    scene : SceneArrays
    samples : int
        Length of the stretch.
    """

    def __init__(self, functions: Functions, scene: SceneArrays, samples: int) -> None:
        self._functions = functions
        self._scene = scene
        self._target = np.zeros(samples + 1)
        self._drive = np.zeros(samples)
        self._level = 0.0
        self.voltage_v = np.zeros(samples)

    def render(self, motion: Motion, first_sample: int) -> None:
        """Write the volts of a stretch to `voltage_v`."""
        call, drive = self._functions, self._drive
        call.target_friction(self._scene, motion, first_sample, RATE_HZ, self._target)
        friction_n, next_n = self._target[:-1], self._target[-1]
        call.invert(LAW_TUPLE, motion, RATE_HZ, friction_n, next_n, drive)
        self._level = call.envelope(self._level, 1.0, RAMP_STEP, drive)
        call.modulate(
            drive, first_sample, SCREEN.peak_v, SCREEN.carrier_hz, RATE_HZ, self.voltage_v
        )


def shipped_scene() -> CompiledScene:
    """Return a scene of one region with a shipped texture."""
    texture = TextureLibrary(SHIPPED).get(TEXTURE).texture
    return compile_scene(Scene(regions=[Region(texture=texture)]), LAW, SCREEN, RATE_HZ)


def strokes(blocks: int, samples: int) -> list[Motion]:
    """Return consecutive stretches of motion across the screen, 30 to 90 mm/s, and back."""
    seconds = samples / RATE_HZ
    time_s = seconds * np.arange(blocks + 1)
    x_mm = 35.0 + 30.0 * np.sin(2.0 * time_s)
    vx = 60.0 * np.cos(2.0 * time_s)
    vx += np.copysign(30.0, vx)
    return [
        Motion(x, 17.0, v0, 0.0, v1, 0.0, abs(v0), abs(v1))
        for x, v0, v1 in zip(x_mm[:-1].tolist(), vx[:-1].tolist(), vx[1:].tolist(), strict=True)
    ]


def differ_v(one: Pass, other: Pass, motions: list[Motion], samples: int) -> float:
    """Return by how many volts two passes differ at most."""
    worst = 0.0
    for number, motion in enumerate(motions):
        one.render(motion, number * samples)
        other.render(motion, number * samples)
        worst = max(worst, float(np.abs(one.voltage_v - other.voltage_v).max()))
    return worst


def measure(repeats: int = 15) -> list[Figure]:
    """Return `kernel`, samples/s over a long stretch, and `render_block`, us per block.

    Raises
    ------
    DisagreementError
        If C renders something else: then the times compare nothing.
    """
    scene = shipped_scene().arrays
    try:
        with native_kernel() as native:
            return [_kernel(scene, native, repeats), _block(scene, native, repeats)]
    except NoCompilerError as error:
        return [_kernel(scene, None, repeats, str(error)), _block(scene, None, repeats)]
