"""The library before a real daemon: looked at, made, changed and deleted."""

import math
import re

import pytest
from playwright.sync_api import Page, Route, expect
from tests.dashboard.lab import Lab
from tests.dashboard.textures.view import choose, figure, links, names, part, told_gain

import frictus
from frictus_service.fidelity.preview import NOMINAL_HZ

pytestmark = pytest.mark.browser


def levels(page: Page) -> dict[float, float]:
    """Return what the table says of the levels, dB."""
    preview = part(page, "Preview")
    figure = preview.locator("figure").filter(has=page.get_by_text("Level in third octaves"))
    rows = figure.locator("tbody tr").evaluate_all(
        "rows => rows.map((row) => [...row.cells].map((cell) => cell.textContent))"
    )
    return {float(band): float(level) for band, level in rows if level[-1].isdigit()}


def in_db(rms_n: list[float]) -> dict[float, float]:
    return {
        band: round(20.0 * math.log10(rms), 1)
        for band, rms in zip(NOMINAL_HZ, rms_n, strict=True)
        if rms > 0.0
    }


def test_lists_the_library_and_the_address_names_what_is_shown(page: Page, lab: Lab) -> None:
    assert links(page).all_text_contents() == names(lab)
    page.get_by_label("Find by name").fill("fab")
    assert links(page).all_text_contents() == ["fabric1", "fabric2"]
    page.keyboard.press("Tab")
    page.keyboard.press("Enter")
    expect(page).to_have_url(re.compile("#/textures/rig1/fabric1$"))
    expect(part(page, "Preview").get_by_role("heading", name="fabric1")).to_be_visible()
    page.reload()
    expect(part(page, "Preview").get_by_role("heading", name="fabric1")).to_be_visible()
    expect(links(page).and_(page.locator("[aria-current]"))).to_have_text("fabric1")
    listed = lab.ask("GET", "/textures")["textures"]
    own = sum(not texture["shipped"] for texture in listed)
    expect(part(page, "Library")).to_contain_text(f"{len(listed)} textures, {own} yours")
    page.get_by_role("link", name="Textures", exact=True).click()
    expect(part(page, "Preview").get_by_role("heading", name="fabric1")).to_be_visible()


def test_preview_is_what_the_service_says_and_feeling_what_the_rig_applies(
    page: Page, lab: Lab
) -> None:
    choose(page, "sandpaper")
    texture = lab.ask("GET", "/textures/sandpaper")
    preview = part(page, "Preview")
    for speed in (50, 20):
        found = lab.ask("POST", f"/preview?speed_mm_s={speed}&rig=rig1", texture)
        preview.get_by_label("Speed of the finger").fill(str(speed))
        page.keyboard.press("Enter")
        expect(preview.get_by_text(f"Level in third octaves at {speed} mm/s")).to_be_visible()
        assert levels(page) == in_db(found["rms_n"])
    feasible = figure(found["applied"]["feasible_gain"])
    said = preview.get_by_role("status").filter(has_text="On rig1: ")
    expect(said).to_contain_text(f"feasible gain {feasible}; {told_gain(found['applied'])}")
    (course,) = found["courses"]
    least, most = (figure(end(course["friction_n"])) for end in (min, max))
    expect(preview).to_contain_text(f"{least} to {most} N")
    preview.get_by_role("button", name="Feel it").click()
    expect(preview).to_contain_text(f"sandpaper is on rig1: {told_gain(found['applied'])}")
    expect(preview.locator(".outcome").first).to_contain_text("Arm the rig to feel it")
    applied = lab.rig.scene().applied
    assert applied.model_dump(mode="json") == found["applied"]
    scene = part(page, "Scene: which texture is felt where")
    expect(scene).to_contain_text("rig1 renders the scene sandpaper (sandpaper): ")
    expect(scene).to_contain_text("It is disarmed: arm it to feel this.")


def new(page: Page, kind: str, name: str, fields: dict[str, str]) -> None:
    page.get_by_role("button", name="New texture").click()
    editor = part(page, "Editor")
    editor.get_by_label("Name in the library").fill(name)
    editor.get_by_label("Kind").select_option(kind)
    for label, value in fields.items():
        editor.get_by_role("spinbutton", name=label).fill(value)


