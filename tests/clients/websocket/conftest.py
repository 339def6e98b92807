"""A rig whose finger follows clients, and the API beside it."""

from collections.abc import Iterator

import pytest
from tests.service.dashboard.page import configuration, rig_that_follows_pages, serving


@pytest.fixture(scope="package")
def router() -> Iterator[str]:
    """The rig's."""
    with rig_that_follows_pages() as endpoint:
        yield endpoint


@pytest.fixture(scope="package")
def port(router: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[int]:
    """The API's, with tokens."""
    with serving(configuration(router, tmp_path_factory.mktemp("api"), True)) as port:
        yield port
