"""Whatever passes the wire's ranges is compiled and rendered within the drive, or refused."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.service.synthesis.strategies import coordinate, region

from frictus.errors import TextureError
from frictus.textures import Region, Scene
from frictus_hardware.physics.screen import Screen
from frictus_service.synthesis import compensator
from frictus_service.synthesis.compensability import inverse_of_model, placeholder_model
from frictus_service.synthesis.components import Components
from frictus_service.synthesis.estimator import PredictedMotion
from frictus_service.synthesis.kernel import BlockMotion
from frictus_service.synthesis.renderer import Renderer
from frictus_service.synthesis.scene import compile_scene
from frictus_service.synthesis.tables import build_table

pytestmark = pytest.mark.compiled

RATE_HZ, BLOCK = 20_000.0, 100
SCREEN = Screen()
LAW = inverse_of_model(placeholder_model(), SCREEN)


@settings(max_examples=30)
@given(region, st.tuples(*[coordinate] * 6), st.integers(0, 2**53))
def test_every_accepted_texture_renders_within_the_drive_or_is_refused(
    region: Region, motion: tuple[float, ...], first_sample: int
) -> None:
    try:
        compiled = compile_scene(Scene(regions=[region]), LAW, SCREEN, RATE_HZ)
    except TextureError:
        return
    assert 0.0 < compiled.applied.gain <= 1.0
    assert np.isfinite(compiled.applied.bias_n)
    renderer = Renderer(LAW, SCREEN, RATE_HZ, BLOCK, compiled)
    course = PredictedMotion(BlockMotion._make((*motion, abs(motion[2]), abs(motion[4]))))
    with np.errstate(all="ignore"):  # a motion that cannot be
        for block in range(2):
            rendered = renderer.render(first_sample + block * BLOCK, course, True)
            assert np.all((rendered.drive >= 0.0) & (rendered.drive <= 1.0))
            assert np.all(np.abs(rendered.voltage_v) <= SCREEN.peak_v * (1.0 + 1e-12))


@pytest.mark.parametrize("frequency", [5e-324, -1.0, 0.0, np.nan, np.inf, 1e300])
def test_components_that_no_table_holds_are_refused(frequency: float) -> None:
    two = np.array([50.0, frequency])
    with pytest.raises(TextureError, match="frequency"):
        Components(two, np.ones(2), np.zeros(2), True, None)


def test_a_component_far_below_the_others_is_in_the_last_row() -> None:
    """By its frequency it would belong 227 rows below the first; there are fewer."""
    two = np.array([50.0, 1e-4])
    table = build_table(Components(two, np.ones(2), np.zeros(2), True, None), (0.0, 40.0))
    assert table.n_rows < 227
    constant = table.octaves[-1][-1, 1:-2]
    assert np.allclose(constant, 1.0, atol=1e-3)


@pytest.mark.parametrize("drive", [np.nan, -1e9, -1e-300, 0.0, 1.0, 2.0, np.inf])
def test_a_drive_beyond_the_table_is_looked_up_within_it(drive: float) -> None:
    table = np.linspace(0.0, 1.0, 9)
    found = np.array([0.5, drive])
    compensator.look_up(table, found)
    assert found[0] == pytest.approx(0.5)
