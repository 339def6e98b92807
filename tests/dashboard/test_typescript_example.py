"""The example of the TypeScript client in Chromium: a page of another origin plays ridges."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect
from tests.dashboard.conftest import OpenPage, served
from tests.service.dashboard.page import configuration, rig_that_follows_pages, serving
from tests.typescript.package import package

import frictus

pytestmark = [pytest.mark.browser, pytest.mark.timeout(300)]
PAINTED = """canvas => {
    const { width, height } = canvas;
    const pixels = canvas.getContext("2d").getImageData(0, 0, width, height).data;
    return pixels.some((value, index) => index % 4 === 3 && value > 0);
}"""


@pytest.fixture(scope="module")
def router(browser: object) -> Iterator[str]:
    with rig_that_follows_pages() as router:
        yield router


def seen(rig: frictus.Rig, holds: Callable[[frictus.RigStatus], bool]) -> frictus.RigStatus:
    with rig.watch(frictus.keys.Topics.STATUS, timeout_s=30.0) as states:
        for state in states:
            assert isinstance(state, frictus.RigStatus)
            if holds(state):
                return state
    raise AssertionError("the feed has ended")


def play(page: Page, url: str, port: int) -> None:
    page.goto(f"{url}/example/index.html")
    page.get_by_label("Service").fill(f"ws://127.0.0.1:{port}")
    page.get_by_role("button", name="Play").click()


def test_a_texture_is_felt_under_the_pointer(
    router: str, open_page: OpenPage, tmp_path: Path
) -> None:
    with (
        served(package()) as url,
        serving(configuration(router, tmp_path, False, origins=(url,))) as port,
        frictus.connect(router, name="tester") as client,
    ):
        rig = client.rig("rig1")
        with open_page() as page:
            play(page, url, port)
            expect(page.get_by_role("status")).to_contain_text("Playing", timeout=30_000)
            status = seen(rig, lambda status: status.counters.stream_updates > 0)
            assert (status.state, status.stream_open) == ("armed", True)
            page.get_by_label("Ridge, mm").fill("5")
            seen(
                rig,
                lambda now: now.counters.stream_updates > status.counters.stream_updates,
            )
            screen = page.locator("#screen")
            box = screen.bounding_box()
            assert box is not None
            with rig.fingers(timeout_s=30.0) as fingers:
                for step, finger in enumerate(fingers):
                    x = box["x"] + box["width"] * (0.2 + 0.6 * (step % 50) / 50)
                    page.mouse.move(x, box["y"] + box["height"] / 2)
                    if finger.in_contact and finger.vx_mm_s > 20.0 and step > 50:
                        break
            assert page.evaluate(PAINTED, page.locator("#felt").element_handle())
        status = seen(rig, lambda status: status.state == "disarmed")
        assert status.last_end is not None
        assert "page-" in status.last_end.owner


def test_an_origin_that_is_not_named_is_kept_out(
    router: str, open_page: OpenPage, tmp_path: Path
) -> None:
    with (
        served(package()) as url,
        serving(configuration(router, tmp_path, False)) as port,
        open_page(expected="WebSocket connection") as page,
    ):
        play(page, url, port)
        told = page.get_by_role("status")
        expect(told).to_contain_text("It does not play")
        expect(told).to_contain_text(f'or its [api] origins does not have "{url}"')
        page.get_by_label("Service").fill(f"127.0.0.1:{port}")
        page.get_by_role("button", name="Play").click()
        expect(told).to_contain_text("is no address: give one such as ws://HOST:8420")
