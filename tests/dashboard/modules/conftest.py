"""A page that imports one module at a time: the pure ones need nothing else of it."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Page
from tests.dashboard.conftest import OpenPage


@pytest.fixture(scope="module")
def page(open_page: OpenPage, folder_url: str) -> Iterator[Page]:
    with open_page() as page:
        page.goto(f"{folder_url}/style.css")
        yield page
