"""The page in a browser, before a real daemon: what a lab sees, and what its hands do."""

import os
import re
import signal
import sys
import threading
from pathlib import Path

import pytest
from playwright.sync_api import Page, WebSocketRoute, expect
from tests.dashboard.conftest import OpenPage
from tests.dashboard.lab import (
    READER,
    SCENE,
    WIDTHS,
    Lab,
    arrive,
    enter,
    expect_no_violations,
    read_only,
    samples,
)

import frictus
from frictus_service.config import RegistryConfig

pytestmark = pytest.mark.browser

TELL_MS = 2_000
"""Within this what has happened is on the page."""
RETURN_MS = 60_000


def test_what_the_rig_is_stands_there(page: Page) -> None:
    badges = page.locator("#badges")
    expect(badges).to_contain_text("Simulated")
    expect(badges).to_contain_text("Placeholder calibration")
    expect(badges).to_contain_text("Substitute sensor")
    expect(page.locator("#state")).to_have_text("Disarmed")
    expect(page.locator("#speed")).to_contain_text("20 to 100 mm/s")
    expect(page.locator("#scene-text")).to_contain_text("lines")
    expect(page.locator("#health-rows tr")).not_to_have_count(0)


def test_arms_and_stops_by_a_key(page: Page, lab: Lab) -> None:
    for key in ("Escape", "Space"):
        page.get_by_role("button", name="Arm", exact=True).click()
        lab.status(lambda status: status.state == "armed")
        expect(page.locator("#state")).to_have_text("ARMED")
        page.get_by_role("heading", name="The screen, to scale").click()
        page.keyboard.press(key)
        lab.status(lambda status: status.state == "disarmed")
        answer = page.locator("#stop-outcome")
        expect(answer).to_contain_text("rig1 answered the stop")
        expect(page.locator("#state")).to_have_text("Disarmed")
        told, strip = answer.bounding_box(), page.locator("#strip").bounding_box()
        assert told is not None
        assert strip is not None
        assert told["y"] >= strip["y"] + strip["height"]  # Arm is within reach


def test_space_stops_while_the_pointer_is_the_finger(page: Page, lab: Lab) -> None:
    page.get_by_role("button", name="Arm", exact=True).click()
    lab.status(lambda status: status.state == "armed")
    page.locator("#surface").focus()
    page.keyboard.press("Space")
    lab.status(lambda status: status.state == "disarmed")
    expect(page.locator("#stop-outcome")).to_contain_text("rig1 answered the stop")


def test_armed_has_a_colour_of_its_own_kind(page: Page, lab: Lab) -> None:
    page.get_by_role("button", name="Arm", exact=True).click()
    expect(page.locator("#state")).to_have_text("ARMED")
    colours = page.locator("#strip").evaluate(
        """(strip) => {
          const probe = document.createElement("i");
          document.body.append(probe);
          const named = (name) => {
            probe.style.color = `var(--${name})`;
            return getComputedStyle(probe).color;
          };
          const ground = getComputedStyle(strip).backgroundColor;
          return [ground, named("armed-ground"), named("good-ground")];
        }"""
    )
    assert colours[0] == colours[1] != colours[2]
    page.keyboard.press("Escape")
    lab.status(lambda status: status.state == "disarmed")


@pytest.mark.parametrize("width", [390, 820, 1024, 1280, 1440])
def test_the_strip_is_low_on_every_view_and_nothing_overflows(
    width: int, lab: Lab, open_page: OpenPage
) -> None:
    with open_page(viewport={"width": width, "height": 900}) as page:
        arrive(page, lab.url)
        strip, stop = page.locator("#strip"), page.locator("#stop")
        for view in page.locator("#views a").all():
            view.click()
            expect(view).to_have_attribute("aria-current", "page")
            boxes = [each.bounding_box() for each in (strip, stop, page.locator("#arm"))]
            low, largest, arm = [box["width"] * box["height"] for box in boxes if box]
            assert boxes[0] is not None
            assert boxes[0]["height"] <= 64
            assert largest > arm
            assert boxes[1] is not None
            assert boxes[1]["x"] + boxes[1]["width"] <= width  # all of the stop
            assert low > 0
            assert page.evaluate("document.documentElement.scrollWidth") <= width
        # Each control has a name of its own.
        found = strip.locator("summary, button").filter(visible=True).all_inner_texts()
        assert len(set(found)) == len(found) >= 4


def test_a_speed_beyond_the_model_is_not_written_over_the_force(
    lab: Lab, open_page: OpenPage
) -> None:
    with open_page(viewport={"width": 390, "height": 844}) as page:
        arrive(page, lab.url)
        excess_px = page.evaluate(
            """() => [...document.querySelectorAll("#strip .gauge")].map((gauge, at) => {
              gauge.dataset.verdict = "above";
              gauge.querySelector(".number").textContent = ["122", "0.65"][at];
              const reading = gauge.querySelector(".reading");
              return reading.scrollWidth - reading.clientWidth;
            })"""
        )
        assert excess_px == [0, 0]


