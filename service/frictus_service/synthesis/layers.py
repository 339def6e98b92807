"""The layers of a scene: each one table within one region, laid out for the kernel."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from frictus.errors import TextureError
from frictus.textures import Beta, Map, Profile, Region, Slope, Spectrum
from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.screen import Screen
from frictus_service.synthesis import kernel
from frictus_service.synthesis.components import Components, components_of, profile_within
from frictus_service.synthesis.maps import build_pyramid, decode
from frictus_service.synthesis.tables import (
    BAND_EDGE_HZ,
    FADE_HZ,
    ROWS_PER_OCTAVE,
    FrictionTable,
    build_table,
    fitting,
)

NARROWEST_FADE_MM = 0.1
NARROWEST_MM = 1e-3
"""Of a region, as far as it lies on the screen."""


@dataclass(frozen=True, slots=True)
class Layer:
    """One table, or one map, within one region.

    Attributes
    ----------
    rectangle : tuple of float
        x from, to, y from, to, mm.
    gain, edge_fade_mm : float
        Of the region.
    kind : int
        `kernel.SPATIAL`, `TEMPORAL` or `MAP`.
    table : FrictionTable or None
        None for a map.
    angle_deg : float
        Direction of the phase, from x towards y.
    levels : tuple of ndarray
        Of a map, as `maps.Pyramid` holds them.
    top : float
        Highest frequency, cycles/mm or Hz.
    fades : bool
        Whether a finger on the screen can cross an edge.
    notes : tuple of str
        What was rounded or left out.
    """

    rectangle: tuple[float, float, float, float]
    gain: float
    edge_fade_mm: float
    kind: int
    table: FrictionTable | None
    angle_deg: float = 0.0
    levels: tuple[NDArray[np.float32], ...] = ()
    top: float = 0.0
    fades: bool = False
    notes: tuple[str, ...] = ()

    @property
    def size_bytes(self) -> int:
        """What its table or map takes."""
        arrays = self.levels if self.table is None else self.table.octaves
        return sum(array.nbytes for array in arrays)


def layers_of(region: Region, screen: Screen) -> list[Layer]:
    """Return the layers of a region: a texture with spatial and temporal components makes two.

    Raises
    ------
    TextureError
        If the texture cannot be represented, or the region lies beside the screen.
    """
    width, height = screen.size_mm
    rectangle = (*region.x_mm, *region.y_mm)
    x0, x1 = max(region.x_mm[0], 0.0), min(region.x_mm[1], width)
    y0, y1 = max(region.y_mm[0], 0.0), min(region.y_mm[1], height)
    if not min(x1 - x0, y1 - y0) >= NARROWEST_MM:
        raise TextureError(
            f"lies beside the screen of {width:g} x {height:g} mm, or less than "
            f"{NARROWEST_MM:g} mm of it on the screen"
        )
    inner = (region.x_mm[0], width - region.x_mm[1], region.y_mm[0], height - region.y_mm[1])
    fades = max(inner) + max(region.edge_fade_mm, NARROWEST_FADE_MM) > 0.0
    if isinstance(region.texture, Map):
        cut = (x0, x1, y0, y1)  # a map is laid over what of the region is on the screen
        pyramid = build_pyramid(decode(region.texture), x1 - x0, y1 - y0)
        return [
            Layer(
                cut,
                region.gain,
                region.edge_fade_mm,
                kernel.MAP,
                None,
                levels=tuple(pyramid.levels),
                top=pyramid.top,
                fades=True,
            )
        ]
    layers = []
    for whole in _sums_of(region.texture, (x0, x1, y0, y1)):
        stretch_mm = _stretch(whole.angle_deg, (x0, x1, y0, y1))
        components = fitting(whole, stretch_mm)
        table = build_table(components, stretch_mm)
        kind = kernel.SPATIAL if components.spatial else kernel.TEMPORAL
        layers.append(
            Layer(
                rectangle,
                region.gain,
                region.edge_fade_mm,
                kind,
                table,
                components.angle_deg,
                top=table.top,
                fades=fades,
                notes=components.notes + _left_out(components),
            )
        )
    return layers


def _sums_of(
    texture: Spectrum | Profile | Beta | Slope, rectangle: tuple[float, float, float, float]
) -> list[Components]:
    if isinstance(texture, Profile) and texture.period_mm is not None:
        return [profile_within(texture, _stretch(texture.angle_deg, rectangle))]
    return components_of(texture)


def _left_out(components: Components) -> tuple[str, ...]:
    beyond = 0 if components.spatial else np.count_nonzero(components.frequency > BAND_EDGE_HZ)
    note = f"{beyond} temporal components above {BAND_EDGE_HZ:g} Hz left out: they are not felt"
    return (note,) if beyond else ()


def _stretch(
    angle_deg: float, rectangle: tuple[float, float, float, float]
) -> tuple[float, float]:
    """Return from where to where a rectangle reaches along a direction."""
    x0, x1, y0, y1 = rectangle
    angle = np.deg2rad(angle_deg)
    corners = [x * np.cos(angle) + y * np.sin(angle) for x in (x0, x1) for y in (y0, y1)]
    # A predicted position may lie a little beside the screen; the texture goes on there.
    return float(min(corners)) - 5.0, float(max(corners)) + 5.0


def single_table(table: FrictionTable, spatial: bool, angle_deg: float) -> kernel.SceneArrays:
    """Return the arrays of one table that covers everything, at gain 1 and without bias."""
    layer = Layer(
        (-1e9, 1e9, -1e9, 1e9),
        1.0,
        1.0,
        kernel.SPATIAL if spatial else kernel.TEMPORAL,
        table,
        angle_deg,
        top=table.top,
    )
    return arrays_of([layer])


def arrays_of(layers: list[Layer]) -> kernel.SceneArrays:
    """Return layers as the kernel reads them, without bias."""
    real = np.zeros((len(layers), 11))
    whole = np.zeros((len(layers), 5), dtype=np.int64)
    tables: list[FloatArray] = []
    levels: list[tuple[int, int, int]] = []
    pixels: list[NDArray[np.float32]] = []
    n_points = n_pixels = 0
    for row, layer in enumerate(layers):
        angle = np.deg2rad(layer.angle_deg)
        real[row, : kernel.PER_FADE] = layer.rectangle
        real[row, kernel.PER_FADE] = 1.0 / max(layer.edge_fade_mm, NARROWEST_FADE_MM)
        real[row, kernel.GAIN] = layer.gain
        real[row, kernel.COS], real[row, kernel.SIN] = np.cos(angle), np.sin(angle)
        real[row, kernel.LEVEL_OFFSET] = ROWS_PER_OCTAVE * np.log2(layer.top / FADE_HZ)
        if layer.table is not None:
            table = layer.table
            real[row, kernel.ORIGIN] = table.origin
            real[row, kernel.PER_STEP] = (
                table.n_points / table.length
                if layer.kind == kernel.SPATIAL
                else 1.0 / table.length
            )
            halvings = len(table.octaves) - 1
            whole[row] = layer.kind, n_points, table.n_points, table.n_rows, halvings
            tables += [rows.ravel() for rows in table.octaves]
            n_points += sum(rows.size for rows in table.octaves)
        else:
            whole[row] = layer.kind, len(levels), 0, len(layer.levels), 0
            for level in layer.levels:
                levels.append((n_pixels, level.shape[1] - 3, level.shape[0] - 3))
                pixels.append(level.ravel())
                n_pixels += level.size
    return kernel.SceneArrays(
        real,
        whole,
        np.concatenate(tables) if tables else np.zeros(1),
        np.array(levels, dtype=np.int64).reshape(-1, 3),
        np.concatenate(pixels) if pixels else np.zeros(1, dtype=np.float32),
        0.0,
    )
