"""A browser without a window, and pages of it that may not complain."""

import functools
import shutil
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, Page, sync_playwright
from tests.dashboard.lab import SCENE, Lab, arrive, running

from frictus_dashboard import FOLDER
from frictus_hardware import SimulatedConfig
from frictus_hardware.simulated.guided import ClientFinger

CHROMIUM = ("chromium-headless-shell", "chromium", "chromium-browser")
OpenPage = Callable[..., AbstractContextManager[Page]]


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    """The Chromium of this machine; without its windows it needs a fifth less time."""
    path = next(filter(None, map(shutil.which, CHROMIUM)), None)
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


@pytest.fixture(scope="module")
def lab(browser: object, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Lab]:
    """A daemon whose finger is a pointer's; none is started where there is no browser."""
    finger = SimulatedConfig(finger=ClientFinger())
    with running(tmp_path_factory.mktemp("lab"), backend=finger) as lab:
        lab.rig.set_scene(SCENE)
        yield lab


@pytest.fixture
def page(lab: Lab, open_page: OpenPage) -> Iterator[Page]:
    with open_page() as page:
        arrive(page, lab.url)
        yield page


class _Quiet(SimpleHTTPRequestHandler):
    def do_GET(self) -> None:
        """Serve files; browsers ask for an icon besides."""
        if self.path == "/favicon.ico":
            self.send_response(204)
            self.end_headers()
        else:
            super().do_GET()

    def log_message(self, format: str, *args: Any) -> None:
        """Say nothing."""


@contextmanager
def served(folder: Path) -> Iterator[str]:
    """Serve the files of a folder."""
    handler = functools.partial(_Quiet, directory=str(folder))
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield f"http://127.0.0.1:{server.server_address[1]}"
        server.shutdown()
        thread.join()


@pytest.fixture(scope="session")
def folder_url() -> Iterator[str]:
    """The page's files, without a service."""
    with served(FOLDER) as url:
        yield url
