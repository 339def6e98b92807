"""The kernel in C renders what the kernel renders, whatever the texture."""

import base64
import io
from collections.abc import Iterator

import matplotlib.image
import numpy as np
import pytest

from frictus.textures import Component, Map, Region, Scene, Spectrum
from frictus_laboratory.benchmarks import kernel as figures
from frictus_laboratory.benchmarks.kernel import (
    NativeKernel,
    NoCompilerError,
    Pass,
    native_kernel,
    require_agreement,
    shipped_scene,
    strokes,
)
from frictus_service.synthesis import kernel
from frictus_service.synthesis.kernel import BlockMotion
from frictus_service.synthesis.scene import CompiledScene, compile_scene


@pytest.fixture(scope="module")
def native() -> Iterator[NativeKernel]:
    try:
        with native_kernel() as library:
            yield library
    except NoCompilerError as error:
        pytest.skip(str(error))


def compiled(scene: Scene) -> CompiledScene:
    return compile_scene(scene, figures.LAW, figures.SCREEN, figures.RATE_HZ)


def of_every_kind(rng: np.random.Generator) -> Scene:
    png = io.BytesIO()
    matplotlib.image.imsave(png, rng.uniform(size=(24, 32)), cmap="gray", format="png")
    both = Spectrum(
        components=[
            Component(amplitude_n=0.01, cycles_per_mm=1.3, phase_rad=0.4),
            Component(amplitude_n=0.01, hz=120.0),
        ],
        angle_deg=30.0,
    )
    grey = Map(image_png=base64.b64encode(png.getvalue()).decode(), white_n=0.02)
    return Scene(
        regions=[
            Region(texture=both, x_mm=(5.0, 40.0), edge_fade_mm=2.0),
            Region(texture=grey, x_mm=(20.0, 65.0), y_mm=(3.0, 30.0)),
        ]
    )


def wild(rng: np.random.Generator, count: int) -> list[BlockMotion]:
    """Motions of all directions and speeds, some of them off the screen."""
    low = [-5.0, -5.0, -400.0, -400.0, -400.0, -400.0, 0.0, 0.0]
    high = [75.0, 40.0, 400.0, 400.0, 400.0, 400.0, 400.0, 400.0]
    return [BlockMotion(*rng.uniform(low, high).tolist()) for _ in range(count)]


def test_c_equals_the_kernel_for_every_kind_of_texture(
    native: NativeKernel, rng: np.random.Generator
) -> None:
    scene = compiled(of_every_kind(rng))
    for samples in (1, 100):
        one, other = (Pass(functions, scene, samples) for functions in (kernel, native))
        require_agreement(one, other, wild(rng, 200))
        assert np.any(one.voltage_v)


def test_c_counts_what_the_kernel_counts(
    native: NativeKernel, rng: np.random.Generator
) -> None:
    (motion,) = wild(rng, 1)
    friction_n = rng.uniform(-1.0, 1.0, 101)
    counts = [
        run.invert(
            figures.LAW_TUPLE, motion, 2e4, friction_n[:-1], friction_n[-1], np.zeros(100)
        )
        for run in (kernel, native)
    ]
    assert counts[0] == counts[1]
    assert counts[0][0] > 0


def test_other_volts_are_not_accepted() -> None:
    scene = shipped_scene()
    quiet = compiled(Scene())
    with pytest.raises(figures.DisagreementError, match=r"kernel\.c"):
        require_agreement(Pass(kernel, scene, 50), Pass(kernel, quiet, 50), strokes(20, 50))


def test_without_a_compiler_the_ratio_is_missing_and_says_why(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("PATH", "")
    measured = {figure.name: figure for figure in figures.measure(repeats=1)}
    assert set(measured) == {"kernel", "kernel_functions", "render_block"}
    whole = measured["kernel"]
    assert whole.value["numba"] > 0.0
    assert whole.ratio is None
    assert whole.met is None
    assert "compiler" in whole.remark
