"""Band-limited tables: friction over one stretch, one row for each band limit.

The cost of a sample must not depend on the number of components, and no component may be
rendered above the tactile band however fast the finger moves. So a texture becomes a table of
rows that hold ever fewer of its components; the kernel reads between the two rows that belong
to the speed. Each octave of rows has half the points of the one before.
"""

import bisect
import math
from dataclasses import dataclass, replace

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy import fft

from frictus.errors import TextureError
from frictus_hardware.arrays import FloatArray
from frictus_service.synthesis.components import Components

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
MAX_POINTS = 5_000_000
"""Of all rows, 40 MB: what 200 mm of a texture need that is felt in full at `FULL_MM_S`."""
FAST_POINTS = 2_500_000
"""Compiled within a tenth of a second; beyond, what only slower fingers feel is left out."""
FEWEST_POINTS = 256
"""No row has fewer because of its octave."""
FULL_MM_S = 20.0
"""Slowest finger that is measured: a table without all that it feels is refused."""
BESIDE_MM = 5.0
"""A table without a period goes on so far beside the screen, where it ends in a jump."""
WIDEST_MM = BESIDE_MM / 5.0
"""Between two points of such a table: the jump reaches three points far, none on the screen."""
PAD = 3
"""One point before and two after each row, so that the cubic needs no wrap-around."""


@dataclass(frozen=True, slots=True)
class FrictionTable:
    """Rows of friction.

    Attributes
    ----------
    octaves : tuple of ndarray, shape (n_rows, n_points / 2^octave + 3)
        Row r, counted through all octaves, holds the components up to ``top * 2^(-r / 12)``;
        padded by wrap-around. All octaves but the last have 12 rows, and the first of the next
        at their own points: two neighbouring rows are read at the same place.
    length : float
        What a row covers, in mm or s; it repeats.
    origin : float
        Position of the first point, mm (0 for time).
    top : float
        Highest frequency in row 0, cycles/mm or Hz.
    seamless : bool
        Whether the end leads on to the beginning; else there is a jump, beside the screen.
    """

    octaves: tuple[FloatArray, ...]
    length: float
    origin: float
    top: float
    seamless: bool

    @property
    def n_points(self) -> int:
        """Points in a row of the first octave, the padding left out."""
        return int(self.octaves[0].shape[1]) - PAD

    @property
    def n_rows(self) -> int:
        """Rows, each counted once."""
        return ROWS_PER_OCTAVE * (len(self.octaves) - 1) + int(self.octaves[-1].shape[0])


@dataclass(frozen=True, slots=True)
class _Shape:
    """How large a table is.

    Attributes
    ----------
    n_rows : int
        Each counted once.
    n_points : int
        In a row of the first octave; a multiple of ``2^halvings``.
    halvings : int
        From octave to octave; one less than there are octaves.
    """

    n_rows: int
    n_points: int
    halvings: int

    @property
    def octaves(self) -> list[tuple[int, int]]:
        """Rows and points of each octave, the padding left out."""
        rows = [ROWS_PER_OCTAVE + 1] * self.halvings
        rows.append(self.n_rows - ROWS_PER_OCTAVE * self.halvings)
        return [(count, self.n_points >> octave) for octave, count in enumerate(rows)]

    @property
    def size(self) -> int:
        """Points of all rows."""
        return sum(rows * points for rows, points in self.octaves)


def fitting(components: Components, stretch_mm: tuple[float, float]) -> Components:
    """Leave out the finest spatial components where a table of all would take long to make.

    Only those go that no finger feels at `FULL_MM_S` or faster, and a note says so. A recording
    at 44.1 kHz has them in plenty. If that is not enough the components are returned as they
    are, for `build_table` to refuse.

    Parameters
    ----------
    components : Components
        A sum of sinusoids.
    stretch_mm : tuple of float
        As for `build_table`.
    """
    if not components.spatial:
        return components
    _, length = _stretch(components, stretch_mm)
    finest = np.sort(components.frequency)
    fast = bisect.bisect_right(
        finest, FAST_POINTS, key=lambda top: _shape(components, top, length).size
    )
    felt = int(np.searchsorted(finest, BAND_EDGE_HZ / FULL_MM_S, "right"))
    count = max(fast, felt)
    if count in (0, finest.size):
        return components
    if _shape(components, finest[count - 1], length).size > MAX_POINTS:
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


