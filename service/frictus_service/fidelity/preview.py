"""Third-octave bands, and what of a texture a rig could give before anybody feels it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from scipy import signal

from frictus.messages import Applied
from frictus.model import Model
from frictus.textures import Map, Region, Scene, Texture
from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.linear import TransferFunction
from frictus_hardware.physics.screen import Screen
from frictus_service.synthesis.compensability import inverse_of_model
from frictus_service.synthesis.components import Components, components_of
from frictus_service.synthesis.scene import compile_scene

CENTRES_HZ = 10.0 ** (np.arange(15, 31) / 10.0)
"""Third octaves from 31.5 Hz to 1 kHz (IEC 61260, base ten)."""
NOMINAL_HZ = (
    *(31.5, 40.0, 50.0, 63.0, 80.0, 100.0, 125.0, 160.0),
    *(200.0, 250.0, 315.0, 400.0, 500.0, 630.0, 800.0, 1000.0),
)
EDGES_HZ = 10.0 ** (np.arange(14.5, 31.0) / 10.0)
FLOOR_DB = 30.0
"""Bands further than this under the strongest are not judged."""
JND_DB = 1.21
"""Difference threshold of electrovibration amplitude, for orientation."""


def windows(n_samples: int, length: int) -> list[slice]:
    """Return half-overlapping windows that cover a recording."""
    return [slice(at, at + length) for at in range(0, n_samples - length + 1, length // 2)]


def by_band(frequency_hz: FloatArray, power: FloatArray) -> FloatArray:
    """Return the sum in each third octave, shape (16,), of the power of lines."""
    band = np.searchsorted(EDGES_HZ, frequency_hz, side="right") - 1
    inside = (band >= 0) & (band < CENTRES_HZ.size)
    return np.bincount(band[inside], power[inside], CENTRES_HZ.size).astype(np.float64)


def band_power(
    samples: FloatArray,
    sample_rate_hz: float,
    segments: Sequence[slice],
    through: TransferFunction | None = None,
) -> FloatArray:
    """Return the power in each third octave, summed over segments.

    Parameters
    ----------
    samples : ndarray, shape (n_samples,)
    sample_rate_hz : float
        Samples per second of the device's clock.
    segments : sequence of slice
        Each is detrended and weighted with a Hann window over its length; at least 0.1 s.
    through : TransferFunction, optional
        What the samples have passed and shall be freed of.

    Returns
    -------
    ndarray, shape (16,)
        In units of the samples, squared.
    """
    power = np.zeros(CENTRES_HZ.size)
    weight = 0.0
    for segment in segments:
        part = signal.detrend(samples[segment])
        window = signal.windows.hann(part.size, sym=False)
        spectrum = np.square(np.abs(np.fft.rfft(part * window)))
        frequency = np.fft.rfftfreq(part.size, 1.0 / sample_rate_hz).astype(np.float64)
        if through is not None:
            spectrum /= np.square(np.abs(through.frequency_response(frequency)))
        power += 2.0 / part.size * by_band(frequency, spectrum)
        weight += float(np.square(window).sum())
    return power / weight


def error_db(felt: FloatArray, target: FloatArray) -> FloatArray:
    """Return the level error in each band, NaN where the target is too weak to judge.

    Parameters
    ----------
    felt, target : ndarray, shape (16,)
        Powers, as `band_power` returns them.
    """
    judged = target > target.max() * 10.0 ** (-FLOOR_DB / 10.0)
    error = np.full(target.size, np.nan)
    error[judged] = 10.0 * np.log10(np.maximum(felt[judged], 1e-30) / target[judged])
    return error


def rms_db(errors: FloatArray) -> float:
    """Return the root mean square over the judged bands."""
    return float(np.sqrt(np.nanmean(np.square(errors))))


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
