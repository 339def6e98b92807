"""Textures as somebody composes with them: trimmed, seen, heard, undone, moved, compared."""

import base64
import io
import re

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import FloatRect, Locator, Page, expect
from tests.dashboard.lab import WIDTHS, Lab, expect_no_violations
from tests.dashboard.textures.view import LINES, choose, drop, links, names, part, wav

import frictus

pytestmark = pytest.mark.browser


def box_of(where: Locator) -> FloatRect:
    where.scroll_into_view_if_needed()
    box = where.bounding_box()
    assert box is not None
    return box


def drag(page: Page, begin: tuple[float, float], end: tuple[float, float]) -> None:
    page.mouse.move(*begin)
    page.mouse.down()
    page.mouse.move(*end, steps=5)
    page.mouse.up()


def test_a_recording_is_trimmed_before_it_is_a_texture(page: Page, lab: Lab) -> None:
    drop(page, "trimmed.wav", wav({100.0: 0.3}, seconds=1.0))
    recorded = part(page, "A recording becomes a texture")
    expect(recorded).to_contain_text("1 s of 1 s becomes the texture.")
    wave = recorded.get_by_role("img", name="Waveform of the recording, 1 s")
    box = box_of(wave)
    middle = box["y"] + box["height"] / 2.0
    drag(
        page,
        (box["x"] + 0.25 * box["width"], middle),
        (box["x"] + 0.75 * box["width"], middle),
    )
    expect(recorded.get_by_label("Part from")).to_have_value(re.compile(r"^0\.2[45]\d*$"))
    expect(recorded.get_by_label("Part to")).to_have_value(re.compile(r"^0\.7[45]\d*$"))
    # By keys, too.
    recorded.get_by_label("Part from").fill("0.6")
    recorded.get_by_label("Part to").fill("0.5")
    recorded.get_by_label("Speed of the recording").fill("40")
    recorded.get_by_role("button", name="Make it a texture").click()
    assert recorded.get_by_label("Part to").evaluate("field => field.validity.customError")
    recorded.get_by_label("Part to").fill("0.8")
    expect(recorded).to_contain_text("0.2 s of 1 s becomes the texture.")
    listen = recorded.get_by_role("button", name="Listen to the part")
    listen.click()
    expect(listen).to_have_attribute("aria-pressed", "false")  # it has been played
    recorded.get_by_role("button", name="Make it a texture").click()
    expect(recorded).to_contain_text("trimmed.wav is in the library as trimmed")
    assert lab.ask("GET", "/textures/trimmed")["period_mm"] == pytest.approx(8.0)
    expect(recorded.locator("canvas")).to_be_hidden()


def test_a_single_column_is_drawn_once_its_rate_is_known(page: Page, lab: Lab) -> None:
    lines = "\n".join(f"{value:.4f}" for value in 0.1 * np.sin(np.arange(400) / 5.0))
    drop(page, "column.csv", lines.encode())
    recorded = part(page, "A recording becomes a texture")
    expect(recorded.get_by_label("Speed of the recording")).to_be_focused()
    expect(recorded.locator("canvas")).to_be_hidden()
    recorded.get_by_label("Sample rate").fill("2000")
    page.keyboard.press("Tab")
    expect(recorded).to_contain_text("0.2 s of 0.2 s becomes the texture.")
    # What cannot be drawn is the service's to judge: nothing of it is trimmed.
    drop(page, "noise.wav", b"RIFF, but not really")
    expect(recorded.get_by_label("Name in the library")).to_have_value("noise")
    expect(recorded.locator("canvas")).to_be_hidden()
    assert recorded.get_by_label("Part to").is_disabled()


def test_where_a_file_may_be_dropped_is_marked(page: Page) -> None:
    recorded = part(page, "A recording becomes a texture")
    dispatch = """(type) => {
      const dataTransfer = new DataTransfer();
      dataTransfer.items.add(new File(["x"], "x.wav"));
      const made = { dataTransfer, bubbles: true, cancelable: true, relatedTarget: null };
      document.body.dispatchEvent(new DragEvent(type, made));
    }"""
    page.evaluate(dispatch, "dragover")
    expect(recorded).to_have_attribute("data-dropping", "")
    page.evaluate(dispatch, "dragleave")
    expect(recorded).not_to_have_attribute("data-dropping", "")
    page.evaluate(dispatch, "dragover")
    page.evaluate(dispatch, "drop")
    expect(recorded).not_to_have_attribute("data-dropping", "")


def test_textures_have_pictures_and_are_heard(page: Page, lab: Lab) -> None:
    beta = {"kind": "beta", "alpha": 2.0, "beta": 2.0, "rms_n": 0.01}
    lab.ask("PUT", "/textures/a-beta", beta, **{"If-None-Match": "*"})
    page.reload()
    expect(links(page).first).to_have_text("a-beta")
    seen = part(page, "Library").locator("canvas[data-drawn]")
    expect(seen.nth(2)).to_be_attached()
    painted = seen.first.evaluate(
        """(canvas) => canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height)
          .data.some((value) => value > 0)"""
    )
    assert painted
    choose(page, "vinyl")
    listen = part(page, "Preview").get_by_role("button", name="Listen", exact=True)
    listen.press("Enter")
    stop = part(page, "Preview").get_by_role("button", name="Stop the sound")
    expect(stop).to_have_attribute("aria-pressed", "true")
    stop.press("Enter")
    expect(listen).to_have_attribute("aria-pressed", "false")
    listen.click()
    choose(page, "paper")  # another one: the sound of the first ends
    expect(listen).to_have_attribute("aria-pressed", "false")


