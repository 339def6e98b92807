"""Maps: grey levels become friction, and fine detail vanishes as the finger gets faster."""

import base64
import io
import struct
import zlib

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from frictus.errors import TextureError
from frictus.textures import Map, Region, Scene
from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.friction import FrictionLaw
from frictus_hardware.physics.screen import Screen
from frictus_service.synthesis import kernel
from frictus_service.synthesis.kernel import BlockMotion
from frictus_service.synthesis.layers import build_pyramid, decode
from frictus_service.synthesis.scene import compile_scene

RATE = 20_000.0
WIDTH, HEIGHT = 64.0, 32.0  # mm, in the corner of the screen


def png(grey: NDArray[np.uint8] | NDArray[np.uint16], mode: str | None = None) -> str:
    file = io.BytesIO()
    image = Image.fromarray(grey)
    (image.convert(mode) if mode else image).save(file, "PNG")
    return base64.b64encode(file.getvalue()).decode()


def header_of(width: int, height: int) -> str:
    """A PNG that says how large it is, and then ends."""

    def chunk(name: bytes, data: bytes) -> bytes:
        return (
            struct.pack(">I", len(data))
            + name
            + data
            + struct.pack(">I", zlib.crc32(name + data))
        )

    head = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0))
    whole = b"\x89PNG\r\n\x1a\n" + head + chunk(b"IDAT", zlib.compress(b"\0\0")[:4])
    return base64.b64encode(whole).decode()


def grating(kx: float, ky: float, columns: int = 512, rows: int = 256) -> FloatArray:
    """``cos(2 pi (kx x + ky y))`` at the pixels of the region, cycles/mm."""
    x = np.arange(columns) * WIDTH / columns
    y = np.arange(rows) * HEIGHT / rows
    return np.cos(2.0 * np.pi * (kx * x[None, :] + ky * y[:, None]))


def felt(image: str, x: float, y: float, vx: float, vy: float, n_samples: int) -> FloatArray:
    """Friction along a straight way, bias removed, at the gain asked for."""
    region = Region(
        texture=Map(image_png=image, black_n=-0.05, white_n=0.05),
        x_mm=(0.0, WIDTH),
        y_mm=(0.0, HEIGHT),
        gain=0.2,
        edge_fade_mm=0.5,
    )
    scene = compile_scene(Scene(regions=[region]), FrictionLaw(), Screen(), RATE)
    assert scene.applied.gain == 1.0
    out = np.empty(n_samples)
    speed = float(np.hypot(vx, vy))
    kernel.target_friction(
        scene.arrays, BlockMotion(x, y, vx, vy, vx, vy, speed, speed), 0, RATE, out
    )
    return (out - scene.arrays.bias_n) / (0.2 * 0.05)


@pytest.mark.parametrize(
    ("kx", "ky", "vx", "vy"),
    [
        (0.5, 0.0, 60.0, 0.0),
        (1.5, 0.0, -60.0, 0.0),
        (0.0, 0.5, 0.0, 40.0),
        (0.5, 0.5, 50.0, 20.0),
        (0.75, -0.5, 30.0, -20.0),
        (0.5, 0.0, 0.0, 40.0),
    ],
    ids=["along x", "finer, back", "along y", "diagonal", "other diagonal", "across"],
)
@pytest.mark.parametrize("bits", [8, 16])
def test_a_grating_is_felt_as_a_cosine(
    kx: float, ky: float, vx: float, vy: float, bits: int
) -> None:
    top = 2**bits - 1
    grey = np.rint((1.0 + grating(kx, ky)) / 2.0 * top)
    image = png(grey.astype(np.uint8) if bits == 8 else grey.astype(np.uint16))
    x = 5.0 if vx >= 0.0 else 50.0
    y = 5.0 if vy >= 0.0 else 25.0
    got = felt(image, x, y, vx, vy, 8_000)
    t = np.arange(8_000) / RATE
    want = np.cos(2.0 * np.pi * (kx * (x + vx * t) + ky * (y + vy * t)))
    assert np.sqrt(np.mean(np.square(got - want))) < (0.02 if bits == 8 else 0.015)


