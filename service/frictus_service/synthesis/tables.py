"""Band-limited tables: friction over one stretch, one row for each band limit.

The cost of a sample must not depend on the number of components, and no component may be
rendered above the tactile band however fast the finger moves. So a texture becomes a table of
rows that hold ever fewer of its components; the kernel reads between the two rows that belong
to the speed.
"""

import bisect
import math
from dataclasses import dataclass, replace

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy import fft

from frictus.errors import TextureError
from frictus_service.synthesis.components import Components

FloatArray = NDArray[np.float64]

BAND_EDGE_HZ = 1122.0
"""Edge of the 1 kHz third-octave band: everything up to here is rendered in full."""
ROWS_PER_OCTAVE = 12
"""Octave rows would cost 4 dB on real recordings."""
FADE_HZ = BAND_EDGE_HZ * 2.0 ** (1.0 / ROWS_PER_OCTAVE)
"""Centre of the fade from one row to the next; nothing below the band's edge is lost."""
TOP_HZ = BAND_EDGE_HZ * 2.0 ** (2.0 / ROWS_PER_OCTAVE)
"""Nothing at all is rendered above."""
FASTEST_MM_S = 1000.0
"""Rows reach up to this speed; a faster finger feels the last row's components."""
POINTS_PER_CYCLE = 16
"""Of the highest component: cubic interpolation is then exact to 0.03 %."""
MAX_POINTS = 8_000_000
FULL_MM_S = 20.0
"""Slowest finger that is measured: a table without all that it feels is refused."""
PAD = 3
"""One point before and two after each row, so that the cubic needs no wrap-around."""


@dataclass(frozen=True, slots=True)
class Table:
    """Rows of friction.

    Attributes
    ----------
    rows : ndarray, shape (n_rows, n_points + 3)
        Row r holds the components up to ``top * 2^(-r / 12)``; padded by wrap-around.
    length : float
        What a row covers, in mm or s; it repeats.
    origin : float
        Position of the first point, mm (0 for time).
    top : float
        Highest frequency in row 0, cycles/mm or Hz.
    seamless : bool
        Whether the end leads on to the beginning; else there is a jump, beside the screen.
    """

    rows: FloatArray
    length: float
    origin: float
    top: float
    seamless: bool

    @property
    def n_points(self) -> int:
        """Points in a row, the padding left out."""
        return int(self.rows.shape[1]) - PAD


def fitting(components: Components, stretch_mm: tuple[float, float]) -> Components:
    """Leave out the finest spatial components where a table of all would be too large.

    Only those go that no finger feels at `FULL_MM_S` or faster, and a note says so. A recording
    at 44.1 kHz has them in plenty. If that is not enough the components are returned as they
    are, for `build_table` to refuse.

    Parameters
    ----------
    components : Components
    stretch_mm : tuple of float
        As for `build_table`.
    """
    if not components.spatial:
        return components
    _, length = _stretch(components, stretch_mm)
    finest = np.sort(components.frequency)
    count = bisect.bisect_right(
        finest, MAX_POINTS, key=lambda top: math.prod(_shape(top, length))
    )
    if count == finest.size or count == 0 or finest[count] * FULL_MM_S <= BAND_EDGE_HZ:
        return components
    kept = components.frequency < finest[count]
    slower_mm_s = BAND_EDGE_HZ / finest[count]
    note = (
        f"{np.count_nonzero(~kept)} components from {finest[count]:.3g} cycles/mm on left out: "
        f"they are felt below {slower_mm_s:.2g} mm/s only"
    )
    return replace(
        components,
        frequency=components.frequency[kept],
        amplitude_n=components.amplitude_n[kept],
        phase_rad=components.phase_rad[kept],
        notes=(*components.notes, note),
    )


