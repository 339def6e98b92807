"""Maps: a grey image over a region, with a pyramid of ever smoother copies.

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
from frictus.textures import MAX_MAP_PIXELS, Map
from frictus_service.synthesis.tables import FADE_HZ, FASTEST_MM_S, ROWS_PER_OCTAVE

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
    """Return the image of a centred spectrum on another grid, padded by wrap-around."""
    out = np.zeros((rows, columns), dtype=complex)
    source, target = [], []
    for old, new in zip(spectrum.shape, (rows, columns), strict=True):
        reach_below, reach_above = min(old // 2, new // 2), min((old - 1) // 2, (new - 1) // 2)
        source.append(slice(old // 2 - reach_below, old // 2 + reach_above + 1))
        target.append(slice(new // 2 - reach_below, new // 2 + reach_above + 1))
    out[target[0], target[1]] = spectrum[source[0], source[1]]
    scale = rows * columns / spectrum.size
    image = np.fft.ifft2(np.fft.ifftshift(out)).real * scale
    return np.pad(image, ((1, 2), (1, 2)), mode="wrap").astype(np.float32)
