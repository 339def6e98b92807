"""The API at a router, as often as a test wants it."""

from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path

import pytest
from tests.service.dashboard.page import configuration, serving

Serve = Callable[..., AbstractContextManager[int]]


@pytest.fixture
def serve(tmp_path: Path) -> Serve:
    """Run the API at a router."""

    def start(router: str, tokens: bool = False) -> AbstractContextManager[int]:
        return serving(configuration(router, tmp_path, tokens))

    return start
