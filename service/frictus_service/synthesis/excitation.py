"""An excitation as the kernel plays it: a drive of its own, not through any inverse."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from frictus.errors import ArgumentError
from frictus.messages import Applied, Excitation
from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.friction import FrictionLaw
from frictus_service.synthesis.drive_range import SPEEDS_MM_S

MAX_FREE_TONES: Final = 32
"""Without a period each tone costs time in every sample; with one, none does."""
ROUNDING: Final = 1e-6


@dataclass(frozen=True, slots=True)
class CompiledExcitation:
    """What the renderer plays; ``m[n] = table[n mod period] + sum of tones``.

    Attributes
    ----------
    table : ndarray, shape (n_period,)
        One period, bias included; of one sample where there is no period.
    hz, amplitude, phase_rad : ndarray, shape (n_tones,)
        The tones, where there is no period.
    peak : float
        Largest drive fraction.
    applied : Applied
        The bias; the gain of what is played as it is is 1.
    source : str
        Etag of what was asked for.
    """

    table: FloatArray
    hz: FloatArray
    amplitude: FloatArray
    phase_rad: FloatArray
    peak: float
    applied: Applied
    source: str = "excitation"


def compile_excitation(
    excitation: Excitation, law: FrictionLaw, sample_rate_hz: float
) -> CompiledExcitation:
    """Return an excitation ready to play.

    Parameters
    ----------
    excitation : Excitation
        The tones to play.
    law : FrictionLaw
        Tells the friction that the bias adds; nothing else depends on it.
    sample_rate_hz : float

    Raises
    ------
    ArgumentError
        If the drive leaves [0, 1], a tone is at or above half of the sample rate or no multiple
        of 1 / period, or there are too many tones for one without a period.
    """
    tones = excitation.tones
    hz = np.array([tone.hz for tone in tones])
    amplitude = np.array([tone.amplitude for tone in tones])
    phase = np.array([tone.phase_rad for tone in tones])
    if hz.size and not float(hz.max()) < sample_rate_hz / 2.0:
        raise ArgumentError(
            f"a tone of {hz.max():g} Hz at {sample_rate_hz:g} samples per second: "
            "below half of it is accepted"
        )
    if excitation.period_s is None:
        if hz.size > MAX_FREE_TONES:
            raise ArgumentError(
                f"{hz.size} tones without period_s: up to {MAX_FREE_TONES} accepted; "
                "give the period of their sum"
            )
        table = np.array([excitation.bias])
        swing = float(amplitude.sum())
        low, high = excitation.bias - swing, excitation.bias + swing
    else:
        table = excitation.bias + _period(
            hz, amplitude, phase, excitation.period_s, sample_rate_hz
        )
        hz = amplitude = phase = np.zeros(0)
        low, high = float(table.min()), float(table.max())
    if not (low >= -ROUNDING and high <= 1.0 + ROUNDING):
        raise ArgumentError(
            f"the drive goes from {low:.4g} to {high:.4g}: it must stay within 0 to 1; "
            "lower the amplitudes or move the bias"
        )
    applied = Applied(
        gain=1.0,
        feasible_gain=1.0,
        bias=excitation.bias,
        bias_n=excitation.bias * law.gain_n,
        scaled=False,
        speed_range_mm_s=(0.0, float(SPEEDS_MM_S[-1])),
    )
    return CompiledExcitation(table, hz, amplitude, phase, min(high, 1.0), applied)


def _period(
    hz: FloatArray,
    amplitude: FloatArray,
    phase_rad: FloatArray,
    period_s: float,
    sample_rate_hz: float,
) -> FloatArray:
    """Return one period of the sum of tones, by the inverse transform of its lines."""
    n = round(period_s * sample_rate_hz)
    if n < 1 or abs(n - period_s * sample_rate_hz) > ROUNDING * n:
        raise ArgumentError(
            f"period_s {period_s:g} is {period_s * sample_rate_hz:.6g} samples at "
            f"{sample_rate_hz:g} per second: a whole number is accepted"
        )
    line = np.rint(hz * n / sample_rate_hz).astype(np.int64)
    off = np.abs(line * sample_rate_hz / n - hz)
    if np.any(off > ROUNDING * hz):
        worst = int(np.argmax(off))
        raise ArgumentError(
            f"a tone of {hz[worst]:g} Hz is no multiple of {sample_rate_hz / n:g} Hz, "
            f"1 / period_s"
        )
    spectrum = np.zeros(n // 2 + 1, dtype=np.complex128)
    np.add.at(spectrum, line, 0.5 * n * amplitude * np.exp(1j * phase_rad))
    return np.fft.irfft(spectrum, n)
