"""The view of the live model before a real daemon, and a publisher in place of a tracker."""

import json
import re
from collections.abc import Iterator
from typing import Any

import pytest
from playwright.sync_api import Locator, Page, Route, WebSocketRoute, expect
from tests.dashboard.conftest import OpenPage
from tests.dashboard.estimates import adapted, alarmed, felt, nothing_felt, tracked
from tests.dashboard.lab import WIDTHS, Lab, enter, expect_no_violations, read_only, running

from frictus.messages import EstimateState
from frictus_hardware import SimulatedConfig

pytestmark = pytest.mark.browser

ONE_SCREEN = {"width": 1440, "height": 900}


@pytest.fixture(scope="module")
def lab(browser: object, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Lab]:
    """A daemon without a tracker."""
    with running(tmp_path_factory.mktemp("lab"), backend=SimulatedConfig()) as lab:
        yield lab


@pytest.fixture
def page(lab: Lab, open_page: OpenPage) -> Iterator[Page]:
    with open_page(viewport=ONE_SCREEN) as page:
        arrive(page, lab)
        yield page


def arrive(page: Page, lab: Lab, url: str | None = None) -> None:
    page.goto(f"{url or lab.url + '/dashboard/'}#/live-model/rig1")
    expect(page.locator("#connection")).to_have_text("Live")


def view(page: Page) -> Locator:
    return page.locator("#view-live-model")


def verdict(page: Page) -> Locator:
    return view(page).locator(".verdict")


def policy(page: Page, name: str) -> Locator:
    return view(page).get_by_role("group", name="Policy").get_by_role("button", name=name)


class Told:
    """What the status says of adaptation, in place of what the daemon says.

    Parameters
    ----------
    page : Page
        That is not open yet.
    """

    def __init__(self, page: Page) -> None:
        self.changes: dict[str, Any] = {}
        self.asked: list[Any] = []
        page.route_web_socket("**/v1/live", self._between)
        page.route(re.compile("/v1/rigs/rig1/adaptation$"), self._answer)

    def _between(self, page_side: WebSocketRoute) -> None:
        service_side = page_side.connect_to_server()
        page_side.on_message(lambda data: service_side.send(data))
        service_side.on_message(lambda data: page_side.send(self._changed(data)))

    def _changed(self, data: str | bytes) -> str | bytes:
        if isinstance(data, bytes):
            return data
        message = json.loads(data)
        if message["op"] == "status":
            message["status"] |= self.changes
        return json.dumps(message)

    def _answer(self, route: Route) -> None:
        assert route.request.method == "PUT"
        self.asked.append(route.request.post_data_json)
        route.fulfill(status=204)


def test_without_a_tracker_it_says_what_to_do(page: Page) -> None:
    expect(verdict(page)).to_have_text("No tracker runs at rig1")
    expect(view(page).locator(".sentence code")).to_have_text("frictus track")
    expect(view(page).locator(".chart:visible, .bars:visible, details:visible")).to_have_count(
        0
    )
    expect_no_violations(page)


def test_before_anything_is_felt_it_says_what_to_do(page: Page, lab: Lab) -> None:
    with tracked(lab.client, lab.rig, nothing_felt()):
        expect(verdict(page)).to_have_text("Nothing felt yet")
        expect(view(page).locator(".sentence")).to_have_text(
            "Play a texture and slide one finger over it at 10 to 150 mm/s. "
            "Left out most often: nothing plays."
        )
        expect(view(page).locator(".chart:visible")).to_have_count(0)


def test_an_estimate_is_drawn_and_said(page: Page, lab: Lab) -> None:
    with tracked(lab.client, lab.rig, felt()):
        shown = view(page)
        expect(verdict(page)).to_contain_text("off by more than a finger can tell")
        expect(shown.locator(".sentence")).to_contain_text("up to 1.40 kHz at 20")
        bode = shown.get_by_role("img", name="Friction per drive over frequency")
        expect(bode).to_have_attribute("data-points", "48")
        expect(bode).to_have_attribute("data-curves", "6")
        expect(bode).to_have_accessible_description(
            re.compile(
                r"At 24 mm/s, 16 points measured: at 100 Hz learned -6\.8 dB, "
                r"model in force -8\.3 dB.*At 52 mm/s.*At 96 mm/s"
            )
        )
        expect(shown.locator("figure.bode .keys")).to_contain_text("▲ 96 mm/s")
        gain = shown.locator("[data-parameter=gain_n]")
        expect(gain.locator("h3")).to_have_text("Gain0.460 N")
        expect(gain.get_by_role("img")).to_have_accessible_description(
            "0.442 to 0.478; in force 0.390"
        )
        expect(shown.locator("[data-cause]")).to_have_text(
            [re.compile("cutoff.*4.4 nats"), re.compile("gain.*3.1 nats")]
        )
        expect(shown.locator(".evidence")).to_contain_text("2 others are quiet")
        expect(shown.locator("[data-model] b")).to_have_text(["2.1 dB", "2.1 dB", "0.02 dB"])
        expect(shown.locator(".errors")).to_contain_text("+413 nats by what is learned")
        painted = page.evaluate(
            """() => [...document.querySelectorAll("#view-live-model canvas")].map((canvas) =>
              canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height)
                .data.some((value) => value > 0))"""
        )
        assert painted == [True] * 5
        expect_no_violations(page)


