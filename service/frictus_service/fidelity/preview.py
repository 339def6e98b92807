"""What a texture asks for, and what of it a rig could give, before anybody feels it."""

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from frictus.messages import Applied
from frictus.model import Model
from frictus.textures import Map, Region, Scene, Texture
from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.screen import Screen
from frictus_service.fidelity.bands import CENTRES_HZ, by_band
from frictus_service.synthesis.components import Components, components_of
from frictus_service.synthesis.model_law import inverse_of_model
from frictus_service.synthesis.scene import compile_scene

POINTS: Final = 1_000
LENGTH: Final[dict[str, float]] = {"mm": 10.0, "s": 0.1}
"""How much is drawn: a few periods of what is felt as one texture."""


@dataclass(frozen=True, slots=True)
class FrictionExcerpt:
    """Friction over a stretch of the way or of time, from its beginning.

    Attributes
    ----------
    per : str
        Unit of the step: `mm` of way or `s` of time.
    step : float
        From one value to the next.
    friction_n : ndarray, shape (n_points,)
    """

    per: Literal["mm", "s"]
    step: float
    friction_n: FloatArray


def sums_of(texture: Texture) -> list[Components]:
    """Return the sums of sinusoids that a texture is; none for a map, which is an image.

    Raises
    ------
    TextureError
        If the texture cannot be represented.
    """
    return [] if isinstance(texture, Map) else components_of(texture)


def stretch_of(components: Components) -> FrictionExcerpt:
    """Return the first 10 mm, or 0.1 s, of a sum.

    Parameters
    ----------
    components : Components
        A sum of sinusoids.
    """
    per: Literal["mm", "s"] = "mm" if components.spatial else "s"
    step = LENGTH[per] / POINTS
    drawn = components.frequency < 0.5 / step  # finer ones would show as coarse ones
    rate = 2.0 * np.pi * components.frequency[drawn]
    amplitude, phase = components.amplitude_n[drawn], components.phase_rad[drawn]
    along = step * np.arange(POINTS)
    friction = np.array([amplitude @ np.cos(rate * at + phase) for at in along])
    return FrictionExcerpt(per, step, friction)


def third_octaves_n(sums: list[Components], speed_mm_s: float) -> FloatArray:
    """Return the friction that a steady stroke meets in third octaves, N rms, shape (16,).

    Parameters
    ----------
    sums : list of Components
        Spatial ones are met along their direction.
    speed_mm_s : float
        Above 0.
    """
    power = np.zeros(CENTRES_HZ.size)
    for components in sums:
        # Lines of one frequency add as phasors; all others in power.
        frequency, line = np.unique(components.frequency, return_inverse=True)
        phasor = np.zeros(frequency.size, dtype=np.complex128)
        np.add.at(phasor, line, components.amplitude_n * np.exp(1j * components.phase_rad))
        felt_hz = frequency * (speed_mm_s if components.spatial else 1.0)
        power += by_band(felt_hz, np.square(np.abs(phasor)) / 2.0)
    level: FloatArray = np.sqrt(power)
    return level


def feasible(texture: Texture, model: Model, screen: Screen, sample_rate_hz: float) -> Applied:
    """Return what a rig would make of a texture on its whole screen.

    Parameters
    ----------
    texture : Texture
        As a client sent it.
    model : Model
        Active on the rig.
    screen : Screen
        Its peak voltage, carrier and size.
    sample_rate_hz : float

    Raises
    ------
    TextureError
        If it cannot be rendered.
    """
    scene = Scene(regions=[Region(texture=texture)])
    inverse = inverse_of_model(model, screen)
    return compile_scene(scene, inverse, screen, sample_rate_hz).applied