@pytest.mark.parametrize(
    ("x_mm", "y_mm", "size"),
    [
        ((-1_000.0, 1_000.0), (-1_000.0, 1_000.0), None),
        ((10.0, 30.0), (-5.0, 60.0), None),
        ((60.0, 80.0), (0.0, 35.0), "10 x 35 mm"),
        ((10.0, 30.0), (-5.0, 15.0), "20 x 15 mm"),
    ],
    ids=["all of the screen", "its whole height", "beyond its right", "beyond its top"],
)
def test_a_map_that_is_squeezed_onto_the_screen_says_so(
    x_mm: tuple[float, float], y_mm: tuple[float, float], size: str | None
) -> None:
    image = png(np.tile(np.array([0, 255], np.uint8), (16, 8)))
    region = Region(texture=Map(image_png=image, white_n=0.02), x_mm=x_mm, y_mm=y_mm)
    scene = compile_scene(Scene(regions=[region]), FrictionLaw(), Screen(), RATE)
    told = f"the map is laid over the {size} that are on the screen"
    assert scene.applied.notes == ([told] if size else [])


def test_grey_levels_become_newtons() -> None:
    ramp = np.tile(np.arange(256, dtype=np.uint8), (4, 1))
    friction = decode(Map(image_png=png(ramp), black_n=0.1, white_n=-0.4))
    np.testing.assert_allclose(friction, 0.1 - 0.5 * ramp / 255.0)
    fine = np.array([[0, 257], [32_768, 65_535]], dtype=np.uint16)
    friction = decode(Map(image_png=png(fine), black_n=0.0, white_n=1.0))
    np.testing.assert_allclose(friction, fine / 65_535.0)


@pytest.mark.parametrize("mode", ["L", "RGB", "RGBA", "P", "1"])
def test_other_pictures_are_taken_as_grey(mode: str) -> None:
    checks = (np.indices((16, 16)).sum(axis=0) % 2 * 255).astype(np.uint8)
    friction = decode(Map(image_png=png(checks, mode), white_n=1.0))
    np.testing.assert_allclose(friction, checks / 255.0, atol=0.01)


@pytest.mark.parametrize(
    "text",
    [
        "abc$",
        "éééé",
        base64.b64encode(b"no picture at all, and too long for a header").decode(),
        base64.b64encode(b"short").decode(),
        base64.b64encode(b"\x89PNG\r\n\x1a\n" + bytes(8) + struct.pack(">II", 8, 8)).decode(),
    ],
    ids=["not base64", "not ASCII", "text", "short", "no chunk"],
)
def test_what_is_no_png_is_refused(text: str) -> None:
    with pytest.raises(TextureError, match="image"):
        decode(Map(image_png=text, white_n=1.0))


def test_a_torn_png_is_refused() -> None:
    with pytest.raises(TextureError, match="cannot be read"):
        decode(Map(image_png=header_of(16, 16), white_n=1.0))


@pytest.mark.parametrize(
    ("width", "height"), [(1, 8), (8, 1), (513, 512), (12_000, 9_000), (60_000, 60_000)]
)
def test_pictures_that_are_too_large_or_too_small_are_refused(width: int, height: int) -> None:
    with pytest.raises(TextureError, match=f"image of {width} x {height}: 2 x 2 up to 262144"):
        decode(Map(image_png=header_of(width, height), white_n=1.0))


