"""A browser without a window, and pages of it that may not complain."""

import shutil
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager

import pytest
from playwright.sync_api import Browser, Page, sync_playwright

OpenPage = Callable[..., AbstractContextManager[Page]]


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    """The Chromium of this machine."""
    path = shutil.which("chromium") or shutil.which("chromium-browser")
    if path is None:
        pytest.skip("there is no chromium here: `apt-get install chromium` brings one")
    with sync_playwright() as playwright:
        # Its sandbox does not run as root, as whom containers run.
        launched = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
        yield launched
        launched.close()


@pytest.fixture(scope="session")
def open_page(browser: Browser) -> OpenPage:
    """Open a page; what it complains of, or asks elsewhere, fails the test."""

    @contextmanager
    def opened(expected: str = "nothing is expected", **options: object) -> Iterator[Page]:
        # Drawn by software, 60 pictures a second would take the cores that the rig needs.
        calm = {"viewport": {"width": 1280, "height": 800}, "reduced_motion": "reduce"}
        context = browser.new_context(**(calm | options))  # type: ignore[arg-type]
        page = context.new_page()
        page.set_default_timeout(20_000)
        complaints: list[str] = []
        hosts: set[str] = set()
        page.on(
            "console",
            lambda told: complaints.append(told.text) if told.type == "error" else None,
        )
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on("request", lambda request: hosts.add(request.url.split("/")[2]))
        try:
            yield page
        finally:
            context.close()
        assert [told for told in complaints if expected not in told] == []
        assert len(hosts - {""}) <= 1, f"it asked elsewhere: {hosts}"

    return opened
