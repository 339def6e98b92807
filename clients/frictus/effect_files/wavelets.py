"""Wavelet bands of MPEG haptics: blocks of coefficients become a signal in time.

The transform is the biorthogonal one of 9 and 7 taps, in lifting steps with their published
factors: I. Daubechies and W. Sweldens, J. Fourier Anal. Appl. 4 (1998), p. 247, section 7.6.
The sign of the detail and the order of the coefficients are those of ISO/IEC 23090-31.
"""

import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from frictus.effect_files.document import LARGEST, items, within, word
from frictus.effect_files.spiht import TooManyDecisionsError, decode_block
from frictus.effect_files.timeline import DRAWN_HZ, FloatArray, Timeline
from frictus.errors import TextureError

BLOCK_SAMPLES: Final = (16, 32_768)
MAX_SAMPLES: Final = 3_000_000
"""Of all wavelet bands of a document together, gaps included: 6 minutes at 8 kHz."""
LEAST_SAMPLES: Final = 1_000
"""That a band counts as."""
MAX_DECISIONS: Final = 6_000_000
"""Of all blocks of a document together: what bounds the time of decoding."""
MAX_STREAM: Final = 100_000
"""Characters of one block's stream."""
_RATE_HZ: Final = (100.0, 65_535.0)
_LEAST_BAND: Final = 4
"""Coefficients of the coarsest band."""
_DIGITS: Final = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/"
_VALUES: Final[NDArray[np.uint8]] = np.array(
    [_DIGITS.find(n) % 256 for n in range(256)], dtype=np.uint8
)
_PREDICT: Final = (-1.586134342059924, 0.882911075530934)
_UPDATE: Final = (-0.052980118572961, 0.443506852043971)
_GAIN: Final = 1.149604398860241


@dataclass(slots=True)
class Budget:
    """What a document may still ask for."""

    samples: int = MAX_SAMPLES
    decisions: int = MAX_DECISIONS