def test_what_the_strip_has_more_of_opens_and_closes_by_keyboard(page: Page) -> None:
    expect(page.locator("#health-rows tr").first).to_be_hidden()
    loop, notes = (page.locator(f"#{name} summary") for name in ("loop", "notes"))
    loop.focus()
    page.keyboard.press("Enter")
    expect(page.locator("#health-rows")).to_contain_text("Underruns")
    expect(page.locator("#health-rows tr").first).to_be_visible()
    expect_no_violations(page, WIDTHS)
    notes.focus()
    expect(page.locator("#health-rows tr").first).to_be_hidden()
    page.keyboard.press("Space")  # it does not stop where a control takes it
    expect(page.locator("#notes-list")).to_contain_text("Simulated: a model plays device")
    expect(page.locator("#stop-outcome")).to_be_empty()


def test_a_view_that_only_objects_have_shows_the_live_one(page: Page) -> None:
    page.evaluate("() => { location.hash = '#/calibrate/rig1'; }")
    expect(page.get_by_role("button", name="Arm the rig and start")).to_be_visible()
    expect(page.locator("form.setup")).to_contain_text("puts voltage on the screen")
    page.evaluate("() => { location.hash = '#/constructor/rig1'; }")
    expect(page.locator("#surface")).to_be_visible()
    expect(page.get_by_role("link", name="Live", exact=True)).to_have_attribute(
        "aria-current", "page"
    )


def test_disarms_and_stops_by_the_button(page: Page, lab: Lab) -> None:
    for button in ("Disarm", "STOP"):
        page.get_by_role("button", name="Arm", exact=True).click()
        lab.status(lambda status: status.state == "armed")
        page.get_by_role("button", name=button).click()
        lab.status(lambda status: status.state == "disarmed")
        expect(page.get_by_role("button", name="Arm", exact=True)).to_be_visible()


def test_another_page_sees_who_holds_the_rig_and_with_whom_it_is_shared(
    page: Page, lab: Lab, open_page: OpenPage
) -> None:
    # The other page is there first: to load one takes the cores that renew a lease.
    with open_page() as other:
        arrive(other, lab.url)
        others = page.get_by_label("Others who may change what is felt")
        expect(others).to_be_hidden()
        page.get_by_text("Share", exact=True).click()
        others.fill("a name that is none?")
        page.get_by_role("button", name="Arm", exact=True).click()
        assert others.evaluate("field => field.validity.patternMismatch")
        expect(others).to_be_visible()
        others.fill("ann, ben")
        page.get_by_role("button", name="Arm", exact=True).click()
        status = lab.status(lambda status: status.state == "armed")
        assert status.share_with == ("ann", "ben")
        expect(page.locator("#owner")).to_have_text("Held by you, shared with ann, ben")
        expect(page.locator("#since")).to_contain_text("since ")
        expect(others).to_be_hidden()
        expect(other.locator("#owner")).to_have_text(
            "Held by another page, shared with ann, ben"
        )
        expect(other.locator("#owner")).to_have_attribute(
            "title", f"Known to the rig as {status.owner}"
        )
        expect(other.get_by_role("button", name="Arm", exact=True)).to_be_disabled()
        expect(other.locator("#pressing")).to_be_hidden()
        expect(other.locator("#surface-help")).to_contain_text("another page holds the rig")
        other.keyboard.press("Escape")
        lab.status(lambda status: status.state == "disarmed")
        expect(other.locator("#since")).to_have_text(
            re.compile(r"^stopped by you at [\d:]+, held by another page$")
        )
    expect(page.locator("#since")).to_have_text(
        re.compile(r"^stopped by another page at [\d:]+, held by you$")
    )
    for width in WIDTHS:
        page.set_viewport_size({"width": width, "height": 900})
        cut = page.locator(".holder").evaluate(
            "({ scrollWidth: w, clientWidth: W, scrollHeight: h, clientHeight: H }) =>"
            " Math.max(w - W, h - H)"
        )
        assert cut <= 1, f"{cut} px are cut at {width}"
    with lab.rig.arm(lease_ms=10_000):
        expect(page.locator("#owner")).to_have_text("Held by tester")
        expect(page.get_by_role("button", name="Arm", exact=True)).to_be_disabled()
        expect_no_violations(page)


