"""Where campaigns that pytest runs keep their lines."""

from pathlib import Path

import pytest


@pytest.fixture
def lines_folder(pytestconfig: pytest.Config) -> Path:
    """Kept by pytest from run to run, so that a campaign goes on where it was stopped."""
    assert pytestconfig.cache is not None
    return pytestconfig.cache.mkdir("campaigns")