def save(page: Page) -> None:
    part(page, "Editor").get_by_role("button", name="Save to the library").click()


def test_a_draft_that_cannot_be_read_says_that_it_is_not_previewed(page: Page) -> None:
    editor, preview = part(page, "Editor"), part(page, "Preview")
    new(page, "beta", "never-saved", {"Strength": "0.04"})
    expect(preview).to_contain_text("0.04 N rms")
    editor.get_by_label("Strength").fill("2000")
    told = editor.get_by_role("status").first
    expect(told).to_contain_text("Strength, N rms: ")
    expect(told).to_contain_text("10. The preview is of the draft before.")
    expect(preview).to_contain_text("0.04 N rms")
    editor.get_by_label("Strength").fill("0.06")
    expect(preview).to_contain_text("0.06 N rms")
    expect(editor.get_by_text("of the draft before")).to_have_count(0)
    editor.get_by_role("button", name="Close").click()


def test_makes_textures_that_are_previewed_before_they_are_saved(page: Page, lab: Lab) -> None:
    editor, preview = part(page, "Editor"), part(page, "Preview")
    new(page, "spectrum", "made-spectrum", {"Direction": "30"})
    editor.get_by_label("Amplitude, N, component 1").fill("0.03")
    editor.get_by_label("Frequency, component 1").fill("4")
    editor.get_by_role("button", name="Add a component").click()
    expect(editor.get_by_label("Amplitude, N, component 2")).to_be_focused()
    page.keyboard.type("0.04")
    editor.get_by_label("Unit, component 2").select_option("Hz")
    editor.get_by_label("Frequency, component 2").fill("80")
    editor.get_by_label("Phase, rad, component 2").fill("1.5")
    expect(preview.get_by_role("heading", name="The draft, not saved")).to_be_visible()
    expect(preview).to_contain_text("strongest in the band of 80 Hz, -31.0 dB")
    assert "made-spectrum" not in names(lab)
    save(page)
    expect(preview.get_by_role("heading", name="made-spectrum")).to_be_visible()
    saved = frictus.Spectrum.model_validate(lab.ask("GET", "/textures/made-spectrum"))
    assert saved == frictus.Spectrum(
        components=[
            frictus.Component(amplitude_n=0.03, cycles_per_mm=4.0),
            frictus.Component(amplitude_n=0.04, hz=80.0, phase_rad=1.5),
        ],
        angle_deg=30.0,
    )

    shape = {"Alpha": "4", "Beta": "2.5", "Strength": "0.02", "Seed": "7"}
    new(page, "beta", "made-beta", {**shape, "Felt so at": ""})
    save(page)
    expect(preview.get_by_role("heading", name="made-beta")).to_be_visible()
    saved_beta = frictus.Beta.model_validate(lab.ask("GET", "/textures/made-beta"))
    assert saved_beta == frictus.Beta(alpha=4.0, beta=2.5, rms_n=0.02, seed=7)

    orders = {"Order below the peak": "3", "Order above the peak": "1"}
    new(page, "slope", "made-slope", {**orders, "Peak, Hz": "120", "Strength": "0.02"})
    save(page)
    expect(preview.get_by_role("heading", name="made-slope")).to_be_visible()
    expect(page).to_have_url(re.compile("#/textures/rig1/made-slope$"))
    saved_slope = frictus.Slope.model_validate(lab.ask("GET", "/textures/made-slope"))
    assert saved_slope == frictus.Slope(
        peak_hz=120.0, low_order=3, high_order=1, rms_n=0.02, speed_mm_s=50.0
    )
    # What the service would refuse is not sent, and closing shows what is saved.
    editor.get_by_label("Strength").fill("0")
    save(page)
    assert editor.get_by_label("Strength").evaluate("field => field.validity.rangeUnderflow")
    editor.get_by_label("Strength").fill("0.5")
    expect(preview.get_by_role("heading", name="The draft, not saved")).to_be_visible()
    editor.get_by_role("button", name="Close").click()
    expect(preview.get_by_role("heading", name="made-slope")).to_be_visible()
    expect(preview).to_contain_text("0.02 N rms, as felt at 50 mm/s")