@dataclass(frozen=True, slots=True)
class WaveletBand:
    """A wavelet band, decoded.

    Attributes
    ----------
    gain : float
        What its samples are multiplied by.
    rate_hz : int
        Of the samples.
    first : int
        Number of the sample that `samples` begins with, from the begin of the effect.
    samples : ndarray, shape (n_samples,)
        Blocks at their places, zeros between.
    """

    gain: float
    rate_hz: int
    first: int
    samples: FloatArray

    @property
    def end_s(self) -> float:
        """Where it ends, s."""
        return (self.first + self.samples.size) / self.rate_hz

    def render(self, timeline: Timeline) -> None:
        """Add the band to an effect, interpolated without new frequencies."""
        span, _ = timeline.span(self.first / self.rate_hz, self.end_s)
        # From a sample that both rates have to another, with some silence behind.
        whole = _common_samples(self.rate_hz)
        lead = self.first % whole
        length = whole * _smooth(-(-(lead + self.samples.size + whole) // whole))
        padded = np.zeros(length)
        padded[lead : lead + self.samples.size] = self.samples
        count = length * DRAWN_HZ // self.rate_hz
        begin = (self.first - lead) * DRAWN_HZ // self.rate_hz
        spectrum = np.fft.rfft(padded)[: count // 2 + 1]
        signal = np.fft.irfft(spectrum, count) * (count / length)
        timeline.samples[span] += self.gain * signal[span.start - begin : span.stop - begin]


def wavelet_band(
    band: dict[str, Any], where: str, timescale: float, gain: float, left: Budget
) -> WaveletBand | None:
    """Decode a wavelet band of an HJIF document; None if it holds no block.

    Parameters
    ----------
    band : dict
        As parsed.
    where : str
        Its place in the document.
    timescale : float
        Ticks per second.
    gain : float
        Of its channel.
    left : Budget
        Is reduced by what the band takes.

    Raises
    ------
    TextureError
        If a value is out of range, a stream is not Base64, or the document asks for too much.
    """
    effects = items(band, "effects", where)
    streams = [_stream(effect, at) for at, effect in effects]
    rate_hz = int(within(band, "upper_frequency_limit", where, *_RATE_HZ))
    block_ticks = within(band, "block_length", where, 1.0, LARGEST)
    count = _block_samples(block_ticks, rate_hz, timescale, where)
    # Ticks may be coarser than samples: whole blocks follow one another without a gap.
    begins = [
        round(within(effect, "position", at, 0.0, LARGEST, 0.0) / block_ticks * count)
        for at, effect in effects
    ]
    if not begins:
        return None
    coded = [n for n, bits in enumerate(streams) if any(bits)]
    first, end = min(begins), max(begins) + count
    rendered = end - first + 2 * _common_samples(rate_hz)
    left.samples -= max(rendered, count * len(coded), LEAST_SAMPLES)
    if left.samples < 0:
        raise TextureError(
            f"{where}: more than {MAX_SAMPLES} samples of wavelet bands up to here, gaps "
            "included"
        )
    coefficients = np.zeros((len(coded), count))
    for row, n in zip(coefficients, coded, strict=True):
        try:
            row[:], taken = decode_block(streams[n], count, left.decisions)
        except TooManyDecisionsError:
            raise TextureError(
                f"{effects[n][0]}: more than {MAX_DECISIONS} coded decisions up to here; split "
                "the document, or code it at a lower bit rate"
            ) from None
        left.decisions -= taken
    samples = np.zeros(end - first)
    for n, block in zip(coded, synthesis(coefficients), strict=True):
        samples[begins[n] - first : begins[n] - first + count] += block
    return WaveletBand(gain, rate_hz, first, samples)


def _common_samples(rate_hz: int) -> int:
    """Return how many samples last a whole number of the timeline's."""
    return rate_hz // math.gcd(rate_hz, DRAWN_HZ)


def _smooth(least: int) -> int:
    """Return the least product of 2, 3 and 5 that is no less: soon transformed."""
    odd = (int(3**b * 5**c) for b in range(14) for c in range(10))
    return min(n << (-(-least // n) - 1).bit_length() for n in odd)


def _block_samples(ticks: float, rate_hz: int, timescale: float, where: str) -> int:
    """Return the power of two whose time, to a tick, is that of a block."""
    low, high = BLOCK_SAMPLES
    powers = [low << n for n in range((high // low).bit_length())]
    strays = [abs(count * timescale / rate_hz - ticks) for count in powers]
    if min(strays) >= 1.0:
        raise TextureError(
            f"{where}: blocks of {ticks:g} ticks are {ticks * rate_hz / timescale:.6g} samples "
            f"at {rate_hz} Hz; a power of two from {low} to {high} is accepted"
        )
    return powers[strays.index(min(strays))]


def _stream(effect: dict[str, Any], where: str) -> bytes:
    """Return the bits of a block, a byte each, in the order of their text."""
    if (kind := word(effect, "effect_type", where, "Basis")) != "Basis":
        raise TextureError(f"{where}: effect type {kind!r}; a wavelet band holds Basis alone")
    stream = effect.get("wavelet_stream")
    if not isinstance(stream, str):
        raise TextureError(
            f"{where}: a text 'wavelet_stream' was expected; drafts from before the standard "
            "have keyframes instead: code the signal anew"
        )
    if len(stream) > MAX_STREAM:
        raise TextureError(f"{where}: {len(stream)} characters; at most {MAX_STREAM} accepted")
    digits = _VALUES[np.frombuffer(stream.encode("ascii", "replace"), dtype=np.uint8)]
    if np.any(digits > 63):
        raise TextureError(f"{where}: its wavelet_stream is not Base64 without padding")
    return np.unpackbits(digits[:, None], axis=1)[:, 2:].tobytes()


def stream_of(data: bytes) -> str:
    """Return the text of a stream that a binary file holds, whose bytes begin at bit 0.

    Parameters
    ----------
    data : bytes
        Of one block.
    """
    bits = np.unpackbits(np.frombuffer(data, dtype=np.uint8), bitorder="little")
    groups = np.pad(bits, (0, -bits.size % 6)).reshape(-1, 6)
    return bytes(_DIGITS[n] for n in np.packbits(groups, axis=1)[:, 0] >> 2).decode()


def synthesis(coefficients: FloatArray) -> FloatArray:
    """Return the signals of blocks of wavelet coefficients.

    Parameters
    ----------
    coefficients : ndarray, shape (n_blocks, n_samples)
        From the coarsest band to the finest; a power of two, at least 16.

    Returns
    -------
    ndarray, shape (n_blocks, n_samples)
        Mirrored at the ends of a block on the way, so that blocks stand for themselves.
    """
    signal = coefficients[:, :_LEAST_BAND]
    while (half := signal.shape[1]) < coefficients.shape[1]:
        even, odd = signal / _GAIN, -_GAIN * coefficients[:, half : 2 * half]
        for update, predict in zip(reversed(_UPDATE), reversed(_PREDICT), strict=True):
            even = even - update * (odd + np.hstack([odd[:, :1], odd[:, :-1]]))
            odd = odd - predict * (even + np.hstack([even[:, 1:], even[:, -1:]]))
        signal = np.stack([even, odd], axis=2).reshape(even.shape[0], 2 * half)
    return signal
