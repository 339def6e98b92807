"""Taking over the finger of the stage before a real daemon: by pointer, touch and keys."""

import re
from collections.abc import Iterator

import pytest
from playwright.sync_api import FloatRect, Page, expect
from tests.dashboard.conftest import OpenPage
from tests.dashboard.lab import WIDTHS, Lab, enter, expect_no_violations, read_only, running
from tests.dashboard.test_compensation import TEXTURE, expect_error

from frictus_hardware import SimulatedConfig
from frictus_hardware.simulated.strokes import SteadyStrokes
from frictus_hardware.simulated.takeover import TakeoverStrokes

pytestmark = pytest.mark.browser

MIDDLE_MM = 17.5
"""Where it strokes by itself."""
INVITED = re.compile("^Take over the finger: ")
TAKEN = re.compile("^You are the finger, a simulated one")


@pytest.fixture(scope="module")
def lab(browser: object, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Lab]:
    """A daemon whose slow finger can be taken over."""
    finger = TakeoverStrokes(strokes=SteadyStrokes(speed_mm_s=25.0))
    backend = SimulatedConfig(finger=finger)
    with running(tmp_path_factory.mktemp("lab"), backend=backend) as lab:
        lab.rig.set_scene(TEXTURE)
        yield lab


@pytest.fixture
def page(lab: Lab, open_page: OpenPage) -> Iterator[Page]:
    with open_page(viewport={"width": 1280, "height": 1_800}) as page:
        page.goto(lab.url)
        expect(page.locator("#takeover")).to_have_text(INVITED)
        yield page


def screen(page: Page) -> FloatRect:
    page.locator("#surface").scroll_into_view_if_needed()
    box = page.locator("#surface").bounding_box()
    assert box is not None
    return box


def strokes_by_itself(lab: Lab) -> None:
    lab.finger(lambda finger: finger.in_contact and abs(finger.y_mm - MIDDLE_MM) < 1.0)
    lab.finger(lambda finger: abs(finger.vx_mm_s) > 15.0)


@pytest.mark.timeout(300)
def test_a_pointer_takes_over_the_finger_and_gives_it_back(page: Page, lab: Lab) -> None:
    strokes_by_itself(lab)
    expect(page.locator("#surface-help")).to_contain_text("The finger is simulated")
    parts = [page.locator("#press"), page.locator("#spectrum .chart").first]
    for part in parts:
        expect(part).to_be_visible()
    tops = [part.bounding_box()["y"] for part in parts]  # type: ignore[index]
    box = screen(page)
    page.mouse.move(box["x"] + 0.2 * box["width"], box["y"] + 0.2 * box["height"])
    page.mouse.down()
    expect(page.locator("#takeover")).to_have_text(TAKEN)
    # What one looks at, and the slider under the hand, stay where they are.
    assert [part.bounding_box()["y"] for part in parts] == tops  # type: ignore[index]
    lab.finger(lambda finger: finger.in_contact and finger.y_mm < 10.0)
    expect_no_violations(page, WIDTHS)
    expect(page.locator("#takeover")).to_have_text(TAKEN)
    page.mouse.up()
    expect(page.locator("#takeover")).to_have_text(INVITED)
    strokes_by_itself(lab)
    expect_no_violations(page)


def test_a_touch_takes_over_the_finger(lab: Lab, open_page: OpenPage) -> None:
    with open_page(viewport={"width": 360, "height": 740}, has_touch=True) as page:
        page.goto(lab.url)
        expect(page.locator("#takeover")).to_have_text(INVITED)
        box = screen(page)
        point = {"x": box["x"] + 0.5 * box["width"], "y": box["y"] + 0.8 * box["height"]}
        touch = page.context.new_cdp_session(page)
        press = {"type": "touchStart", "touchPoints": [point]}
        touch.send("Input.dispatchTouchEvent", press)
        expect(page.locator("#takeover")).to_have_text(TAKEN)
        lab.finger(lambda finger: finger.in_contact and finger.y_mm > 24.0)
        assert page.evaluate("document.documentElement.scrollWidth") == 360
        touch.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
        expect(page.locator("#takeover")).to_have_text(INVITED)
        strokes_by_itself(lab)


