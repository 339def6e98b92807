"""Which texture is felt where: drawn, typed, applied, and changed by another hand."""

import numpy as np
import pytest
from playwright.sync_api import Page, Route, expect
from tests.dashboard.conftest import OpenPage
from tests.dashboard.lab import Lab
from tests.dashboard.textures.view import LINES, arrive, choose, part, told_gain

import frictus

pytestmark = pytest.mark.browser


def test_regions_are_drawn_and_typed_and_applied(page: Page, lab: Lab) -> None:
    lab.rig.set_scene(LINES)
    choose(page, "vinyl")
    scene = part(page, "Scene: which texture is felt where")
    expect(scene.get_by_label("Name", exact=True)).to_have_value("Lines")
    expect(scene.get_by_label("Whole screen")).to_be_checked()
    expect(scene).to_contain_text("Drawn as the rig has it.")
    scene.get_by_role("button", name="Remove the region").press("Enter")
    expect(scene.get_by_role("button", name="Add a region")).to_be_focused()
    expect(scene).to_contain_text("Not applied yet.")

    canvas = scene.locator("canvas")
    canvas.scroll_into_view_if_needed()
    box = canvas.bounding_box()
    assert box is not None
    per_mm = min((box["width"] - 52.0) / 70.0, (box["height"] - 52.0) / 35.0)
    middle = (box["x"] + box["width"] / 2.0, box["y"] + box["height"] / 2.0)
    page.mouse.move(middle[0] - 30.0 * per_mm, middle[1] - 10.0 * per_mm)
    page.mouse.down()
    page.mouse.move(middle[0], middle[1] + 10.0 * per_mm, steps=4)
    page.mouse.up()
    drawn = scene.get_by_role("group", name="Region 1")
    drawn.get_by_label("Name").fill("Left")
    expect(drawn.get_by_label("Texture")).to_have_value("vinyl")

    # The other one without a pointer.
    scene.get_by_role("button", name="Add a region").press("Enter")
    typed = scene.get_by_role("group", name="Region 2")
    expect(typed.get_by_label("Name")).to_be_focused()
    page.keyboard.type("Right")
    page.keyboard.press("Tab")
    page.keyboard.type("sandp")
    expect(typed.get_by_label("Texture")).to_have_value("sandpaper")
    values = ("40", "60.5", "5", "30", "1.5", "2")
    page.keyboard.press("Tab")  # over the choice of the whole screen
    for value in values:
        page.keyboard.press("Tab")
        page.keyboard.type(value)
    scene.get_by_label("Name of the scene").fill("halves")
    page.keyboard.press("Enter")
    expect(scene).to_contain_text("rig1 renders it: ")
    expect(scene).to_contain_text("Drawn as the rig has it.")

    state = lab.scene(lambda state: state.scene.name == "halves")
    left, right = state.scene.regions
    assert (left.name, right.name) == ("Left", "Right")
    assert np.allclose(left.x_mm, (5.0, 35.0), atol=0.5)
    assert np.allclose(left.y_mm, (7.5, 27.5), atol=0.5)
    assert (right.x_mm, right.y_mm) == ((40.0, 60.5), (5.0, 30.0))
    assert (right.gain, right.edge_fade_mm) == (1.5, 2.0)
    for region, name in ((left, "vinyl"), (right, "sandpaper")):
        expected = frictus.Spectrum.model_validate(lab.ask("GET", f"/textures/{name}"))
        assert region.texture == expected
    gain = told_gain(state.applied.model_dump())
    expect(scene).to_contain_text(f"rig1 renders the scene halves (Left, Right): {gain}")
    expect(scene).to_contain_text(f"rig1 renders it: {gain}")
    # What ends before it begins is not sent.
    typed.get_by_label("x to, mm").fill("30")
    scene.get_by_role("button", name="Apply the scene").click()
    assert typed.get_by_label("x to, mm").evaluate("field => field.validity.customError")
    assert lab.rig.scene().etag == state.etag


def test_another_hand_on_the_scene_is_noticed(page: Page, lab: Lab) -> None:
    lab.rig.set_scene(LINES)
    scene = part(page, "Scene: which texture is felt where")
    apply = scene.get_by_role("button", name="Apply the scene")
    expect(scene.get_by_label("Name of the scene")).to_have_value("lines")
    # Nothing is changed here: what the rig has is followed.
    lab.rig.set_scene(LINES.model_copy(update={"name": "other lines"}))
    expect(scene.get_by_label("Name of the scene")).to_have_value("other lines")
    expect(scene).to_contain_text("rig1 renders the scene other lines (Lines)")
    # Something is: it is told, and nothing is replaced unseen.
    held: list[Route] = []
    page.route("**/v1/rigs/rig1/scene", lambda route: held.append(route), times=1)
    scene.get_by_label("Name of the scene").fill("mine")
    with page.expect_request("**/v1/rigs/rig1/scene"):
        apply.click()
    lab.rig.set_scene(LINES.model_copy(update={"name": "theirs"}))
    expect(scene).to_contain_text("The rig's scene has changed since this one was begun.")
    held[0].continue_()
    expect(scene).to_contain_text("Not applied to rig1: ")
    expect(scene).to_contain_text("Apply again to replace what stands there now")
    assert lab.rig.scene().scene.name == "theirs"
    apply.click()
    expect(scene).to_contain_text("rig1 renders it: ")
    lab.scene(lambda state: state.scene.name == "mine")
    expect(scene).not_to_contain_text("has changed since")
    scene.get_by_role("button", name="Remove the region").click()
    scene.get_by_role("button", name="Take the rig's scene").click()
    expect(scene.get_by_role("group", name="Region 1")).to_be_visible()
    expect(scene).not_to_contain_text("Not applied")