def build_table(components: Components, stretch_mm: tuple[float, float]) -> Table:
    """Sum the components into rows.

    Parameters
    ----------
    components : Components
    stretch_mm : tuple of float
        From where to where a finger can be along the texture's direction; a spatial texture
        without a period is tabled over all of it.

    Raises
    ------
    TextureError
        If the table would not fit into memory, or nothing lies in the tactile band.
    """
    if components.spatial:
        kept = np.ones(components.frequency.size, dtype=bool)
    else:
        kept = components.frequency <= BAND_EDGE_HZ
        if not np.any(kept):
            raise TextureError(f"all frequencies lie above {BAND_EDGE_HZ:g} Hz: none is felt")
    frequency = components.frequency[kept]
    top = float(frequency.max())
    origin, length = _stretch(components, stretch_mm)
    n_rows, n_points = _shape(top, length) if components.spatial else (1, _points(top, length))
    if n_points * n_rows > MAX_POINTS:
        raise TextureError(
            f"{top:g} cycles/mm over {length:g} mm need a table of {n_points * n_rows} points; "
            f"at most {MAX_POINTS} are kept. Lower the highest frequency, the texture's length "
            "or the region's size"
        )
    row = np.floor(ROWS_PER_OCTAVE * np.log2(top / frequency) + 1e-9)
    # The last row that holds the component; `_sum_rows` writes there unchecked.
    last = np.clip(row, 0, n_rows - 1).astype(np.int64)
    amplitude, phase = components.amplitude_n[kept], components.phase_rad[kept]
    if components.period is not None:
        harmonic = np.rint(frequency * length).astype(np.int64)
        rows = _harmonic_rows(harmonic, amplitude * np.exp(1j * phase), last, n_rows, n_points)
    else:
        rows = np.zeros((n_rows, n_points + PAD))
        step_rad = 2.0 * np.pi * frequency * (length / n_points)
        _sum_rows(step_rad, amplitude, phase + 2.0 * np.pi * frequency * origin, last, rows)
    return Table(rows, length, origin, top, components.period is not None)


def _harmonic_rows(
    harmonic: NDArray[np.int64],
    line: NDArray[np.complex128],
    last: NDArray[np.int64],
    n_rows: int,
    n_points: int,
) -> FloatArray:
    """Sum the harmonics of one period into rows, by Fourier transforms."""
    spectra = np.zeros((n_rows, n_points // 2 + 1), dtype=complex)
    np.add.at(spectra, (last, harmonic), line)
    for row in range(n_rows - 2, -1, -1):
        spectra[row] += spectra[row + 1]
    rows = fft.irfft(spectra, n_points, axis=1) * (n_points / 2.0)
    return np.pad(rows, ((0, 0), (1, 2)), mode="wrap")


def _stretch(components: Components, stretch_mm: tuple[float, float]) -> tuple[float, float]:
    """Return where rows begin, and what they cover, in mm or s."""
    if components.period is not None:
        return 0.0, components.period
    origin, end = stretch_mm if components.spatial else (0.0, 0.0)
    return origin, end - origin


def _points(top: float, length: float) -> int:
    return int(fft.next_fast_len(max(math.ceil(POINTS_PER_CYCLE * top * length), 8), real=True))


def _shape(top_cycles_per_mm: float, length_mm: float) -> tuple[int, int]:
    """Return how many rows a spatial table has, and how many points each."""
    return _row_count(top_cycles_per_mm), _points(top_cycles_per_mm, length_mm)


def _row_count(top_cycles_per_mm: float) -> int:
    """Return how many rows reach from the slowest to the fastest finger."""
    octaves = math.log2(top_cycles_per_mm * FASTEST_MM_S / FADE_HZ)
    return max(math.ceil(ROWS_PER_OCTAVE * octaves), 0) + 2


@njit(cache=True, nogil=True)
def _sum_rows(step_rad, amplitude, phase, row, rows):  # type: ignore[no-untyped-def]
    """Add each component to its own row by rotation, then each row to the one that holds it."""
    n_points = rows.shape[1] - 3
    for c in range(step_rad.size):
        turn = np.exp(1j * step_rad[c])
        out = rows[row[c]]
        for start in range(0, n_points, 1024):  # restarted, so that rounding does not grow
            value = amplitude[c] * np.exp(1j * (phase[c] + step_rad[c] * start))
            for n in range(start, min(start + 1024, n_points)):
                out[n + 1] += value.real
                value *= turn
    for r in range(rows.shape[0] - 2, -1, -1):
        rows[r] += rows[r + 1]
    for r in range(rows.shape[0]):
        rows[r, 0] = rows[r, n_points]
        rows[r, n_points + 1] = rows[r, 1]
        rows[r, n_points + 2] = rows[r, 2]