def slide_to_the_right_end(page: Page, lab: Lab) -> None:
    """Slide by keys until the page has a spectrum of that hand; the right one stays pressed.

    A page that gets no core for a moment moves its finger in jerks, which no spectrum is of.
    """
    note = page.locator("#spectrum-note")
    for _ in range(10):
        page.keyboard.down("ArrowRight")
        expect(page.locator("#takeover")).to_have_text(TAKEN)
        lab.finger(lambda finger: finger.x_mm > 69.0)
        # At the right end it rests: nothing is averaged with what the strokes felt.
        expect(note).to_contain_text(re.compile("does not slide now|slides for 0.4 s"))
        if "does not slide now" in note.inner_text():
            return
        page.keyboard.up("ArrowRight")
        page.keyboard.down("ArrowLeft")
        lab.finger(lambda finger: finger.x_mm < 1.0)
        page.keyboard.up("ArrowLeft")
    raise AssertionError("no spectrum of a hand that slid ten times")


def test_keys_take_it_over_and_the_spectrum_is_of_that_hand(page: Page, lab: Lab) -> None:
    page.get_by_role("button", name="Arm", exact=True).click()
    lab.status(lambda status: status.state == "armed")
    expect_error(page, above=False)
    page.locator("#surface").focus()
    slide_to_the_right_end(page, lab)
    page.keyboard.up("ArrowRight")
    page.keyboard.down("ArrowLeft")  # no lift from one stroke to the next
    lab.finger(lambda finger: finger.x_mm < 20.0)
    expect(page.locator("#takeover")).to_have_text(TAKEN)
    expect_error(page, above=False)
    page.keyboard.up("ArrowLeft")
    expect(page.locator("#takeover")).to_have_text(INVITED)
    expect_error(page, above=False)  # of the strokes again
    page.keyboard.press("Escape")
    lab.status(lambda status: status.state == "disarmed")


@pytest.mark.parametrize("key", ["Space", "Escape"])
def test_keys_stop_while_the_finger_is_taken(page: Page, lab: Lab, key: str) -> None:
    page.get_by_role("button", name="Arm", exact=True).click()
    lab.status(lambda status: status.state == "armed")
    page.locator("#surface").focus()
    page.keyboard.down("ArrowLeft")
    expect(page.locator("#takeover")).to_have_text(TAKEN)
    page.keyboard.press(key)
    lab.status(lambda status: status.state == "disarmed")
    expect(page.locator("#takeover")).to_have_text(TAKEN)
    page.keyboard.up("ArrowLeft")
    strokes_by_itself(lab)


def test_it_is_offered_to_whom_the_rig_is_shared_with_and_else_to_nobody(
    page: Page, lab: Lab, open_page: OpenPage
) -> None:
    with lab.rig.arm(lease_ms=10_000):
        expect(page.locator("#takeover")).to_be_hidden()
        expect(page.locator("#surface")).to_have_attribute("role", "img")
    with lab.rig.arm(lease_ms=10_000, share_with=["local"]):
        expect(page.locator("#takeover")).to_have_text(INVITED)
        box = screen(page)
        page.mouse.move(box["x"] + 0.2 * box["width"], box["y"] + 0.2 * box["height"])
        page.mouse.down()
        lab.finger(lambda finger: finger.in_contact and finger.y_mm < 10.0)
        page.mouse.up()
        strokes_by_itself(lab)
    with read_only(lab) as url, open_page() as reader:
        enter(reader, url)
        expect(reader.locator("#connection")).to_have_text("Live")
        expect(reader.locator("#surface-help")).to_contain_text("simulated")
        expect(reader.locator("#takeover")).to_be_hidden()


def test_a_page_that_is_gone_has_let_go(lab: Lab, open_page: OpenPage) -> None:
    with open_page() as page:
        page.goto(lab.url)
        expect(page.locator("#takeover")).to_have_text(INVITED)
        box = screen(page)
        page.mouse.move(box["x"] + 0.2 * box["width"], box["y"] + 0.2 * box["height"])
        page.mouse.down()
        lab.finger(lambda finger: finger.in_contact and finger.y_mm < 10.0)
    strokes_by_itself(lab)
