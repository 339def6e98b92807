"""The API at a router, as often as a test wants it, and a rig that follows pages."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from pathlib import Path

import pytest
from tests.service.dashboard.page import configuration, rig_that_follows_pages, serving

Serve = Callable[..., AbstractContextManager[int]]


@pytest.fixture
def serve(tmp_path: Path) -> Serve:
    """Run the API at a router."""

    def start(
        router: str, tokens: bool = False, origins: tuple[str, ...] = ()
    ) -> AbstractContextManager[int]:
        return serving(configuration(router, tmp_path, tokens, origins))

    return start


@pytest.fixture(scope="module")
def router() -> Iterator[str]:
    """A rig whose finger follows pages."""
    with rig_that_follows_pages() as endpoint:
        yield endpoint


@pytest.fixture(scope="module")
def port(router: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[int]:
    """The API beside it, with tokens."""
    with serving(configuration(router, tmp_path_factory.mktemp("api"), True)) as port:
        yield port
