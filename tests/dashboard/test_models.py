"""The view of the models before a real daemon: listed, compared, drawn, activated, aliased."""

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Locator, Page, Route, expect
from tests.dashboard.conftest import OpenPage
from tests.dashboard.lab import WIDTHS, Lab, enter, expect_no_violations, read_only, running

from frictus_hardware import SimulatedConfig
from frictus_hardware.physics.friction import FrictionLaw, frequency_response

pytestmark = pytest.mark.browser

NAME = "rig1/P01"
PROVENANCE = {
    "study_sha256": "ab" * 32,
    "code_version": "0.1.0",
    "settings": {"tones_hz": [31, 217]},
}
COVARIANCE = {
    "parameters": ["gain_n", "cutoff_0_hz", "slope_hz_per_mm_s"],
    "matrix": [[1e-4, 0.0, 0.0], [0.0, 25.0, 0.0], [0.0, 0.0, 0.04]],
}
DELAYED = [
    {"id": "direction_asymmetry", "parameters": {"share": 0.05}},
    {"id": "channel_delay", "parameters": {"delay_s": 1e-5}},
]


def model(gain_n: float, **changes: Any) -> dict[str, Any]:
    law = {"gain_n": gain_n, "cutoff_0_hz": 400.0, "slope_hz_per_mm_s": 12.0}
    return {
        "schema": "model/1",
        "base": {"law": "first_order_speed", **law},
        "participant": "P01",
        "provenance": PROVENANCE,
        "covariance": COVARIANCE,
        **changes,
    }


def publish(lab: Lab, model: dict[str, Any], name: str = NAME) -> None:
    body = {"name": name, "rig": "rig1", "comment": "by a test", "model": model}
    lab.ask("POST", "/models", body)


@pytest.fixture(scope="module")
def lab(browser: object, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Lab]:
    """A daemon with models: two versions of one name, one with effects, one of another rig."""
    with running(tmp_path_factory.mktemp("lab"), backend=SimulatedConfig()) as lab:
        publish(lab, model(0.4))
        publish(lab, model(0.5))
        publish(lab, model(0.4, effects=DELAYED, participant=None), "population")
        simulated = PROVENANCE | {"simulated": True}
        publish(lab, model(0.3, participant="P02", provenance=simulated), "rig2/P02")
        yield lab


@pytest.fixture
def page(lab: Lab, open_page: OpenPage) -> Iterator[Page]:
    with open_page(expected="status of 4", accept_downloads=True) as page:
        page.goto(lab.url)
        expect(page.locator("#connection")).to_have_text("Live")
        page.get_by_role("link", name="Models", exact=True).click()
        expect(listed(page, f"{NAME}@2")).to_be_visible()
        yield page


def table(page: Page, caption: str) -> Locator:
    return page.get_by_role("table", name=caption)


def listed(page: Page, reference: str) -> Locator:
    """The link to a version in the list of all."""
    published = table(page, "Published models, newest first")
    return published.get_by_role("link", name=reference, exact=True)


def show(page: Page, reference: str) -> None:
    listed(page, reference).click()
    expect(page.get_by_role("heading", name=reference, exact=True)).to_be_visible()


def test_lists_what_is_published_and_filters_it(page: Page) -> None:
    rows = table(page, "Published models, newest first").locator("tbody tr")
    expect(rows).to_have_count(3)  # the newest of each name
    page.get_by_label("Newest versions only").uncheck()
    expect(rows).to_have_count(4)
    page.get_by_label("Participant").fill("P02")
    page.get_by_role("button", name="Filter").click()
    expect(rows).to_have_count(1)
    expect(rows).to_contain_text("rig2/P02@1")
    expect(rows).to_contain_text("rig1 (simulated)")
    page.get_by_label("Participant").fill("nobody")
    page.keyboard.press("Enter")
    expect(page.get_by_text("No published model fits the filter.")).to_be_visible()


def test_says_where_a_model_comes_from_and_what_it_adds(page: Page) -> None:
    show(page, "population@1")
    view = page.locator("#view-models")
    for told in ("ab" * 32, "0.1.0", "tones_hz", "by a test", "20 to 100 mm/s", "by local"):
        expect(view).to_contain_text(told)
    effects = table(page, "What it adds to the base law")
    expect(effects).to_contain_text("direction asymmetry")
    expect(effects).to_contain_text("share 0.05")
    expect(view).to_contain_text("Effects are not drawn: population@1 (direction_asymmetry")