def test_a_draft_is_undone_and_marked_until_it_is_saved(page: Page, lab: Lab) -> None:
    page.get_by_role("button", name="New texture").click()
    editor, preview = part(page, "Editor"), part(page, "Preview")
    undo = editor.get_by_role("button", name="Undo")
    expect(editor).to_contain_text("Not saved yet.")
    expect(undo).to_be_disabled()
    editor.get_by_label("Amplitude, N, component 1").fill("0.03")
    expect(preview).to_contain_text("-33.5 dB")
    editor.get_by_label("Kind").select_option("slope")
    expect(preview).to_contain_text("Noise around 200 Hz")
    undo.press("Enter")
    expect(preview).to_contain_text("A spectrum of 1 component.")
    expect(editor.get_by_label("Amplitude, N, component 1")).to_have_value("0.03")
    expect(undo).to_be_focused()
    undo.press("Enter")
    expect(editor.get_by_label("Amplitude, N, component 1")).to_have_value("0.05")
    expect(editor.get_by_role("button", name="Redo")).to_be_focused()
    editor.get_by_role("button", name="Redo").press("Enter")
    expect(editor.get_by_label("Amplitude, N, component 1")).to_have_value("0.03")
    editor.get_by_label("Name in the library").fill("undone")
    editor.get_by_role("button", name="Save to the library").click()
    expect(editor).to_contain_text("undone is saved")
    expect(editor.get_by_text("Not saved yet.")).to_be_hidden()
    assert "undone" in names(lab)
    editor.get_by_label("Direction").fill("10")
    expect(editor.get_by_text("Not saved yet.")).to_be_visible()
    editor.get_by_label("Direction").fill("0")
    expect(editor.get_by_text("Not saved yet.")).to_be_hidden()


def test_regions_are_moved_resized_undone_and_marked(page: Page, lab: Lab) -> None:
    texture = LINES.regions[0].texture
    left = frictus.Region(name="L", x_mm=(5.0, 25.0), y_mm=(10.0, 25.0), texture=texture)
    right = frictus.Region(name="R", x_mm=(40.0, 60.0), y_mm=(10.0, 25.0), texture=texture)
    lab.rig.set_scene(frictus.Scene(name="two", regions=[left, right]))
    scene = part(page, "Scene: which texture is felt where")
    expect(scene.get_by_label("Name of the scene")).to_have_value("two")
    box = box_of(scene.locator("canvas"))
    per_mm = min((box["width"] - 52.0) / 70.0, (box["height"] - 52.0) / 35.0)

    def on_page(x_mm: float, y_mm: float) -> tuple[float, float]:
        middle = (box["x"] + box["width"] / 2.0, box["y"] + box["height"] / 2.0)
        return middle[0] + per_mm * (x_mm - 35.0), middle[1] + per_mm * (y_mm - 17.5)

    one, two = (scene.get_by_role("group", name=f"Region {number}") for number in (1, 2))
    drag(page, on_page(15.0, 17.0), on_page(29.6, 17.0))  # by 14.6 mm: it snaps to the other
    expect(one.get_by_label("x from, mm")).to_have_value("20")
    expect(one.get_by_label("x to, mm")).to_have_value("40")
    expect(one.get_by_label("y from, mm")).to_have_value("10")
    expect(one.locator("legend")).to_have_text("Region 1 · not applied")
    expect(two.locator("legend")).to_have_text("Region 2")
    expect(scene.locator("p[data-unapplied]")).to_contain_text("Not applied yet.")
    colours = [
        each.evaluate("each => getComputedStyle(each).borderInlineStartColor")
        for each in (one, two)
    ]
    assert colours[0] != colours[1]
    drag(page, on_page(60.0, 25.0), on_page(69.5, 30.0))  # a corner
    expect(two.get_by_label("x to, mm")).to_have_value("70")
    expect(two.get_by_label("y to, mm")).to_have_value("30")
    expect(two.get_by_label("x from, mm")).to_have_value("40")
    undo = scene.get_by_role("button", name="Undo")
    undo.press("Enter")
    expect(two.get_by_label("x to, mm")).to_have_value("60")
    expect(one.get_by_label("x from, mm")).to_have_value("20")
    undo.press("Enter")
    expect(one.get_by_label("x from, mm")).to_have_value("5")
    expect(one.locator("legend")).to_have_text("Region 1")
    scene.get_by_role("button", name="Redo").press("Enter")
    one.get_by_role("button", name="Remove the region").click()
    expect(scene.get_by_role("group", name="Region 2")).to_have_count(0)
    undo.press("Enter")
    expect(one.get_by_label("Name")).to_have_value("L")
    scene.get_by_role("button", name="Apply the scene").click()
    expect(scene).to_contain_text("Drawn as the rig has it.")
    expect(one.locator("legend")).to_have_text("Region 1")
    state = lab.scene(lambda state: state.scene.regions[0].x_mm == (20.0, 40.0))
    assert state.scene.regions[1] == right


