"""`frictus demo --page` as a newcomer meets it: a page on a texture that is being felt."""

import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from playwright.sync_api import Page, expect
from tests.dashboard.conftest import OpenPage
from tests.dashboard.lab import WIDTHS, expect_no_violations
from tests.dashboard.test_calibrate import BRIEF, DONE_MS, start
from tests.dashboard.test_calibrate import state as calibration_state
from tests.dashboard.test_compensation import expect_error, press, switch

from frictus_service.synthesis.compensability import law_of, placeholder_model

pytestmark = pytest.mark.browser

HIDDEN = re.compile("direction asymmetry|force dependent gain|channel delay")
FACTS = re.compile(r"the page: (http://127\.0\.0\.1:\d+/#/live/demo)")


@contextmanager
def demo_page(seed: int) -> Iterator[str]:
    """Run the command, without a browser of its own; give the address that it says."""
    command = [sys.executable, "-c", "from frictus_service.cli import main; main()"]
    process = subprocess.Popen(
        [*command, "demo", "--page", "--seed", str(seed)],
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"BROWSER": "frictus-no-such-browser"},
    )
    assert process.stderr is not None
    said = []
    try:
        for line in process.stderr:
            said.append(line)
            if told := FACTS.search(line):
                yield told[1]
                break
        else:
            pytest.fail(f"no address was said: {said}")
    finally:
        process.send_signal(signal.SIGINT)
        _, rest = process.communicate(timeout=60)
    assert process.returncode == 0, rest


def assert_gauges_agree(page: Page) -> None:
    """The number, and where its mark is, of one instant: within the rounding of the number."""
    told = page.evaluate(
        """() => [...document.querySelectorAll(".gauge")].map((gauge) => {
          const style = (part, name) =>
            parseFloat(gauge.querySelector(part).style.getPropertyValue(name));
          const [, to] = gauge.querySelector(".words").textContent.match(/to ([0-9.]+)/);
          const share = style(".mark", "--at") / style(".zone", "--to");
          return [parseFloat(gauge.querySelector(".number").textContent), to * share];
        })"""
    )
    assert len(told) == 2
    for (number, mark), step in zip(told, (1.0, 0.01), strict=True):
        assert abs(number - mark) < 0.6 * step + 0.01 * number


@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGINT for one process")
@pytest.mark.usefixtures("interruptible")
def test_the_page_shows_what_compensation_does_without_scrolling(
    open_page: OpenPage, seed: int
) -> None:
    with demo_page(seed) as url, open_page(viewport={"width": 1440, "height": 900}) as page:
        page.goto(url)
        expect(page.locator("#connection")).to_have_text("Live")
        expect(page.locator("#state")).to_have_text("ARMED")
        for what in (switch(page), page.locator("#spectrum"), page.locator("#surface")):
            expect(what).to_be_in_viewport(ratio=1)
        expect_error(page, above=False)
        assert_gauges_agree(page)
        press(page, "Off")
        expect_error(page, above=True)
        press(page, "Model")
        expect_error(page, above=False)
        page.get_by_role("button", name="STOP").click()
        expect(page.locator("#state")).to_have_text("Disarmed")
        page.get_by_role("button", name="Arm", exact=True).click()
        expect(page.locator("#state")).to_have_text("ARMED")
        expect_error(page, above=False)


@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGINT for one process")
@pytest.mark.usefixtures("interruptible")
@pytest.mark.timeout(300)
def test_what_is_hidden_next_door_is_found_from_the_stage(
    open_page: OpenPage, seed: int
) -> None:
    with demo_page(seed) as url, open_page(viewport={"width": 1440, "height": 900}) as page:
        page.goto(url)
        cards = page.locator("#first")
        expect(cards.get_by_role("heading")).to_have_text("And now?")
        expect(cards.get_by_role("link")).to_have_text(
            [
                "Measure this finger",
                "Find what a model gets wrong",
                "Stream a recording of yours",
            ]
        )
        expect(cards).to_contain_text("sample study laboratory_next_door.h5")
        expect_no_violations(page, WIDTHS)
        cards.get_by_role("link", name="Find what a model gets wrong").click()
        study = page.get_by_label("Study")
        expect(study).to_have_value("laboratory_next_door.h5", timeout=DONE_MS)
        page.get_by_role("button", name="Start").click()
        view = page.locator("#view-discovery")
        expect(view.locator("[data-state]")).to_have_text("Done", timeout=DONE_MS)
        causes = page.get_by_role("table", name="Causes that the data name")
        expect(causes.locator("tbody")).to_contain_text(HIDDEN)


@pytest.mark.long
@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGINT for one process")
@pytest.mark.usefixtures("interruptible")
@pytest.mark.timeout(600)
def test_the_finger_of_the_stage_can_be_calibrated(open_page: OpenPage, seed: int) -> None:
    with demo_page(seed) as url, open_page() as page:
        page.goto(url)
        expect(page.locator("#state")).to_have_text("ARMED")
        page.get_by_role("button", name="STOP").click()
        expect(page.locator("#state")).to_have_text("Disarmed")
        page.locator("#first").get_by_role("link", name="Measure this finger").click()
        start(page, "P01", BRIEF)
        expect(calibration_state(page)).to_have_text("Done", timeout=DONE_MS)
        view = page.locator("#view-calibrate")
        expect(view).to_contain_text("what was asked for is reached")
        gain = view.get_by_role("row", name="Gain").inner_text()
        low_n, high_n = (float(end) for end in re.findall(r"[0-9.]+", gain)[-2:])
        twice = 2.0 * law_of(placeholder_model()).gain_n
        assert low_n - 0.03 < twice < high_n + 0.03, gain