def build_table(components: Components, stretch_mm: tuple[float, float]) -> FrictionTable:
    """Sum the components into rows.

    Parameters
    ----------
    components : Components
        A sum of sinusoids.
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
    shape = _shape(components, top, length)
    if shape.size > MAX_POINTS:
        raise TextureError(
            f"{top:g} cycles/mm over {length:g} mm need a table of {shape.size} points; "
            f"at most {MAX_POINTS} are kept. Lower the highest frequency, the texture's length "
            "or the region's size"
        )
    row = np.floor(ROWS_PER_OCTAVE * np.log2(top / frequency) + 1e-9)
    # The last row that holds the component; `_sum_rows` writes there unchecked.
    last = np.clip(row, 0, shape.n_rows - 1).astype(np.int64)
    amplitude, phase = components.amplitude_n[kept], components.phase_rad[kept]
    octaves = []
    if components.period is not None:
        harmonic = np.rint(frequency * length).astype(np.int64)
        spectrum = np.zeros(int(harmonic.max()) + 1, dtype=complex)
        np.add.at(spectrum, harmonic, amplitude * np.exp(1j * phase))
        finest = np.zeros(shape.n_rows, dtype=np.int64)
        np.maximum.at(finest, last, harmonic)
        finest = np.maximum.accumulate(finest[::-1])[::-1]  # of each row
        for octave, (n_rows, n_points) in enumerate(shape.octaves):
            first = ROWS_PER_OCTAVE * octave
            octaves.append(_harmonic_rows(spectrum, finest[first : first + n_rows], n_points))
    else:
        angular = 2.0 * np.pi * frequency
        for octave, (n_rows, n_points) in enumerate(shape.octaves):
            rows = np.zeros((n_rows, n_points + PAD))
            within = last - ROWS_PER_OCTAVE * octave
            held = within >= 0
            _sum_rows(
                angular[held] * (length / n_points),
                amplitude[held],
                phase[held] + angular[held] * origin,
                np.minimum(within[held], n_rows - 1),
                rows,
            )
            octaves.append(rows)
    return FrictionTable(tuple(octaves), length, origin, top, components.period is not None)


def _harmonic_rows(
    spectrum: NDArray[np.complex128], finest: NDArray[np.int64], n_points: int
) -> FloatArray:
    """Sum the harmonics of one period into rows, by Fourier transforms.

    Parameters
    ----------
    spectrum : ndarray, shape (n_harmonics,)
        Complex amplitudes.
    finest : ndarray, shape (n_rows,)
        The highest harmonic that each row holds, 0 where it holds none.
    n_points : int
        In a row.
    """
    rows = np.empty((finest.size, n_points + PAD))
    for row, highest in zip(rows, finest, strict=True):
        row[1:-2] = fft.irfft(spectrum[: highest + 1], n_points)
    rows[:, 1:-2] *= n_points / 2.0
    rows[:, 0], rows[:, -2:] = rows[:, -3], rows[:, 1:3]
    return rows


def _stretch(components: Components, stretch_mm: tuple[float, float]) -> tuple[float, float]:
    """Return where rows begin, and what they cover, in mm or s."""
    if components.period is not None:
        return 0.0, components.period
    origin, end = stretch_mm if components.spatial else (0.0, 0.0)
    return origin, end - origin


def _shape(components: Components, top: float, length: float) -> _Shape:
    """Return the size of a table up to `top`; one over time has one row, whatever the speed."""
    n_rows = _row_count(top) if components.spatial else 1
    least = 8 if components.period is not None else max(math.ceil(length / WIDEST_MM), 8)
    fewest = max(math.ceil(POINTS_PER_CYCLE * top * length), least)
    spared = math.log2(fewest / max(FEWEST_POINTS, least))
    halvings = max(min((n_rows - 1) // ROWS_PER_OCTAVE, int(spared)), 0)
    coarsest = fft.next_fast_len(math.ceil(fewest / 2**halvings), real=True)
    return _Shape(n_rows, int(coarsest) << halvings, halvings)


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
        for n in range(1, n_points + 1):
            rows[r, n] += rows[r + 1, n]
    for r in range(rows.shape[0]):
        rows[r, 0] = rows[r, n_points]
        rows[r, n_points + 1] = rows[r, 1]
        rows[r, n_points + 2] = rows[r, 2]