def test_a_shipped_one_is_copied_and_a_change_meanwhile_is_told(page: Page, lab: Lab) -> None:
    choose(page, "paper")
    shipped = lab.ask("GET", "/textures/paper")
    expect(page.get_by_role("button", name="Delete")).to_be_hidden()
    page.get_by_role("button", name="Edit a copy").click()
    editor = part(page, "Editor")
    expect(editor.get_by_role("heading", name="A copy of paper")).to_be_visible()
    editor.get_by_label("Direction").fill("90")
    editor.get_by_label("Name in the library").fill("sandpaper")
    save(page)
    expect(editor.get_by_text("Not saved: 'sandpaper' is shipped")).to_be_visible()
    editor.get_by_label("Name in the library").fill("paper-across")
    save(page)
    expect(part(page, "Preview").get_by_role("heading", name="paper-across")).to_be_visible()
    assert lab.ask("GET", "/textures/paper-across") == shipped | {"angle_deg": 90.0}
    assert lab.ask("GET", "/textures/paper") == shipped

    lab.ask("PUT", "/textures/paper-across", shipped, **{"If-Match": "*"})
    editor.get_by_label("Direction").fill("45")
    save(page)
    expect(editor.get_by_text("Save again to replace what stands there now")).to_be_visible()
    assert lab.ask("GET", "/textures/paper-across") == shipped
    save(page)
    expect(editor.get_by_text("paper-across is saved")).to_be_visible()
    assert lab.ask("GET", "/textures/paper-across")["angle_deg"] == 45.0


def test_deletes_after_a_second_question(page: Page, lab: Lab) -> None:
    beta = {"kind": "beta", "alpha": 2.0, "beta": 2.0, "rms_n": 0.01}
    for name in ("doomed", "spared"):
        lab.ask("PUT", f"/textures/{name}", beta, **{"If-None-Match": "*"})
    page.get_by_role("link", name="Models", exact=True).click()
    page.get_by_role("link", name="Textures", exact=True).click()
    choose(page, "doomed")
    page.get_by_role("button", name="Delete").click()
    expect(page.get_by_role("button", name="Delete doomed for good")).to_be_focused()
    choose(page, "spared")
    page.get_by_role("button", name="Delete").dblclick()
    choose(page, "doomed")
    page.get_by_role("button", name="Delete", exact=True).press("Enter")
    # Somebody else changes it: it is not what was looked at.
    lab.ask("PUT", "/textures/doomed", beta | {"alpha": 3.0}, **{"If-Match": "*"})
    page.get_by_role("button", name="Delete doomed for good").press("Enter")
    expect(part(page, "Preview")).to_contain_text("doomed is not deleted: ")
    expect(part(page, "Preview")).to_contain_text("\u03b1 3")
    page.get_by_role("button", name="Delete", exact=True).press("Enter")
    page.get_by_role("button", name="Delete doomed for good").press("Enter")
    expect(
        part(page, "Preview").get_by_role("heading", name="Choose a texture")
    ).to_be_visible()
    expect(page.get_by_role("button", name="New texture")).to_be_focused()
    expect(links(page).get_by_text("doomed", exact=True)).to_have_count(0)
    assert "doomed" not in names(lab)
    assert "spared" in names(lab)


def test_what_was_asked_earlier_does_not_come_up_later(page: Page) -> None:
    held: list[Route] = []
    page.route("**/v1/textures/flat", lambda route: held.append(route))
    links(page).get_by_text("flat", exact=True).click()
    choose(page, "vinyl")
    expect(part(page, "Preview")).to_contain_text("A spectrum of ")
    assert held
    for route in list(held):  # its picture in the list is asked for besides
        with page.expect_request_finished(lambda asked: asked.url.endswith("/flat")):
            route.continue_()
    expect(part(page, "Preview").get_by_role("heading", name="vinyl")).to_be_visible()
    before = part(page, "Preview").inner_text()
    # An answer that is worked through before: what came of the older one would be seen by now.
    page.get_by_label("Find by name").fill("vin")
    expect(links(page)).to_have_count(1)
    assert part(page, "Preview").inner_text() == before