def test_two_textures_and_compensation_are_felt_one_against_the_other(
    page: Page, lab: Lab
) -> None:
    compared = part(page, "A against B")
    compared.get_by_label("Texture A").last.select_option("vinyl")
    compared.get_by_label("Texture B").last.select_option("paper")
    feel = {side: compared.get_by_role("button", name=f"Feel {side}") for side in "AB"}
    mode = {
        name: compared.get_by_role("button", name=name, exact=True)
        for name in ("Compensated", "Not compensated")
    }
    expect(mode["Compensated"]).to_be_disabled()
    expect(compared).to_contain_text("rig1 is not armed")
    page.get_by_role("button", name="Arm", exact=True).click()
    expect(mode["Compensated"]).to_have_attribute("aria-pressed", "true")
    for side, other, name in (("A", "B", "vinyl"), ("B", "A", "paper"), ("A", "B", "vinyl")):
        feel[side].press("Enter")
        expect(feel[side]).to_have_attribute("aria-pressed", "true")
        expect(feel[other]).to_have_attribute("aria-pressed", "false")
        assert lab.rig.scene().scene.name == name
    mode["Not compensated"].press("Enter")
    expect(mode["Not compensated"]).to_have_attribute("aria-pressed", "true")
    lab.status(lambda status: status.compensation.mode == "none")
    mode["Compensated"].press("Enter")
    expect(mode["Compensated"]).to_have_attribute("aria-pressed", "true")
    page.keyboard.press("Escape")
    expect(mode["Compensated"]).to_be_disabled()


@pytest.mark.timeout(300)
def test_a_composer_is_kept_out_at_no_width(page: Page, lab: Lab) -> None:
    """A part of a recording marked, a region not applied, A against B."""
    drop(page, "marked.wav", wav({100.0: 0.3}, seconds=1.0))
    recorded = part(page, "A recording becomes a texture")
    recorded.get_by_label("Part to").fill("0.8")
    expect(recorded).to_contain_text("0.8 s of 1 s becomes the texture.")
    scene = part(page, "Scene: which texture is felt where")
    scene.get_by_role("button", name="Add a region").click()
    expect(scene.locator("p[data-unapplied]")).to_contain_text("Not applied yet.")
    page.get_by_role("button", name="Arm", exact=True).click()
    feel = part(page, "A against B").get_by_role("button", name="Feel A")
    feel.press("Enter")
    expect(feel).to_have_attribute("aria-pressed", "true")
    expect_no_violations(page, WIDTHS)
    page.keyboard.press("Escape")
    lab.status(lambda status: status.state == "disarmed")


def test_an_image_becomes_a_map(page: Page, lab: Lab, rng: np.random.Generator) -> None:
    colours = rng.integers(0, 256, (600, 800, 3), dtype=np.uint8)
    colours[:300] = 255  # white above, noise below
    file = io.BytesIO()
    Image.fromarray(colours).save(file, "PNG")
    recorded, preview = part(page, "A recording becomes a texture"), part(page, "Preview")
    drop(page, "Rough Wall.png", file.getvalue())
    expect(recorded).to_contain_text("greys, scaled down")
    expect(recorded.get_by_label("Friction of white")).to_be_focused()
    page.keyboard.type("0.08")
    page.keyboard.press("Tab")
    expect(preview.get_by_role("heading", name="The draft, not saved")).to_be_visible()
    expect(preview).to_contain_text("A map from 0 N (black) to 0.08 N (white).")
    expect(preview.get_by_role("img", name="The map")).to_be_visible()
    assert "rough-wall" not in names(lab)
    recorded.get_by_role("button", name="Make it a map").click()
    expect(recorded).to_contain_text("The image is in the library as rough-wall")
    saved = frictus.Map.model_validate(lab.ask("GET", "/textures/rough-wall"))
    assert (saved.black_n, saved.white_n) == (0.0, 0.08)
    with Image.open(io.BytesIO(base64.b64decode(saved.image_png))) as image:
        grey = np.asarray(image.convert("RGB"), dtype=np.float64)
    height, width, _ = grey.shape
    assert width * height <= 65_536
    assert width / height == pytest.approx(4.0 / 3.0, rel=0.01)
    np.testing.assert_array_equal(np.ptp(grey, axis=2), 0.0)
    assert np.all(grey[: height // 2 - 2] == 255.0)
    weights = (0.2126, 0.7152, 0.0722)
    below = float(grey[height // 2 + 2 :].mean())
    assert below == pytest.approx(float((colours[300:] @ weights).mean()), abs=2.0)
    drop(page, "torn.png", b"no picture")
    expect(recorded).to_contain_text("torn.png cannot be read as an image")
