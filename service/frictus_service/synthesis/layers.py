"""The layers of a scene, maps among them: tables within regions, laid out for the kernel.

Maps: a grey image over a region, with a pyramid of ever smoother copies.

The phase of a component is k·x and its rate k·v, so a copy holds what stays in the tactile band
in every direction of motion: ``|k| |v|`` up to the band edge.
"""

import base64
import io
import struct
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from frictus.errors import TextureError
from frictus.textures import MAX_MAP_PIXELS, Beta, Map, Profile, Region, Slope, Spectrum
from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.screen import Screen
from frictus_service.synthesis import kernel
from frictus_service.synthesis.components import Components, components_of, profile_within
from frictus_service.synthesis.tables import (
    BAND_EDGE_HZ,
    BESIDE_MM,
    FADE_HZ,
    FASTEST_MM_S,
    ROWS_PER_OCTAVE,
    FrictionTable,
    build_table,
    fitting,
)

PIXELS_PER_CYCLE = 4
"""Of the finest component of a level."""
_HEADER = struct.Struct(">16xII")
"""Width and height stand first in every PNG, after signature and chunk name."""


@dataclass(frozen=True, slots=True)
class Pyramid:
    """Copies of an image; copy l holds what is coarser than ``top 2^(-l / 12)``.

    Attributes
    ----------
    levels : list of ndarray of float32, shape (height + 3, width + 3)
        Friction in N, padded by wrap-around: one pixel before, two after.
    top : float
        Finest frequency of level 0, cycles/mm.
    """

    levels: list[NDArray[np.float32]]
    top: float


def decode(texture: Map) -> NDArray[np.float64]:
    """Return the friction image, N, shape (height, width).

    Raises
    ------
    TextureError
        If the text is no PNG, or too large.
    """
    try:
        data = base64.b64decode(texture.image_png, validate=True)
        width, height = _HEADER.unpack_from(data)
    except (ValueError, struct.error) as error:
        raise TextureError("image_png is not a base64 PNG") from error
    # Asked before Pillow is: what it says to a picture of gigabytes is no TextureError.
    if width * height > MAX_MAP_PIXELS or min(width, height) < 2:
        raise TextureError(f"image of {width} x {height}: 2 x 2 up to {MAX_MAP_PIXELS} pixels")
    try:
        image = Image.open(io.BytesIO(data), formats=["PNG"])
    except (OSError, ValueError) as error:
        raise TextureError("image_png is not a base64 PNG") from error
    try:
        sixteen_bit = image.mode.startswith("I")
        grey = np.asarray(image if sixteen_bit else image.convert("L"), dtype=float)
    except (OSError, SyntaxError, ValueError) as error:
        raise TextureError(f"image_png cannot be read: {error}") from error
    share = grey / (65535.0 if sixteen_bit else 255.0)
    return texture.black_n + share * (texture.white_n - texture.black_n)


def build_pyramid(
    friction_n: NDArray[np.float64], width_mm: float, height_mm: float
) -> Pyramid:
    """Return the copies of an image that covers `width_mm` x `height_mm`; its mean is removed.

    Parameters
    ----------
    friction_n : ndarray, shape (height, width)
    width_mm, height_mm : float
        Of the region.
    """
    rows, columns = friction_n.shape
    spectrum = np.fft.fftshift(np.fft.fft2(friction_n - friction_n.mean()))
    kx = np.fft.fftshift(np.fft.fftfreq(columns, width_mm / columns))
    ky = np.fft.fftshift(np.fft.fftfreq(rows, height_mm / rows))
    fineness = np.hypot(kx[None, :], ky[:, None])
    top = float(fineness.max())
    octaves = np.log2(max(top * FASTEST_MM_S / FADE_HZ, 1.0))
    levels = []
    for level in range(int(np.ceil(ROWS_PER_OCTAVE * octaves)) + 2):
        limit = top * 2.0 ** (-level / ROWS_PER_OCTAVE)
        kept = np.where(fineness <= limit * (1.0 + 1e-9), spectrum, 0.0)
        size = [
            max(int(np.ceil(PIXELS_PER_CYCLE * min(limit, count / (2 * span)) * span)), 8)
            for count, span in ((rows, height_mm), (columns, width_mm))
        ]
        levels.append(_resample(kept, size[0], size[1]))
    return Pyramid(levels, top)


def _resample(spectrum: NDArray[np.complex128], rows: int, columns: int) -> NDArray[np.float32]:
    """Return the image of a centred spectrum on another grid, padded by wrap-around.

    What reading between pixels takes from each wave is added before: at four pixels to a cycle
    it is 0.55 dB.
    """
    out = np.zeros((rows, columns), dtype=complex)
    source, target, response = [], [], []
    for old, new in zip(spectrum.shape, (rows, columns), strict=True):
        reach_below, reach_above = min(old // 2, new // 2), min((old - 1) // 2, (new - 1) // 2)
        source.append(slice(old // 2 - reach_below, old // 2 + reach_above + 1))
        target.append(slice(new // 2 - reach_below, new // 2 + reach_above + 1))
        response.append(_cubic_response(np.arange(-reach_below, reach_above + 1) / new))
    out[target[0], target[1]] = spectrum[source[0], source[1]] / np.outer(*response)
    scale = rows * columns / spectrum.size
    image = np.fft.ifft2(np.fft.ifftshift(out)).real * scale
    return np.pad(image, ((1, 2), (1, 2)), mode="wrap").astype(np.float32)


def _cubic_response(cycles_per_pixel: FloatArray) -> FloatArray:
    """Return what the cubic of `kernel` leaves of waves through pixels, 1 of a constant.

    The transform of the kernel: R. G. Keys, Cubic convolution interpolation for digital image
    processing, IEEE Transactions on Acoustics, Speech, and Signal Processing 29 (1981).

    Parameters
    ----------
    cycles_per_pixel : ndarray, shape (n_waves,)
    """
    response = np.ones(cycles_per_pixel.size)
    f = cycles_per_pixel[cycles_per_pixel != 0.0]
    once, twice, fourfold = np.sinc(f), np.sinc(2.0 * f), np.sinc(4.0 * f)
    level = 3.0 * (once**2 - twice) - (3.0 * twice**2 - 2.0 * twice - fourfold)
    response[cycles_per_pixel != 0.0] = level / (np.pi * f) ** 2
    return response


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
        squeezed = x1 - x0 not in (width, np.ptp(region.x_mm)) or (
            y1 - y0 not in (height, np.ptp(region.y_mm))
        )
        note = f"the map is laid over the {x1 - x0:g} x {y1 - y0:g} mm that are on the screen"
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
                notes=(note,) if squeezed else (),
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
    return float(min(corners)) - BESIDE_MM, float(max(corners)) + BESIDE_MM


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