def test_the_values_stand_in_a_detail_that_opens(page: Page, lab: Lab) -> None:
    with tracked(lab.client, lab.rig, felt()):
        summary = view(page).get_by_text("240 windows used, 43 refused")
        summary.focus()
        page.keyboard.press("Enter")
        refused = view(page).get_by_role("table", name="could not be used")
        expect(refused.get_by_role("row", name="the finger turned 12")).to_be_visible()
        points = view(page).get_by_role("table", name="Measured, last 10 s of sliding")
        expect(points.locator("tbody tr")).to_have_count(48)
        law = view(page).get_by_role("table", name="Learned, with 95 % intervals")
        expect(law.get_by_role("row", name="Gain, N 0.460 0.442 0.478 0.390")).to_be_visible()
        expect_no_violations(page)


def test_an_alarm_names_the_cause_and_what_to_do(page: Page, lab: Lab) -> None:
    with tracked(lab.client, lab.rig, alarmed()):
        expect(verdict(page)).to_have_text(
            "The model in force is wrong: cutoff, something that no cause explains"
        )
        expect(view(page).locator(".advice li")).to_have_text(
            [
                "cutoff 1.9 times that of the model so far: recalibrate this person",
                "unknown about 400 Hz at 20 to 40 mm/s: run frictus discover",
            ]
        )
        expect(view(page).locator("[data-look=alarm]")).to_have_count(2)
        expect(view(page).locator(".evidence")).to_contain_text(
            "another cause explains it better"
        )
        expect_no_violations(page, WIDTHS)


def test_it_goes_grey_when_estimates_stop_and_comes_back(page: Page, lab: Lab) -> None:
    with tracked(lab.client, lab.rig, felt()):
        expect(view(page).locator(".age")).to_have_text("Up to date")
    age = view(page).locator(".age")
    expect(age).to_have_text(re.compile(r"Last heard \d+ s ago"))
    expect(view(page)).to_have_class(re.compile("stale"))
    expect_no_violations(page)
    with tracked(lab.client, lab.rig, felt()):
        expect(age).to_have_text("Up to date")
        expect(view(page)).not_to_have_class(re.compile("stale"))


def test_history_is_kept_while_another_view_is_shown(page: Page, lab: Lab) -> None:
    with tracked(lab.client, lab.rig, adapted()) as publisher:
        gain = view(page).locator("[data-parameter=gain_n] .chart")
        expect(gain).to_have_attribute("data-entries", re.compile("[1-9]"))
        before = int(gain.get_attribute("data-entries") or 0)
        page.get_by_role("link", name="Models", exact=True).click()
        expect(page.get_by_text("None is published yet")).to_be_visible()
        publisher.show(adapted(3))
        page.get_by_role("link", name="Live model", exact=True).click()
        changes = view(page).get_by_role("list", name="Changes of the model")
        expect(changes.get_by_role("listitem")).to_have_count(3)
        expect(changes.get_by_role("listitem").last).to_contain_text("gain 0.390 → 0.413 N")
        assert int(gain.get_attribute("data-entries") or 0) > before


