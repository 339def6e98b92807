"""The course of an effect: waves and bursts on one axis of time, as samples.

What the files leave open is decided here, for all formats alike. Sharpness 0 to 1 stands for 80
to 230 Hz (`SHARPNESS_HZ`; Apple and Meta give no figure). A burst is two cycles of a sine, as
the reference decoder of MPEG renders a transient (there in 22 ms). Full scale is the most an
effect can ask for: sums beyond it are limited, which is reported.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from frictus.errors import TextureError

FloatArray = NDArray[np.float64]

SHARPNESS_HZ: Final = (80.0, 230.0)
"""Frequency at sharpness 0 and 1."""
RATE_HZ: Final = 6_000
"""Of a rendered effect; textures are felt up to 1000 Hz."""
MAX_HZ: Final = RATE_HZ / 2.0
MAX_DURATION_S: Final = 180.0
MAX_TOTAL_S: Final = 1_800.0
"""Of all waves and bursts of an effect together: what bounds the time of rendering."""
BURST_CYCLES: Final = 2.0
_FINE: Final = 4
DRAWN_HZ: Final = RATE_HZ * _FINE
"""Steps and square waves are drawn finer, so that little of them folds back."""


@dataclass(frozen=True, slots=True)
class RenderedEffect:
    """An effect as a signal in time.

    Attributes
    ----------
    signal : ndarray, shape (n_samples,)
        -1 to 1 (steps may swing over by some percent): shares of full scale.
    notes : tuple of str
        What was limited, assumed or left out.
    """

    signal: FloatArray
    notes: tuple[str, ...]

    @property
    def sample_rate_hz(self) -> float:
        """Of the signal, Hz."""
        return float(RATE_HZ)

    @property
    def duration_s(self) -> float:
        """How long it lasts, s."""
        return self.signal.size / RATE_HZ


class Timeline:
    """Adds up the waves and bursts of an effect.

    Parameters
    ----------
    duration_s : float
        From 0 to where the last of them ends.

    Raises
    ------
    TextureError
        If nothing lasts as long as any sample, or longer than `MAX_DURATION_S`.
    """

    def __init__(self, duration_s: float) -> None:
        if not duration_s > 0.0:
            raise TextureError("the effect lasts 0 s: there is nothing to render")
        if not duration_s <= MAX_DURATION_S:
            raise TextureError(
                f"the effect lasts {duration_s:.6g} s; at most {MAX_DURATION_S:g} s accepted"
            )
        self.rate_hz = float(DRAWN_HZ)
        self.samples = np.zeros(_FINE * math.ceil(duration_s * RATE_HZ - 1e-6))
        if not self.samples.size:
            raise TextureError(
                f"the effect lasts {duration_s:.6g} s: less than a sample of {RATE_HZ} Hz"
            )
        self._total_s = 0.0

    def span(self, begin_s: float, end_s: float) -> tuple[slice, FloatArray]:
        """Return the samples from `begin_s` until before `end_s`, and their times.

        Parameters
        ----------
        begin_s, end_s : float
            Cut to the timeline.

        Returns
        -------
        where : slice
            Of `samples`.
        time_s : ndarray, shape (n_samples,)
            Since `begin_s`.

        Raises
        ------
        TextureError
            If all spans together are longer than `MAX_TOTAL_S`.
        """
        self._total_s += end_s - begin_s
        if self._total_s > MAX_TOTAL_S:
            raise TextureError(
                f"its waves last more than {MAX_TOTAL_S:g} s together: too many are rendered"
                " at the same time"
            )
        first = max(math.ceil(begin_s * self.rate_hz - 1e-6), 0)
        last = min(max(math.ceil(end_s * self.rate_hz - 1e-6), first), self.samples.size)
        return slice(first, last), np.arange(first, last) / self.rate_hz - begin_s

    def burst(self, begin_s: float, amplitude: float, hz: float) -> None:
        """Add two cycles of a sine.

        Parameters
        ----------
        begin_s : float
            When they begin.
        amplitude : float
            In shares of full scale.
        hz : float
            Above 0.
        """
        where, time_s = self.span(begin_s, begin_s + burst_s(hz))
        self.samples[where] += amplitude * np.sin(2.0 * np.pi * hz * time_s)

    def phase_of(self, hz: FloatArray, time_s: FloatArray) -> FloatArray:
        """Return the phase of a wave, in rad, 0 at time 0.

        Parameters
        ----------
        hz : ndarray, shape (n_samples,)
            Its frequency at each sample.
        time_s : ndarray, shape (n_samples,)
            As `span` returns it.
        """
        if hz.size == 0:
            return hz
        steps = np.empty_like(hz)
        steps[0] = hz[0] * time_s[0]
        steps[1:] = (hz[1:] + hz[:-1]) / (2.0 * self.rate_hz)
        return 2.0 * np.pi * np.cumsum(steps)

    def finished(self, notes: list[str]) -> RenderedEffect:
        """Return the effect at `RATE_HZ`, limited to full scale.

        Parameters
        ----------
        notes : list of str
            What its file said that was left out.
        """
        over = int(np.count_nonzero(np.abs(self.samples) > 1.0 + 1e-9))
        if over:
            percent = 100.0 * over / self.samples.size
            peak = float(np.max(np.abs(self.samples)))
            notes = [
                *notes,
                f"it asks for up to {peak:.3g} of full scale: limited to 1 in {percent:.2g} % "
                "of its time",
            ]
        spectrum = np.fft.rfft(np.clip(self.samples, -1.0, 1.0))
        count = self.samples.size // _FINE
        # A texture repeats, so that its band is limited around the seam as well.
        signal = np.fft.irfft(spectrum[: count // 2 + 1], count) / _FINE
        return RenderedEffect(signal, tuple(notes))


def sharpness_hz(sharpness: FloatArray | float) -> FloatArray:
    """Return the frequency that a sharpness stands for, Hz.

    Parameters
    ----------
    sharpness : float or ndarray
        0 to 1.
    """
    low_hz, high_hz = SHARPNESS_HZ
    return low_hz + (high_hz - low_hz) * np.asarray(sharpness)


def burst_s(hz: float) -> float:
    """Return how long a burst lasts, s.

    Parameters
    ----------
    hz : float
        Its frequency, above 0.
    """
    return BURST_CYCLES / hz