def test_draws_and_compares_two_models(page: Page) -> None:
    show(page, f"{NAME}@2")
    page.get_by_role("link", name=f"with {NAME}@1").click()
    found = table(page, f"{NAME}@1 less {NAME}@2")
    gain = found.get_by_role("row", name="gain_n")
    # The difference of two with a standard error of 0.01 each.
    for told in ("0.5", "0.4", "-0.1", "-0.1277 to -0.07228", "-20 %", "yes"):
        expect(gain.get_by_role("cell", name=told, exact=True)).to_be_visible()
    slope = found.get_by_role("row", name="slope_hz_per_mm_s")
    expect(slope.get_by_role("cell", name="no", exact=True)).to_be_visible()
    expect(found.get_by_role("row", name="cutoff at 60 mm/s")).to_contain_text("1120")
    page.get_by_label("Speeds, mm/s").fill("40, 150")
    page.get_by_role("button", name="Draw").click()
    keys = page.locator("#view-models .keys li")
    expect(keys).to_have_count(4)
    expect(keys.first).to_have_text(f"{NAME}@2 at 40 mm/s: cutoff 880 Hz")
    expect(keys.last).to_contain_text("cutoff 1600 Hz, as at 100 mm/s")
    assert drawn(page) == [True, True]
    page.get_by_text("As tables").click()
    check_bode(table(page, "At 40 mm/s"), (FrictionLaw(0.5, 400.0, 12.0), 40.0))
    check_bode(table(page, "At 150 mm/s"), (FrictionLaw(0.5, 400.0, 12.0), 150.0))
    page.get_by_label("Speeds, mm/s").fill("fast")
    page.get_by_role("button", name="Draw").click()
    expect(page.get_by_text("Speeds: up to 3 numbers from 0 to 1000")).to_be_visible()


def drawn(page: Page) -> Any:
    return page.evaluate(
        """() => [...document.querySelectorAll("#view-models canvas")].map((canvas) => {
          const { data } = canvas.getContext("2d").getImageData(
            0, 0, canvas.width, canvas.height);
          return data.some((value) => value > 0);
        })"""
    )


def check_bode(told: Locator, model: tuple[FrictionLaw, float]) -> None:
    """Compare what the page says of the first model with the equation's own place."""
    rows = [row.split("\t") for row in told.locator("tbody").inner_text().splitlines()]
    values = np.array([[float(cell) for cell in row] for row in rows])
    law, speed_mm_s = model
    true = frequency_response(law, values[:, 0], speed_mm_s)
    np.testing.assert_allclose(values[:, 1], 20.0 * np.log10(np.abs(true)), atol=0.006)
    np.testing.assert_allclose(values[:, 3], np.degrees(np.angle(true)), atol=0.06)


def test_refuses_in_the_services_words(page: Page) -> None:
    show(page, f"{NAME}@2")
    page.get_by_label("Model B").fill("rig1/nobody@3")
    page.get_by_role("button", name="Draw").click()
    expect(page.locator("#view-models")).to_contain_text("Not shown: ")
    expect(page.locator("#view-models")).to_contain_text("rig1/nobody")


def test_activates_a_version_on_the_rig(page: Page, lab: Lab) -> None:
    etags = {}
    for reference in ("population@1", f"{NAME}@2"):
        show(page, reference)
        page.get_by_role("button", name="Activate on rig1").click()
        expect(page.get_by_text(f"rig1 confirmed {reference} as published")).to_be_visible()
        etags[reference] = lab.ask("GET", f"/models/{reference}")["etag"]
        assert lab.rig.model().etag == etags[reference]
        expect(page.get_by_text("✓ rig1 applies this version.")).to_be_visible()
        if reference == "population@1":
            left = page.get_by_text("What the rig does not make good:").locator("xpath=..")
            expect(left).to_contain_text("channel_delay")
    active = table(page, "Published models, newest first").locator("tr", has_text="active")
    expect(active).to_contain_text(f"{NAME}@2")
    page.get_by_text("Who moved aliases, and gave versions to rigs").click()
    expect(table(page, "Given to rigs, newest first")).to_contain_text("as published")
    with lab.rig.arm(lease_ms=10_000):
        expect(page.get_by_role("button", name="Activate on rig1")).to_be_disabled()
    expect(page.get_by_role("button", name="Activate on rig1")).to_be_enabled()