@pytest.mark.long
def test_fine_detail_vanishes_above_the_band_and_coarse_detail_stays() -> None:
    fine, coarse = 3.0, 0.25  # cycles/mm
    grey = np.rint(127.5 * (1.0 + 0.5 * grating(fine, 0.0) + 0.5 * grating(coarse, 0.0)))
    image = png(grey.astype(np.uint8))

    def amplitude(cycles_per_mm: float, speed: float) -> float:
        n_samples = round(48.0 / speed * RATE)  # a whole number of periods of both
        got = felt(image, 4.0, 16.0, speed, 0.0, n_samples)
        x = speed * np.arange(n_samples) / RATE
        return float(2.0 * abs(np.mean(got * np.exp(2j * np.pi * cycles_per_mm * x))))

    for speed in (20.0, 100.0, 370.0):  # up to 1110 Hz
        assert amplitude(fine, speed) == pytest.approx(0.5, rel=0.1)
        assert amplitude(coarse, speed) == pytest.approx(0.5, rel=0.03)
    for speed in (425.0, 600.0):
        assert amplitude(fine, speed) < 0.005
        assert amplitude(coarse, speed) == pytest.approx(0.5, rel=0.03)


@pytest.mark.parametrize(
    ("kx", "ky", "speed"),
    [(3.0, 0.0, 100.0), (3.0, 0.0, 370.0), (0.0, 3.0, 370.0), (2.0, 2.0, 390.0)],
    ids=["300 Hz", "1110 Hz", "1110 Hz along y", "1103 Hz along the diagonal"],
)
def test_a_map_is_as_strong_at_the_edge_of_the_band_as_below(
    kx: float, ky: float, speed: float
) -> None:
    """Reading between pixels took 0.3 to 0.5 dB of what is finest at a speed."""
    k = np.hypot(kx, ky)
    vx, vy = speed * kx / k, speed * ky / k
    grey = np.rint((1.0 + grating(kx, ky)) / 2.0 * 65_535.0).astype(np.uint16)
    n_samples = round(8.0 / k / speed * 3.0 * RATE)
    got = felt(png(grey), 4.0, 4.0, vx, vy, n_samples)
    t = np.arange(n_samples) / RATE
    phase = 2.0 * np.pi * (kx * (4.0 + vx * t) + ky * (4.0 + vy * t))
    waves = np.column_stack([np.cos(phase), np.sin(phase), np.ones_like(phase)])
    (cosine, sine, _), *_ = np.linalg.lstsq(waves, got)
    assert 20.0 * np.log10(np.hypot(cosine, sine)) == pytest.approx(0.0, abs=0.01)


def as_read(level: NDArray[np.float32]) -> FloatArray:
    """A level of a pyramid as the kernel reads it, four places to a pixel either way."""
    height, width = level.shape[0] - 3, level.shape[1] - 3
    shape = np.array([0, width, height])
    return np.array(
        [
            [
                kernel._bicubic(level.ravel(), shape, x, y)
                for x in np.arange(4 * width) / (4 * width)
            ]
            for y in np.arange(4 * height) / (4 * height)
        ]
    )


def test_every_level_keeps_what_it_should(rng: np.random.Generator) -> None:
    friction = rng.uniform(-1.0, 1.0, (48, 96))
    pyramid = build_pyramid(friction, WIDTH, HEIGHT)
    spectrum = np.fft.fft2(friction - friction.mean()) / friction.size
    k = np.hypot(
        np.fft.fftfreq(96, WIDTH / 96)[None, :], np.fft.fftfreq(48, HEIGHT / 48)[:, None]
    )
    assert pyramid.top == pytest.approx(float(k.max()))
    # Between samples a wave at half their rate is a cosine, of half the power of the samples.
    power = np.square(np.abs(spectrum)) * np.where(np.arange(96) == 48, 0.5, 1.0)
    power *= np.where(np.arange(48) == 24, 0.5, 1.0)[:, None]
    for number, level in enumerate(pyramid.levels):
        inner = as_read(level)
        kept = power[k <= pyramid.top * 2.0 ** (-number / 12.0) * (1.0 + 1e-9)].sum()
        assert float(np.mean(inner.astype(float)) ** 2) < 1e-10
        assert float(np.var(inner)) == pytest.approx(kept, rel=0.005, abs=1e-9)