def test_a_policy_is_asked_for_and_shown_once_the_rig_says_so(
    lab: Lab, open_page: OpenPage
) -> None:
    with open_page() as page, tracked(lab.client, lab.rig, felt()):
        told = Told(page)
        arrive(page, lab)
        expect(policy(page, "Observe")).to_have_attribute("aria-pressed", "true")
        expect(view(page).locator(".held-back")).to_contain_text("known within 7.1 %")
        expect(page.locator("[data-badge=adaptation]")).to_have_count(0)
        expect(policy(page, "Adapt")).to_be_enabled()
        with page.expect_response("**/adaptation"):
            policy(page, "Adapt").press("Enter")
        outcome = view(page).locator(".policy .outcome")
        expect(outcome).to_contain_text("Adapt: asked")
        assert told.asked == [{"policy": "adapt", "undo": False}]
        expect(policy(page, "Observe")).to_have_attribute("aria-pressed", "true")
        told.changes = {"adaptation": "adapt", "adaptations": 2}
        expect(policy(page, "Adapt")).to_have_attribute("aria-pressed", "true")
        expect(outcome).to_have_text("")
        badge = page.locator("[data-badge=adaptation]")
        expect(badge).to_contain_text("Adapts")
        page.get_by_role("link", name="Textures", exact=True).click()
        expect(badge).to_contain_text("follows the finger, changed 2 times")
        page.get_by_role("link", name="Live model", exact=True).click()
        with page.expect_response("**/adaptation"):
            page.get_by_role("button", name="Put the model back").click()
        expect(outcome).to_contain_text("put back")
        # Under `adapt` it would be changed again at once.
        assert told.asked[1:] == [{"policy": "suggest", "undo": True}]
        told.changes = {"adaptation": "suggest", "adaptations": 0}
        expect(policy(page, "Suggest")).to_have_attribute("aria-pressed", "true")
        expect(page.get_by_role("button", name="Put the model back")).to_be_disabled()
        expect(outcome).to_have_text("")
        expect(badge).to_have_count(0)


def test_the_rig_takes_the_policy(page: Page, lab: Lab) -> None:
    for name, chosen in (("Suggest", "suggest"), ("Observe", "observe")):
        policy(page, name).click()
        lab.status(lambda status: status.adaptation == chosen)  # noqa: B023
        expect(policy(page, name)).to_have_attribute("aria-pressed", "true")
        expect(view(page).locator(".policy .outcome")).to_have_text("")


def test_a_refusal_is_told(lab: Lab, open_page: OpenPage) -> None:
    with open_page("Failed to load resource") as page:
        arrive(page, lab)
        refusal = {"code": "conflict", "detail": "a trial of an experiment runs"}
        path = re.compile("/adaptation$")
        page.route(path, lambda route: route.fulfill(status=409, json=refusal))
        policy(page, "Suggest").click()
        outcome = view(page).locator(".policy .outcome")
        expect(outcome).to_have_text("Not changed: a trial of an experiment runs")
        expect(policy(page, "Observe")).to_have_attribute("aria-pressed", "true")


def test_who_may_not_calibrate_looks_on_and_reads_why(lab: Lab, open_page: OpenPage) -> None:
    with (
        read_only(lab) as url,
        tracked(lab.client, lab.rig, felt()),
        open_page(viewport=ONE_SCREEN) as page,
    ):
        enter(page, f"{url}#/live-model/rig1")
        expect(verdict(page)).to_contain_text("off by more than a finger can tell")
        adapt = policy(page, "Adapt")
        expect(adapt).to_be_disabled()
        expect(adapt).to_have_accessible_description(
            re.compile("follow the finger.*needs the scope calibrate")
        )
        expect(page.get_by_role("button", name="Put the model back")).to_be_disabled()
        expect_no_violations(page)


@pytest.mark.parametrize("width", [390, 1024, 1440])
@pytest.mark.parametrize(
    "state", [felt(), alarmed(), adapted()], ids=["felt", "alarm", "adapt"]
)
def test_nothing_is_wider_than_the_screen_and_one_screen_is_enough(
    lab: Lab, open_page: OpenPage, width: int, state: EstimateState
) -> None:
    with (
        open_page(viewport={"width": width, "height": 900}) as page,
        tracked(lab.client, lab.rig, state),
    ):
        arrive(page, lab)
        expect(view(page).locator("[data-points='48']")).to_be_visible()
        wide, high = page.evaluate(
            "[document.documentElement.scrollWidth, document.documentElement.scrollHeight]"
        )
        assert wide <= width
        assert high <= 900 or width < 1440
        cut = page.evaluate(
            """() => [...document.querySelectorAll("#view-live-model :is(p, li, h2, h3)")]
              .filter((each) => each.checkVisibility() && !each.classList.contains("unseen")
                && each.scrollWidth > each.clientWidth + 1)
              .map((each) => each.textContent)"""
        )
        assert cut == []
