"""Compile a scene: tables for the kernel, and the one gain and bias that fit the drive.

The drive fraction must stay in [0, 1] wherever the finger is and however fast it moves. What a
layer asks of the drive is found by rendering it at every point and speed; the scene is then
scaled, once and for all speeds, and the scale is reported.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from frictus.errors import TextureError
from frictus.messages import Applied
from frictus.textures import Map, Region, Scene
from frictus_hardware.physics.friction import FrictionLaw, cutoff_hz
from frictus_hardware.physics.screen import Screen
from frictus_service.synthesis import kernel
from frictus_service.synthesis.components import Components, components_of
from frictus_service.synthesis.maps import build_pyramid, decode
from frictus_service.synthesis.tables import (
    BAND_EDGE_HZ,
    FADE_HZ,
    ROWS_PER_OCTAVE,
    Table,
    build_table,
)

FloatArray = NDArray[np.float64]

HEADROOM = 0.03
"""Share of the drive kept free for cross-fades and corrections of the finger's motion."""
NARROWEST_FADE_MM = 0.1
SPEEDS_MM_S = np.concatenate([[0.0], 2.0 ** (np.arange(100) / 12.0)])
"""Speeds at which the gain is made to fit, both ways: 0, and 1 to 300 mm/s."""


@dataclass(frozen=True, slots=True)
class CompiledScene:
    """What the renderer plays.

    Attributes
    ----------
    arrays : SceneArrays
        For the kernel, gain and bias included.
    applied : Applied
        What became of the request.
    source : str
        `scene` or `stream`.
    """

    arrays: kernel.SceneArrays
    applied: Applied
    source: str = "scene"


@dataclass(frozen=True, slots=True)
class _Layer:
    rectangle: tuple[float, float, float, float]
    gain: float
    edge_fade_mm: float
    kind: int
    table: Table | None
    angle_deg: float = 0.0
    levels: tuple[NDArray[np.float32], ...] = ()
    top: float = 0.0
    fades: bool = False
    """Whether a finger on the screen can cross an edge."""
    notes: tuple[str, ...] = ()


def compile_scene(
    scene: Scene, law: FrictionLaw, screen: Screen, sample_rate_hz: float
) -> CompiledScene:
    """Compile a scene for a screen and a friction law.

    Parameters
    ----------
    scene : Scene
    law : FrictionLaw
        Whose inverse will be played: it sets what the drive can reach.
    screen : Screen
    sample_rate_hz : float

    Returns
    -------
    CompiledScene
        `applied.gain` is below 1 where the scene was scaled to fit.

    Raises
    ------
    TextureError
        If a texture cannot be represented; the text names the region.
    """
    layers: list[_Layer] = []
    for number, region in enumerate(scene.regions):
        try:
            layers += _layers(region, screen)
        except TextureError as error:
            raise TextureError(
                f"regions.{number} {region.name}: {error}".replace(" :", ":")
            ) from error
    arrays = _arrays(layers)
    low, high = _reach(layers, arrays, law, sample_rate_hz)
    return fit(arrays, low, high, law, [note for layer in layers for note in layer.notes])


def fit(
    arrays: kernel.SceneArrays,
    low: float,
    high: float,
    law: FrictionLaw,
    notes: list[str],
    source: str = "scene",
) -> CompiledScene:
    """Scale layers so that the drive they ask for, `low` to `high`, fits with the bias."""
    swing = high - low
    feasible = 1.0 / swing if swing > 0.0 else np.inf
    gain = min(1.0, (1.0 - HEADROOM) * feasible)
    bias = -gain * low + HEADROOM / 2.0 if swing > 0.0 else 0.0
    real = arrays.real.copy()
    real[:, kernel.GAIN] *= gain
    applied = Applied(
        gain=gain,
        feasible_gain=min(feasible, 1e9),
        bias=bias,
        bias_n=bias * law.gain_n,
        scaled=gain < 1.0,
        speed_range_mm_s=(0.0, float(SPEEDS_MM_S[-1])),
        notes=notes,
    )
    return CompiledScene(arrays._replace(real=real, bias_n=bias * law.gain_n), applied, source)