def test_a_reset_that_is_not_answered_is_resolved_by_the_status(page: Page, lab: Lab) -> None:
    """The page's modules alone, for a rig that is tripped cannot be had by a click."""
    told = page.evaluate(
        """async () => {
          const { Arming } = await import("./rig/arming.js");
          const { at } = await import("./elements/element.js");
          window.fetch = async () => { throw new TypeError("gone"); };
          const arming = new Arming({ send: () => true });
          arming.show("rig9", { state: "tripped" }, false);
          at("reset").click();
          await new Promise((resume) => setTimeout(resume));
          const first = at("arm-outcome").textContent;
          arming.show("rig9", { state: "disarmed" }, false);
          return [first, at("arm-outcome").textContent];
        }"""
    )
    assert told == ["Unknown whether the rig is reset, checking…", "The rig is reset"]


def test_lease_ends_with_the_page(lab: Lab, open_page: OpenPage) -> None:
    with open_page() as page:
        arrive(page, lab.url)
        page.get_by_role("button", name="Arm", exact=True).click()
        lab.status(lambda status: status.state == "armed")
    lab.status(lambda status: status.state == "disarmed")


def test_stop_needs_no_live_connection_and_is_sent_until_it_is_answered(
    lab: Lab, open_page: OpenPage
) -> None:
    with open_page(expected="ERR_FAILED") as page:
        page.route_web_socket("**/v1/live", lambda socket: socket.close())
        page.route("**/v1/rigs/rig1/stop", lambda route: route.abort(), times=2)
        page.goto(f"{lab.url}/dashboard/#/live/rig1")
        expect(page.locator("#connection")).to_contain_text("No connection")
        with lab.rig.arm(lease_ms=10_000):
            page.keyboard.press("Escape")
            # First of all here: the routes above are played only while the browser is asked.
            expect(page.locator("#stop-outcome")).to_contain_text("rig1 answered the stop")
            lab.status(lambda status: status.state == "disarmed")


def test_pointer_is_the_finger(page: Page, lab: Lab) -> None:
    canvas = page.locator("#surface")
    expect(canvas).to_be_visible()
    box = canvas.bounding_box()
    assert box is not None
    page.locator("#press").fill("0.6")
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.down()
    lab.finger(lambda finger: finger.in_contact and abs(finger.x_mm - 35.0) < 1.0)
    page.mouse.move(box["x"] + 0.7 * box["width"], box["y"] + box["height"] / 2, steps=5)
    pressed = lab.finger(lambda finger: finger.in_contact and finger.x_mm > 40.0)
    assert abs(pressed.y_mm - 17.5) < 1.0
    expect(page.locator("#force")).to_contain_text("0.60")
    page.mouse.up()
    lab.finger(lambda finger: not finger.in_contact)
    expect(page.locator("#finger-text")).to_contain_text("No finger")


def test_where_nothing_plays_the_next_steps_are_offered(page: Page, lab: Lab) -> None:
    cards = page.locator("#first-cards a")
    expect(cards).to_have_count(0)
    lab.rig.set_scene(frictus.Scene())
    try:
        expect(page.locator("#first-title")).to_have_text("Nothing plays: the screen is smooth")
        expect(cards).to_have_count(3)
        expect_no_violations(page)
        cards.filter(has_text="Choose a texture").click()
        expect(page.get_by_role("link", name="Textures", exact=True)).to_have_attribute(
            "aria-current", "page"
        )
        expect(page.locator("#first")).to_be_hidden()
    finally:
        lab.rig.set_scene(SCENE)
    page.get_by_role("link", name="Live", exact=True).click()
    expect(page.locator("#scene-text")).to_contain_text("lines")
    expect(page.locator("#first")).to_be_hidden()


def test_a_name_that_no_rig_can_have_ends_no_connection(page: Page, lab: Lab) -> None:
    page.evaluate("location.hash = '#/live/rig%20one'")
    expect(page.locator("#connection")).to_have_text("rig one is not present")
    expect(page.locator("#advice")).to_contain_text("No rig can be called so")
    with lab.rig.arm(lease_ms=10_000):
        page.keyboard.press("Escape")  # as where none is shown: it stops those that are present
        lab.status(lambda status: status.state == "disarmed")
    page.evaluate("location.hash = '#/live/rig1'")
    expect(page.locator("#connection")).to_have_text("Live")  # it was never interrupted


@pytest.mark.parametrize(
    ("view", "shown"),
    [
        ("Live", "No finger touches the screen."),
        ("Live model", "No tracker runs at rig1"),
        ("Textures", "textures, "),
        ("Calibrate", "None was started yet."),
        ("Models", "None is published yet"),
        ("Discovery", "There is no study yet: add one below"),
    ],
)
def test_anybody_can_use_it(view: str, shown: str, page: Page) -> None:
    page.get_by_role("link", name=view, exact=True).click()
    expect(page.locator("main")).to_contain_text(shown)
    expect_no_violations(page)
    # The tab key reaches every control that is shown and not disabled.
    wanted = page.evaluate(
        """() => {
          const all = "a[href], button, input, select, textarea, summary, [tabindex='0']";
          window.wanted = [...document.querySelectorAll(all)].filter((control) =>
            control.checkVisibility() && !control.disabled && !control.closest("dialog"));
          return window.wanted.length;
        }"""
    )
    page.evaluate("document.activeElement.blur()")
    for _ in range(wanted + 10):
        page.keyboard.press("Tab")
        page.evaluate(
            "window.wanted = window.wanted.filter((each) => each !== document.activeElement)"
        )
    left = page.evaluate("window.wanted.filter((each) => each.isConnected).map(String)")
    assert left == []


