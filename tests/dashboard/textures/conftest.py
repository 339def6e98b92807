"""A lab whose finger strokes by itself, and the view of textures on a page."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, expect
from tests.dashboard.conftest import OpenPage
from tests.dashboard.lab import Lab, running
from tests.dashboard.textures.view import SPEED_MM_S, arrive

from frictus_hardware import SimulatedConfig
from frictus_hardware.simulated.strokes import SteadyStrokes

PATIENCE_MS = 30_000


@pytest.fixture(scope="package")
def lab(browser: object, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Lab]:
    """A daemon whose finger strokes by itself, for all tests of this folder."""
    finger = SteadyStrokes(speed_mm_s=SPEED_MM_S)
    folder = tmp_path_factory.mktemp("lab")
    with running(folder, backend=SimulatedConfig(finger=finger)) as lab:
        yield lab


@pytest.fixture(autouse=True)
def patience() -> Iterator[None]:
    """On a busy machine the first preview takes a while: compiled code is loaded for it."""
    expect.set_options(timeout=PATIENCE_MS)
    yield
    expect.set_options(timeout=5_000)


@pytest.fixture
def page(lab: Lab, open_page: OpenPage) -> Iterator[Page]:
    with open_page(expected="status of 4") as page:
        arrive(page, lab)
        yield page