def _layers(region: Region, screen: Screen) -> list[_Layer]:
    width, height = screen.size_mm
    rectangle = (*region.x_mm, *region.y_mm)
    x0, x1 = max(region.x_mm[0], 0.0), min(region.x_mm[1], width)
    y0, y1 = max(region.y_mm[0], 0.0), min(region.y_mm[1], height)
    if not (x0 < x1 and y0 < y1):
        raise TextureError(f"lies beside the screen of {width:g} x {height:g} mm")
    inner = (region.x_mm[0], width - region.x_mm[1], region.y_mm[0], height - region.y_mm[1])
    fades = max(inner) + max(region.edge_fade_mm, NARROWEST_FADE_MM) > 0.0
    if isinstance(region.texture, Map):
        cut = (x0, x1, y0, y1)  # a map is laid over what of the region is on the screen
        pyramid = build_pyramid(decode(region.texture), x1 - x0, y1 - y0)
        return [
            _Layer(
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
    for components in components_of(region.texture):
        table = build_table(components, _stretch(components, (x0, x1, y0, y1)))
        kind = kernel.SPATIAL if components.spatial else kernel.TEMPORAL
        layers.append(
            _Layer(
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


def _left_out(components: Components) -> tuple[str, ...]:
    beyond = 0 if components.spatial else np.count_nonzero(components.frequency > BAND_EDGE_HZ)
    note = f"{beyond} temporal components above {BAND_EDGE_HZ:g} Hz left out: they are not felt"
    return (note,) if beyond else ()


def _stretch(
    components: Components, rectangle: tuple[float, float, float, float]
) -> tuple[float, float]:
    """Return from where to where a rectangle reaches along the texture's direction."""
    x0, x1, y0, y1 = rectangle
    angle = np.deg2rad(components.angle_deg)
    corners = [x * np.cos(angle) + y * np.sin(angle) for x in (x0, x1) for y in (y0, y1)]
    # A predicted position may lie a little beside the screen; the texture goes on there.
    return float(min(corners)) - 5.0, float(max(corners)) + 5.0


def single_table(table: Table, spatial: bool, angle_deg: float) -> kernel.SceneArrays:
    """Return the arrays of one table that covers everything, at gain 1 and without bias."""
    layer = _Layer(
        (-1e9, 1e9, -1e9, 1e9),
        1.0,
        1.0,
        kernel.SPATIAL if spatial else kernel.TEMPORAL,
        table,
        angle_deg,
        top=table.top,
    )
    return _arrays([layer])


def _arrays(layers: list[_Layer]) -> kernel.SceneArrays:
    real = np.zeros((len(layers), 11))
    whole = np.zeros((len(layers), 4), dtype=np.int64)
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
            whole[row] = layer.kind, n_points, table.n_points, table.rows.shape[0]
            tables.append(table.rows.ravel())
            n_points += table.rows.size
        else:
            whole[row] = layer.kind, len(levels), 0, len(layer.levels)
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


def _reach(
    layers: list[_Layer], arrays: kernel.SceneArrays, law: FrictionLaw, sample_rate_hz: float
) -> tuple[float, float]:
    """Return least and greatest drive that the layers ask for, where they overlap together."""
    reach = np.array(
        [
            _layer_reach(layer, arrays, row, law, sample_rate_hz)
            for row, layer in enumerate(layers)
        ]
    ).reshape(-1, 2)
    reach *= arrays.real[:, kernel.GAIN, None] / law.gain_n
    low = high = 0.0
    for row in range(len(layers)):
        together = [
            other for other in range(len(layers)) if _overlap(layers[row], layers[other])
        ]
        low = min(low, float(reach[together, 0].sum()))
        high = max(high, float(reach[together, 1].sum()))
    return low, high


def _overlap(a: _Layer, b: _Layer) -> bool:
    ax0, ax1, ay0, ay1 = a.rectangle
    bx0, bx1, by0, by1 = b.rectangle
    return ax0 < bx1 and bx0 < ax1 and ay0 < by1 and by0 < ay1


def _layer_reach(
    layer: _Layer,
    arrays: kernel.SceneArrays,
    row: int,
    law: FrictionLaw,
    sample_rate_hz: float,
) -> tuple[float, float]:
    """Return least and greatest of ``(y[n+1] - a y[n]) / (1 - a)`` over places and speeds."""
    # While all of a texture is in the band it asks for the more the faster the finger is.
    telling = SPEEDS_MM_S * (layer.top if layer.kind != kernel.TEMPORAL else 0.0)
    speeds = SPEEDS_MM_S[(telling > 0.9 * BAND_EDGE_HZ) | (SPEEDS_MM_S == 0.0)]
    speeds = np.append(speeds, SPEEDS_MM_S[-1])
    decay = np.exp(-2.0 * np.pi * cutoff_hz(law, speeds) / sample_rate_hz)
    moved_mm = speeds / sample_rate_hz
    if layer.kind == kernel.MAP:
        low, high, size = _map_reach(layer, speeds, moved_mm, decay)
    else:
        assert layer.table is not None
        low, high, size = np.zeros((3, speeds.size))
        if layer.kind == kernel.SPATIAL:
            step = moved_mm * arrays.real[row, kernel.PER_STEP]
            rate = speeds
        else:
            per_sample = layer.table.n_points / layer.table.length / sample_rate_hz
            step = np.full(speeds.size, per_sample)
            rate = np.zeros(speeds.size)
        offset = arrays.real[row, kernel.LEVEL_OFFSET]
        seam = 0 if layer.table.seamless else int(step.max()) + 4
        _table_reach(
            arrays.points, arrays.whole[row], step, rate, offset, decay, seam, low, high, size
        )
    if layer.fades:
        # The edge is crossed at the speeds left out above too; the fastest asks for most.
        step = moved_mm * arrays.real[row, kernel.PER_FADE]
        low, high = -_at_edge(-low, size, step, decay), _at_edge(high, size, step, decay)
    return float(low.min()), float(high.max())


def _at_edge(
    high: FloatArray, size: FloatArray, step: FloatArray, decay: FloatArray
) -> FloatArray:
    """Return the greatest drive in the fade too; `size` is the largest friction, each speed.

    With the weight w the drive is ``w[n+1] m[n] + a (w[n+1] - w[n]) y[n] / (1 - a)``.
    """
    here = np.linspace(0.0, 1.0, 101)[:, None]
    inward, outward = _smooth(here + step), _smooth(here - step)
    slew = decay / (1.0 - decay) * size
    weight = _smooth(here)
    entering = inward * high + (inward - weight) * slew
    leaving = outward * high + (weight - outward) * slew
    greatest: FloatArray = np.maximum(entering, leaving).max(axis=0)
    return greatest


def _smooth(share: FloatArray) -> FloatArray:
    inside = np.clip(share, 0.0, 1.0)
    smooth: FloatArray = inside * inside * (3.0 - 2.0 * inside)
    return smooth


@njit(cache=True, nogil=True)
def _table_reach(points, whole, steps, rates, offset, decays, seam, low, high, size):  # type: ignore[no-untyped-def]
    for s in range(steps.size):
        decay = decays[s]
        for half in range(2 * seam, 2 * (whole[2] - seam)):
            u = 0.5 * half
            here = kernel._between_rows(points, whole, u, rates[s], offset)
            size[s] = max(size[s], abs(here))
            for way in (-1.0, 1.0):
                there = kernel._between_rows(
                    points, whole, u + way * steps[s], rates[s], offset
                )
                drive = (there - decay * here) / (1.0 - decay)
                low[s] = min(low[s], drive)
                high[s] = max(high[s], drive)


def _map_reach(
    layer: _Layer, speeds: FloatArray, moved_mm: FloatArray, decays: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Bound a map by value and steepest slope in any direction; the two need not coincide."""
    x0, x1, y0, y1 = layer.rectangle
    low, high, size = np.zeros((3, speeds.size))
    for s, (speed, moved, decay) in enumerate(zip(speeds, moved_mm, decays, strict=True)):
        octaves = np.log2(max(speed, 1e-3) * layer.top / FADE_HZ)
        level = int(np.clip(ROWS_PER_OCTAVE * octaves, 0, len(layer.levels) - 1))
        image = layer.levels[level].astype(float)
        rows, columns = image.shape[0] - 3, image.shape[1] - 3
        slope_y = _steepest(image, 0)[1:-2, 1:-2] * rows / (y1 - y0)
        slope_x = _steepest(image, 1)[1:-2, 1:-2] * columns / (x1 - x0)
        image = image[1:-2, 1:-2]
        step = moved * np.hypot(slope_x, slope_y) / (1.0 - decay)
        low[s] = min(0.0, float((image - step).min()))
        high[s] = max(0.0, float((image + step).max()))
        size[s] = float(np.abs(image).max())
    return low, high, size


def _steepest(image: FloatArray, axis: int) -> FloatArray:
    """Return the largest slope of the cubic through the pixels, at each and half-way around."""
    before, after, second = (np.roll(image, shift, axis) for shift in (1, -1, -2))
    halfway = np.abs(1.375 * (after - image) - 0.125 * (second - before))
    steepest: FloatArray = np.maximum(0.5 * np.abs(after - before), halfway)
    return np.maximum(steepest, np.roll(halfway, 1, axis))