def test_what_is_changed_while_a_scene_is_on_its_way_is_not_lost(page: Page, lab: Lab) -> None:
    lab.rig.set_scene(LINES)
    scene = part(page, "Scene: which texture is felt where")
    name = scene.get_by_label("Name of the scene")
    expect(name).to_have_value("lines")
    held: list[Route] = []
    page.route("**/v1/rigs/rig1/scene", lambda route: held.append(route), times=1)
    name.fill("first")
    with page.expect_request("**/v1/rigs/rig1/scene"):
        page.keyboard.press("Enter")
    name.fill("second")
    held[0].continue_()
    expect(scene).to_contain_text("rig1 renders it: ")
    expect(scene).to_contain_text("rig1 renders the scene first")
    expect(scene).to_contain_text("Not applied yet.")
    expect(name).to_have_value("second")
    page.keyboard.press("Enter")
    lab.scene(lambda state: state.scene.name == "second")
    expect(scene).to_contain_text("Drawn as the rig has it.")
    expect(scene).not_to_contain_text("has changed since")


def test_who_does_not_hold_the_rig_is_told_who_does_and_may_only_stop(
    page: Page, lab: Lab
) -> None:
    lab.rig.set_scene(LINES)
    choose(page, "vinyl")
    scene = part(page, "Scene: which texture is felt where")
    feel = part(page, "Preview").get_by_role("button", name="Feel it")
    apply = scene.get_by_role("button", name="Apply the scene")
    with lab.rig.arm(lease_ms=10_000):
        for shown, button in ((scene, apply), (part(page, "Preview"), feel)):
            expect(shown).to_contain_text("tester holds rig1")
            expect(button).to_be_disabled()
        expect(page.locator("#owner")).to_have_text("Held by tester")
        expect(page.get_by_role("button", name="Arm", exact=True)).to_be_disabled()
        expect(page.locator("#stop")).to_be_enabled()
        page.get_by_role("link", name="Calibrate", exact=True).click()
        expect(page.get_by_role("button", name="Arm the rig and start")).to_be_disabled()
        expect(page.locator("#view-calibrate")).to_contain_text("tester holds rig1")
        page.get_by_role("link", name="Textures", exact=True).click()
        page.locator("#stop").click()
        lab.status(lambda status: status.state == "disarmed")
        expect(page.locator("#stop-outcome")).to_contain_text("rig1 answered the stop")
    ended = lab.rig.status().last_end
    assert ended is not None
    assert ended.by is not None
    assert ended.by.startswith("local.page-")
    expect(apply).to_be_enabled()
    with lab.rig.arm(share_with=["local"]):
        expect(page.locator("#owner")).to_have_text(
            "Held by tester, shared with everybody here"
        )
        expect(apply).to_be_enabled()
        feel.click()
        expect(part(page, "Preview")).to_contain_text("vinyl is on rig1: ")
        assert lab.rig.scene().scene.name == "vinyl"


UNKNOWN = {"code": "outcome_unknown", "status": 504, "title": "?", "detail": "no answer"}


def test_an_unknown_outcome_is_said_to_be_unknown_and_resolved_by_the_state(
    lab: Lab, open_page: OpenPage
) -> None:
    lab.rig.set_scene(LINES)
    with open_page(expected="status of 504") as page:
        arrive(page, lab)
        scene = part(page, "Scene: which texture is felt where")
        apply = scene.get_by_role("button", name="Apply the scene")
        name = scene.get_by_label("Name of the scene")
        expect(name).to_have_value("lines")
        sent: list[frictus.Scene] = []

        def unanswered(route: Route) -> None:
            sent.append(frictus.Scene.model_validate(route.request.post_data_json))
            route.fulfill(status=504, json=UNKNOWN, content_type="application/problem+json")

        page.route("**/v1/rigs/rig1/scene", unanswered)
        name.fill("late")
        apply.click()
        expect(scene).to_contain_text("Unknown whether rig1 did it, checking…")
        lab.rig.set_scene(sent[0])  # now it does what it was asked
        expect(scene).to_contain_text("rig1 renders it: ")
        expect(scene).to_contain_text("Drawn as the rig has it.")
        name.fill("never")
        apply.click()
        expect(scene).to_contain_text("Unknown whether rig1 did it, checking…")
        expect(scene).to_contain_text("It is not known whether this was done: no answer")
        expect(scene).to_contain_text("rig1 renders the scene late")
        expect(scene).to_contain_text("Not applied yet.")


def test_a_service_that_does_not_answer_leaves_the_outcome_unknown(
    lab: Lab, open_page: OpenPage
) -> None:
    lab.rig.set_scene(LINES)
    with open_page(expected="ERR_CONNECTION_RESET") as page:
        arrive(page, lab, "vinyl")
        feel = part(page, "Preview").get_by_role("button", name="Feel it")

        def broken(route: Route) -> None:
            route.fetch()  # it is done
            route.abort("connectionreset")

        page.route("**/v1/rigs/rig1/scene", broken)
        feel.click()
        expect(part(page, "Preview")).to_contain_text("vinyl is on rig1: ")
        assert lab.rig.scene().scene.name == "vinyl"
