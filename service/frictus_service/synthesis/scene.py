"""Compile a scene: tables for the kernel, and the one gain and bias that fit the drive.

The drive fraction must stay in [0, 1] wherever the finger is and however fast it moves. What a
layer asks of the drive is found by rendering it at every point and speed; the scene is then
scaled, once and for all speeds, and the scale is reported.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from frictus.errors import TextureError
from frictus.messages import Applied
from frictus.textures import Scene
from frictus_hardware.physics.screen import Screen
from frictus_service.synthesis import kernel
from frictus_service.synthesis.compensation import Inverse, Invertible, as_inverse
from frictus_service.synthesis.drive_range import SPEEDS_MM_S, reach_of
from frictus_service.synthesis.layers import Layer, arrays_of, layers_of

HEADROOM = 0.03
"""Share of the drive kept free for cross-fades and corrections of the finger's motion."""
MAX_SCENE_BYTES = 200_000_000
"""Of the tables of all its layers: five of the largest."""


@dataclass(frozen=True, slots=True)
class CompiledScene:
    """What the renderer plays.

    Attributes
    ----------
    arrays : SceneArrays
        For the kernel, gain and bias included.
    applied : Applied
        What became of the request.
    source : str
        `scene` or `stream`.
    """

    arrays: kernel.SceneArrays
    applied: Applied
    source: str = "scene"

    @property
    def size_bytes(self) -> int:
        """What its arrays take."""
        return sum(array.nbytes for array in self.arrays if isinstance(array, np.ndarray))


def compile_scene(
    scene: Scene,
    law: Invertible,
    screen: Screen,
    sample_rate_hz: float,
    check: Callable[[], None] = lambda: None,
) -> CompiledScene:
    """Compile a scene for a screen and a friction law.

    Parameters
    ----------
    scene : Scene
        As a client sent it.
    law : FrictionLaw or Inverse
        What will be undone: it sets what the drive can reach.
    screen : Screen
        Its peak voltage, carrier and size.
    sample_rate_hz : float
        Samples per second of the device's clock.
    check : callable
        Called before each texture is compiled, and before its range is found; may raise, to
        give up.

    Returns
    -------
    CompiledScene
        `applied.gain` is below 1 where the scene was scaled to fit.

    Raises
    ------
    TextureError
        If a texture cannot be represented, or all together would not fit into memory; the
        text names the region.
    """
    layers: list[Layer] = []
    size_bytes = 0
    for number, region in enumerate(scene.regions):
        check()
        try:
            coming = layers_of(region, screen)
            size_bytes += sum(layer.size_bytes for layer in coming)
            if size_bytes > MAX_SCENE_BYTES:
                raise TextureError(
                    f"with those before it, its tables take {size_bytes / 1e6:.0f} MB; at most "
                    f"{MAX_SCENE_BYTES / 1e6:.0f} MB are kept. Take fewer textures, or lower "
                    "their highest frequencies"
                )
            layers += coming
        except TextureError as error:
            named = f"regions.{number} {region.name}".rstrip()
            raise TextureError(f"{named}: {error}") from error
    arrays = arrays_of(layers)
    inverse = as_inverse(law)
    low, high = reach_of(layers, arrays, inverse.bounding, sample_rate_hz, check)
    return fit(arrays, low, high, inverse, [note for layer in layers for note in layer.notes])


def fit(
    arrays: kernel.SceneArrays,
    low: float,
    high: float,
    inverse: Inverse,
    notes: list[str],
    source: str = "scene",
) -> CompiledScene:
    """Scale layers so that what they ask of the bounding law, `low` to `high`, fits."""
    law, low, high = inverse.bounding, inverse.swing * low, inverse.swing * high
    swing = high - low
    feasible = 1.0 / swing if swing > 0.0 else np.inf
    gain = min(1.0, (1.0 - HEADROOM) * feasible)
    bias = -gain * low + HEADROOM / 2.0 if swing > 0.0 else 0.0
    real = arrays.real.copy()
    real[:, kernel.GAIN] *= gain
    applied = Applied(
        gain=gain,
        feasible_gain=min(feasible, 1e9),
        bias=bias,
        bias_n=bias * law.gain_n,
        scaled=gain < 1.0,
        speed_range_mm_s=(0.0, float(SPEEDS_MM_S[-1])),
        notes=notes,
    )
    return CompiledScene(arrays._replace(real=real, bias_n=bias * law.gain_n), applied, source)
