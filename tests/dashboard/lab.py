"""A lab that a page looks at: a real daemon, and what a test asks of it beside the page."""

import json
import threading
import urllib.request
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, TypeVar

from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Page, expect
from tests.patience import PATIENT, PATIENT_LEASE_MS

import frictus
from frictus.keys import Topics
from frictus_service.api.server import run_api
from frictus_service.config import (
    ApiConfig,
    Config,
    Limits,
    RegistryConfig,
    RouterConfig,
    Token,
)
from frictus_service.daemon.processes.child_process import PartName
from frictus_service.daemon.processes.supervisor import Supervisor
from frictus_service.processes import free_endpoint, free_port

READER = "a-token-that-only-reads"
RULES = {
    "runOnly": ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa"],
    # What is met is only counted: to name where takes as long as to look.
    "resultTypes": ["violations"],
}
State = TypeVar("State", frictus.RigStatus, frictus.SceneState, frictus.FingerState)
TOPICS = {
    frictus.RigStatus: Topics.STATUS,
    frictus.SceneState: Topics.SCENE,
    frictus.FingerState: Topics.FINGER,
}


TEXTURE = frictus.Spectrum(
    components=[
        frictus.Component(amplitude_n=0.02, cycles_per_mm=turns)
        for turns in (0.9, 1.3, 2.0, 3.1, 4.7)
    ]
)
SCENE = frictus.Scene(name="lines", regions=[frictus.Region(texture=TEXTURE, name="Lines")])


@dataclass(frozen=True)
class Lab:
    """A service that runs, and a client of its router."""

    config: Config
    supervisor: Supervisor
    client: frictus.Client

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.config.api.port}"

    @property
    def rig(self) -> frictus.Rig:
        return self.client.rig(self.config.rig)

    def ask(self, method: str, path: str, body: Any = None, **headers: str) -> Any:
        """Return what the REST API answers; None for nothing."""
        asked = urllib.request.Request(
            f"{self.url}/v1{path}",
            method=method,
            data=None if body is None else json.dumps(body).encode(),
            headers={"Content-Type": "application/json", **headers},
        )
        with urllib.request.urlopen(asked, timeout=30.0) as answer:
            text = answer.read()
            return json.loads(text) if text else None

    def first(self, kind: type[State], holds: Callable[[State], bool]) -> State:
        """Return the first message of a kind for which something holds."""
        with self.rig.watch(TOPICS[kind], timeout_s=60.0) as states:
            for state in states:
                assert isinstance(state, kind)
                if holds(state):
                    return state
        raise AssertionError("the feed has ended")

    def status(self, holds: Callable[[frictus.RigStatus], bool]) -> frictus.RigStatus:
        return self.first(frictus.RigStatus, holds)

    def scene(self, holds: Callable[[frictus.SceneState], bool]) -> frictus.SceneState:
        return self.first(frictus.SceneState, holds)

    def finger(self, holds: Callable[[frictus.FingerState], bool]) -> frictus.FingerState:
        return self.first(frictus.FingerState, holds)


@contextmanager
def running(
    folder: Path,
    *,
    rig: bool = True,
    recorder: bool = False,
    limits: Limits = PATIENT,
    block_ms: float = 20.0,
    **settings: Any,
) -> Iterator[Lab]:
    """Run a service that keeps everything in a folder, with patience for busy machines.

    Blocks are longer than usual: with those of 5 ms a rig takes 2.5 times as much of the cores
    that the browser needs, too.
    """
    config = Config(
        router=RouterConfig(endpoint=free_endpoint()),
        api=ApiConfig(port=free_port(), page_lease_ms=PATIENT_LEASE_MS),
        registry=RegistryConfig(url=f"sqlite:///{folder / 'registry.db'}"),
        textures=folder / "textures",
        studies=folder / "studies",
        recordings=folder / "recordings",
        limits=limits,
        block_ms=block_ms,
        **settings,
    )
    parts: list[PartName] = ["rig", "api"] if rig else ["api"]
    if recorder:
        parts.append("recorder")
    with Supervisor(config, parts, say=lambda _line: None) as supervisor:
        supervisor.wait_ready(100.0)
        with frictus.connect(config.router.endpoint, name="tester") as client:
            yield Lab(config, supervisor, client)


@contextmanager
def read_only(lab: Lab, **changes: Any) -> Iterator[str]:
    """Serve the dashboard once more, for the token `READER` alone, which only reads."""
    token = Token(name="reader", scopes=("read",), value=READER)
    api = ApiConfig(port=free_port(), tokens=(token,))
    router = RouterConfig(endpoint=lab.config.router.endpoint, host=False)
    config = lab.config.model_copy(update={"api": api, "router": router, **changes})
    stop, ready = threading.Event(), threading.Event()
    thread = threading.Thread(target=run_api, args=(config, stop, ready))
    thread.start()
    try:
        assert ready.wait(20.0)
        yield f"http://127.0.0.1:{api.port}/dashboard/"
    finally:
        stop.set()
        thread.join(20.0)


def enter(page: Page, url: str) -> None:
    """Open a page that asks for a token, and give it."""
    page.goto(url)
    page.get_by_label("Token", exact=True).fill(READER)
    page.get_by_role("button", name="Use it").click()


WIDTHS: Final = (390, 1024, 1440)
"""Of a phone, a tablet, a desk."""


def expect_no_violations(page: Page, widths: Sequence[int] = ()) -> None:
    """Fail if the page keeps anybody out, light or dark, or scrolls sideways at a width.

    Parameters
    ----------
    page : Page
        As it is now.
    widths : sequence of int
        Of its window, each tried; none: only the width that it has.
    """
    before = page.viewport_size
    for width in widths or (None,):
        if width is not None:
            page.set_viewport_size({"width": width, "height": 900})
        for scheme in ("light", "dark"):
            page.emulate_media(color_scheme=scheme)
            page.evaluate("scrollTo(0, 0)")  # what has scrolled below the strip is no fault
            found = Axe().run(page, options=RULES)
            assert found.violations_count == 0, f"{width}: {found.generate_report()}"
            wide = page.evaluate("document.documentElement.scrollWidth")
            assert width is None or wide <= width, f"{wide} px at {width}"
    if widths and before is not None:
        page.set_viewport_size(before)


def arrive(page: Page, url: str) -> None:
    page.goto(url)
    expect(page.locator("#connection")).to_have_text("Live")
    page.evaluate("window.loadedOnce = true")


def samples(page: Page, stream: str) -> int:
    told = page.locator(f"[data-stream={stream}] .count").inner_text()
    return int(told.split()[0]) if told else 0