def test_reader_enters_a_token_and_may_only_look_and_stop(
    lab: Lab, open_page: OpenPage, tmp_path: Path
) -> None:
    registry = RegistryConfig(url=f"sqlite:///{tmp_path / 'registry.db'}")
    with read_only(lab, registry=registry) as url, open_page() as page:
        enter(page, url)
        expect(page.locator("#connection")).to_have_text("Live")
        expect(page.locator("#arm")).to_be_hidden()
        expect(page.locator("#pressing")).to_be_hidden()
        assert READER not in page.url
        with lab.rig.arm(lease_ms=10_000):
            page.locator("#stop").click()
            lab.status(lambda status: status.state == "disarmed")
        expect(page.locator("#session")).to_have_text(
            "Your token lets you: look, and stop a rig."
        )
        page.get_by_role("button", name="Forget the token").click()
        expect(page.locator("#connection")).to_contain_text("Not let in")
        page.reload()  # it is kept nowhere
        expect(page.get_by_label("Token", exact=True)).to_be_visible()
        expect(page.locator("#session")).to_be_empty()


def test_network_that_swallows_everything_is_noticed(lab: Lab, open_page: OpenPage) -> None:
    cut = threading.Event()

    def between(page_side: WebSocketRoute) -> None:
        service_side = page_side.connect_to_server()
        service_side.on_message(lambda data: None if cut.is_set() else page_side.send(data))
        page_side.on_message(lambda data: None if cut.is_set() else service_side.send(data))

    with open_page() as page:
        page.route_web_socket("**/v1/live", between)
        arrive(page, lab.url)
        cut.set()
        box = page.locator("#connection")
        expect(box).to_contain_text("No word from the service", timeout=TELL_MS)
        cut.clear()
        expect(box).to_contain_text("Live again")
        page.set_viewport_size({"width": 1024, "height": 768})
        told, stop = box.bounding_box(), page.locator("#stop").bounding_box()
        assert told is not None
        assert stop is not None
        assert told["x"] + told["width"] <= stop["x"]
        page.evaluate("(now => { Date.now = () => now() + 61_000; })(Date.now)")
        expect(box).to_have_text("Live")  # it is no news for ever
        expect(box).to_have_attribute("title", re.compile("^interrupted at "))


def test_a_page_whose_connection_broke_is_no_other_page(lab: Lab, open_page: OpenPage) -> None:
    sockets: list[WebSocketRoute] = []

    def between(page_side: WebSocketRoute) -> None:
        page_side.connect_to_server()
        sockets.append(page_side)

    with open_page() as page:
        page.route_web_socket("**/v1/live", between)
        arrive(page, lab.url)
        page.get_by_role("button", name="Arm", exact=True).click()
        expect(page.locator("#state")).to_have_text("ARMED")
        sockets[0].close()
        expect(page.locator("#since")).to_contain_text(
            "disarmed by you, over an earlier connection at "
        )
        page.get_by_role("button", name="Arm", exact=True).click()
        expect(page.locator("#state")).to_have_text("ARMED")
        page.reload()
        expect(page.locator("#since")).to_contain_text(
            "disarmed by you, over an earlier connection at "
        )


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGKILL for others")
def test_loss_and_return_are_shown_without_a_reload(lab: Lab, open_page: OpenPage) -> None:
    with open_page(expected="WebSocket") as page:
        arrive(page, lab.url)
        box = page.locator("#connection")
        os.kill(lab.supervisor.pid_of("rig"), signal.SIGKILL)
        # The supervisor tells of the trip for a rig that has died.
        expect(box).to_contain_text("rig1 has ended", timeout=TELL_MS)
        expect(page.locator("#state")).to_have_text("Ended")
        expect(page.locator("#fault")).to_contain_text("the rig process ended")
        os.kill(lab.supervisor.pid_of("api"), signal.SIGKILL)
        expect(box).to_contain_text("No connection", timeout=TELL_MS)
        expect(box).to_contain_text("Live again", timeout=RETURN_MS)
        expect(page.locator("#state")).to_have_text("Disarmed")
        assert page.evaluate("window.loadedOnce")
        page.wait_for_function(
            """(seen) => parseInt(document.querySelector(
              "[data-stream=force] .count").textContent) > seen""",
            arg=samples(page, "force"),
        )
