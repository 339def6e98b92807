"""Every texture but a map is a sum of sinusoids over position or over time."""

import math
from dataclasses import dataclass, replace

import numpy as np

from frictus.errors import TextureError
from frictus.textures import (
    BAND_HZ,
    Beta,
    Profile,
    Slope,
    Spectrum,
)
from frictus_hardware.arrays import FloatArray

FREQUENCY = (1e-4, 1e8)
"""Accepted, in cycles/mm or Hz: wider than any texture; rows of tables are counted from it."""
LONGEST_PERIOD_S = 10.0
"""Temporal textures repeat after at most this; their lines stand at multiples of 0.1 Hz."""
JOIN_MM = 5.0
"""Over which the ends of a part of a profile fade into each other, beside the screen."""
NOISE_PERIOD_S = 1.0
"""Filtered noise repeats after this much time, or the way covered in it."""


@dataclass(frozen=True, slots=True)
class Components:
    """``sum amplitude cos(2 pi frequency u + phase)``, u in mm or s.

    Attributes
    ----------
    frequency, amplitude_n, phase_rad : ndarray, shape (n_components,)
        Frequency in cycles/mm (spatial) or Hz (temporal), above 0; friction amplitude in N.
    spatial : bool
        Over position (True) or over time.
    period : float or None
        After which the sum repeats, in mm or s; None where it does not.
    angle_deg : float
        Direction of the phase of a spatial texture, from x towards y.
    notes : tuple of str
        What was rounded or left out.

    Raises
    ------
    TextureError
        If a frequency lies outside `FREQUENCY`, or anything is not finite.
    """

    frequency: FloatArray
    amplitude_n: FloatArray
    phase_rad: FloatArray
    spatial: bool
    period: float | None
    angle_deg: float = 0.0
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Refuse what no table can hold."""
        lowest, highest = FREQUENCY
        # Compiled code indexes by these, so they are checked wherever they come from.
        wrong = ~((self.frequency >= lowest) & (self.frequency <= highest))  # NaN is wrong
        if np.any(wrong):
            raise TextureError(
                f"a frequency of {self.frequency[wrong][0]:.3g} "
                f"{'cycles/mm' if self.spatial else 'Hz'}: {lowest:g} to {highest:g} accepted"
            )
        if not (np.all(np.isfinite(self.amplitude_n)) and np.all(np.isfinite(self.phase_rad))):
            raise TextureError("an amplitude or a phase is not finite")


def components_of(texture: Spectrum | Profile | Beta | Slope) -> list[Components]:
    """Return the sums that make up a texture: a spectrum may have a spatial and a temporal one.

    Raises
    ------
    TextureError
        If the texture cannot be represented.
    """
    match texture:
        case Spectrum():
            return _spectrum(texture)
        case Profile():
            return [_profile(texture)]
        case Beta():
            return [_felt(*_beta_lines(texture), texture)]
        case Slope():
            return [_felt(*_slope_lines(texture), texture)]


def _spectrum(texture: Spectrum) -> list[Components]:
    spatial = [c for c in texture.components if c.cycles_per_mm is not None]
    temporal = [c for c in texture.components if c.hz is not None]
    notes = (texture.label,) if texture.label else ()
    sums = []
    if spatial:
        frequency = np.array([c.cycles_per_mm for c in spatial], dtype=float)
        amplitude, phase = _amplitude_phase(spatial)
        sums.append(
            Components(frequency, amplitude, phase, True, None, texture.angle_deg, notes)
        )
    if temporal:
        frequency = np.array([c.hz for c in temporal], dtype=float)
        amplitude, phase = _amplitude_phase(temporal)
        timed = on_time_grid(frequency, amplitude, phase)
        sums.append(replace(timed, notes=(*notes, *timed.notes)))
    return sums


def _amplitude_phase(components: list) -> tuple[FloatArray, FloatArray]:  # type: ignore[type-arg]
    return (
        np.array([c.amplitude_n for c in components], dtype=float),
        np.array([c.phase_rad for c in components], dtype=float),
    )


def on_time_grid(frequency: FloatArray, amplitude: FloatArray, phase: FloatArray) -> Components:
    """Return temporal components rounded to multiples of 0.1 Hz, so that they repeat."""
    rounded = np.maximum(np.round(frequency * LONGEST_PERIOD_S), 1.0) / LONGEST_PERIOD_S
    moved = float(np.max(np.abs(rounded - frequency)))
    notes = (f"temporal frequencies moved by up to {moved:.2g} Hz",) if moved > 1e-9 else ()
    return Components(rounded, amplitude, phase, False, LONGEST_PERIOD_S, 0.0, notes)


def _profile(texture: Profile) -> Components:
    period = texture.period_mm if texture.period_mm is not None else texture.period_s
    assert period is not None  # the texture's own validator
    return periodic(
        np.asarray(texture.friction_n, dtype=float),
        period,
        texture.period_mm is not None,
        texture.angle_deg,
    )


def profile_within(texture: Profile, stretch_mm: tuple[float, float]) -> Components:
    """Return the harmonics of a spatial profile, of no more of it than a finger can reach.

    A recording may be far longer than a screen. The part within the stretch is kept sample by
    sample; beyond, its ends are led into each other, so that it repeats.

    Parameters
    ----------
    texture : Profile
        With `period_mm`.
    stretch_mm : tuple of float
        From where to where a finger can be along the texture's direction.

    Raises
    ------
    TextureError
        If the friction is constant: there is nothing to feel.
    """
    assert texture.period_mm is not None
    friction_n = np.asarray(texture.friction_n, dtype=float)
    pitch_mm = texture.period_mm / friction_n.size
    first = math.floor(stretch_mm[0] / pitch_mm)
    count = math.ceil(stretch_mm[1] / pitch_mm) + 1 - first
    join = math.ceil(JOIN_MM / pitch_mm)
    if count + join >= friction_n.size:
        return _profile(texture)
    part = friction_n[np.arange(first, first + count + join) % friction_n.size]
    before = friction_n[np.arange(first - join, first) % friction_n.size]
    share = 0.5 - 0.5 * np.cos(np.pi * (np.arange(join) + 0.5) / join)
    part[count:] += share * (before - part[count:])
    whole = periodic(part, (count + join) * pitch_mm, True, texture.angle_deg)
    moved_rad = 2.0 * np.pi * whole.frequency * first * pitch_mm
    return replace(whole, phase_rad=whole.phase_rad - moved_rad)


def periodic(
    friction_n: FloatArray, period: float, spatial: bool, angle_deg: float
) -> Components:
    """Return the harmonics of one sampled period; its mean goes into the bias.

    Parameters
    ----------
    friction_n : ndarray, shape (n_samples,)
    period : float
        In mm (spatial) or s.
    spatial : bool
        Over position, or over time.
    angle_deg : float

    Raises
    ------
    TextureError
        If the friction is constant: there is nothing to feel.
    """
    spectrum = np.fft.rfft(friction_n) / friction_n.size
    harmonic = np.arange(1, spectrum.size)
    amplitude = 2.0 * np.abs(spectrum[1:])
    if friction_n.size % 2 == 0:
        amplitude[-1] /= 2.0  # the Nyquist line stands alone
    # Lines 120 dB down are the rounding of float32 on the wire, not texture.
    kept = amplitude > 1e-6 * amplitude.max()
    if not amplitude.max() > 1e-12 * np.abs(friction_n).max():  # rounding leaves that much
        raise TextureError("the texture is constant: there is nothing to feel")
    phase = np.angle(spectrum[1:])
    return Components(
        harmonic[kept] / period, amplitude[kept], phase[kept], spatial, period, angle_deg
    )


def _beta_lines(texture: Beta) -> tuple[FloatArray, FloatArray, FloatArray]:
    low, high = BAND_HZ
    steps = int(np.floor(24.0 * np.log2(high / low)))
    frequency = low * 2.0 ** (np.arange(steps + 1) / 24.0)
    position = np.log10(frequency / low) / np.log10(high / low)
    # The density of a beta law may be infinite at its ends; the middle of the end steps is not.
    position = np.clip(position, 0.5 / steps, 1.0 - 0.5 / steps)
    log_density = (texture.alpha - 1.0) * np.log(position)
    log_density += (texture.beta - 1.0) * np.log1p(-position)
    # The whole is brought to `rms_n`: neither the law's norm nor `scale` makes a difference,
    # and both could overflow.
    amplitude = np.exp(log_density - log_density.max())
    return frequency, *_matched(amplitude, texture.rms_n, texture.seed)


def _slope_lines(texture: Slope) -> tuple[FloatArray, FloatArray, FloatArray]:
    frequency = np.arange(BAND_HZ[0], BAND_HZ[1] + 0.5, 1.0 / NOISE_PERIOD_S)
    ratio = frequency / texture.peak_hz
    high_pass = ratio**texture.low_order / np.sqrt(1.0 + ratio ** (2 * texture.low_order))
    low_pass = 1.0 / np.sqrt(1.0 + ratio ** (2 * texture.high_order))
    return frequency, *_matched(high_pass * low_pass, texture.rms_n, texture.seed)


def _matched(amplitude: FloatArray, rms_n: float, seed: int) -> tuple[FloatArray, FloatArray]:
    total = float(np.sqrt(np.sum(np.square(amplitude)) / 2.0))
    if not (np.isfinite(total) and total > 0.0):
        raise TextureError("the parameters give no finite spectrum; widen alpha and beta")
    phase = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, amplitude.size)
    return amplitude * (rms_n / total), phase


def _felt(
    frequency: FloatArray, amplitude: FloatArray, phase: FloatArray, texture: Beta | Slope
) -> Components:
    """Make lines in hertz spatial where the texture says at which speed they are felt."""
    if texture.speed_mm_s is None:
        return on_time_grid(frequency, amplitude, phase)
    return Components(
        frequency / texture.speed_mm_s, amplitude, phase, True, None, texture.angle_deg
    )