def lost(route: Route) -> None:
    route.abort("connectionreset")


def not_noted(route: Route) -> None:
    problem = {"status": 503, "code": "not_noted", "detail": "rig 'rig1' applies it now"}
    route.fulfill(status=503, json=problem, content_type="application/problem+json")


@pytest.mark.parametrize(
    ("answer", "expected"), [(lost, "ERR_CONNECTION_RESET"), (not_noted, "503")]
)
def test_an_activation_that_was_not_answered_or_noted_is_told_by_the_rig(
    lab: Lab, open_page: OpenPage, answer: Callable[[Route], None], expected: str
) -> None:
    version = lab.ask("GET", "/models/population@1")
    with open_page(expected=expected) as page:
        page.goto(f"{lab.url}/dashboard/#/models/rig1/population@1")

        def applied(route: Route) -> None:
            route.fetch()
            answer(route)

        page.route("**/model/activate", applied)
        page.get_by_role("button", name="Activate on rig1").click()
        expect(page.get_by_text("rig1 applies it. Activate it again")).to_be_visible()
        assert lab.rig.model().etag == version["etag"]


def test_moves_an_alias_that_nobody_else_has_moved(page: Page, lab: Lab) -> None:
    path = f"/models/{NAME}/aliases/production"
    show(page, f"{NAME}@2")
    page.get_by_label("Reason").fill("narrower intervals")
    page.get_by_role("button", name="Let it stand for version 2").click()
    expect(page.get_by_text(f"{NAME}@production stands for version 2.")).to_be_visible()
    versions = table(page, "Versions and aliases of this name")
    row = versions.get_by_role("row").filter(has_text="production")
    expect(row.get_by_role("link", name="2", exact=True)).to_be_visible()
    # Another hand moves it meanwhile: this page has not seen that.
    lab.ask("PUT", path, {"version": 1}, **{"If-Match": "*"})
    page.get_by_role("button", name="Let it stand for version 2").click()
    expect(page.get_by_text("Not moved: it has changed")).to_be_visible()
    assert lab.ask("GET", path)["version"] == 1
    page.get_by_role("button", name="Let it stand for version 2").click()
    expect(page.get_by_text("stands for version 2, before for version 1")).to_be_visible()
    assert lab.ask("GET", path)["version"] == 2
    page.get_by_text("Who moved aliases, and gave versions to rigs").click()
    expect(table(page, "Aliases moved, newest first")).to_contain_text("narrower intervals")


def test_anybody_can_use_it(page: Page) -> None:
    show(page, f"{NAME}@2")
    page.get_by_role("link", name=f"with {NAME}@1").click()
    expect(table(page, f"{NAME}@1 less {NAME}@2")).to_be_visible()
    for summary in page.locator("#view-models summary").all():
        summary.click()
    expect_no_violations(page, WIDTHS)


def test_reader_saves_files_and_sees_no_button_that_would_fail(
    lab: Lab, open_page: OpenPage
) -> None:
    with read_only(lab) as url, open_page(accept_downloads=True) as page:
        enter(page, f"{url}#/models/rig1/rig1%2FP01%401")
        expect(page.get_by_role("heading", name=f"{NAME}@1")).to_be_visible()
        expect(page.get_by_text("rig1 applies")).to_be_visible()
        for name in ("Activate", "Let it stand"):
            expect(page.get_by_role("button", name=re.compile(name))).to_be_hidden()
        for file, begins in (("model.json", b"{"), ("model.mat", b"MATLAB 5.0")):
            with page.expect_download() as saved:
                page.get_by_role("button", name=f"Save {file}").click()
            ending = file.removeprefix("model")
            assert saved.value.suggested_filename == f"rig1-P01-1{ending}"
            assert Path(saved.value.path()).read_bytes().startswith(begins)
