"""The view of textures before a real daemon: looked at, made, dropped, drawn, and felt."""

import base64
import io
import math
import os
import re
import signal
import sys
import wave
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from playwright.sync_api import Locator, Page, Route, expect
from tests.dashboard.conftest import OpenPage
from tests.dashboard.lab import Lab, enter, expect_no_violations, read_only, running

import frictus
from frictus_hardware import SimulatedConfig
from frictus_hardware.simulated.strokes import SteadyStrokes
from frictus_service.fidelity.bands import NOMINAL_HZ, band_power, windows

pytestmark = pytest.mark.browser

FloatArray = NDArray[np.float64]

SPEED_MM_S = 50.0
"""Of the virtual finger, and at which the page shows levels at first."""
PATIENCE_MS = 30_000
RETURN_MS = 60_000
WAV_RATE_HZ = 8_000
LINES = frictus.Scene(
    name="lines",
    regions=[
        frictus.Region(
            name="Lines",
            texture=frictus.Spectrum(
                components=[frictus.Component(amplitude_n=0.02, cycles_per_mm=2.0)]
            ),
        )
    ],
)


def names(lab: Lab) -> list[str]:
    return [texture["name"] for texture in lab.ask("GET", "/textures")["textures"]]


@pytest.fixture(scope="module")
def lab(browser: object, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Lab]:
    """A daemon whose finger strokes by itself."""
    finger = SteadyStrokes(speed_mm_s=SPEED_MM_S)
    folder = tmp_path_factory.mktemp("lab")
    with running(folder, backend=SimulatedConfig(finger=finger)) as lab:
        yield lab


@pytest.fixture(autouse=True)
def patience() -> Iterator[None]:
    """On a busy machine the first preview takes a while: compiled code is loaded for it."""
    expect.set_options(timeout=PATIENCE_MS)
    yield
    expect.set_options(timeout=5_000)


@pytest.fixture
def page(lab: Lab, open_page: OpenPage) -> Iterator[Page]:
    with open_page(expected="status of 4") as page:
        arrive(page, lab)
        yield page


def arrive(page: Page, lab: Lab, name: str = "") -> None:
    page.goto(f"{lab.url}/dashboard/#/textures/rig1/{name}".rstrip("/"))
    expect(page.locator("#connection")).to_have_text("Live")
    expect(links(page).first).to_be_visible()
    page.evaluate("window.loadedOnce = true")


def part(page: Page, name: str) -> Locator:
    return page.locator("#view-textures").get_by_role("region", name=name)


def links(page: Page) -> Locator:
    return part(page, "Library").get_by_role("link")


def choose(page: Page, name: str) -> None:
    links(page).get_by_text(name, exact=True).click()
    expect(part(page, "Preview").get_by_role("heading", name=name, exact=True)).to_be_visible()
    expect(part(page, "Preview").get_by_text("On rig1: ")).to_be_visible()


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


def figure(value: float) -> str:
    """A number as the page tells it."""
    return f"{float(f'{value:.3g}'):g}"


def told_gain(applied: dict[str, Any]) -> str:
    return f"{figure(100.0 * applied['gain'])} % of the friction asked for"


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
    expect(part(page, "Library")).to_contain_text("6 textures, 0 yours")
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
    (route,) = held
    with page.expect_request_finished(lambda request: request.url.endswith("/flat")):
        route.continue_()
    expect(part(page, "Preview").get_by_role("heading", name="vinyl")).to_be_visible()
    before = part(page, "Preview").inner_text()
    # An answer that is worked through before: what came of the older one would be seen by now.
    page.get_by_label("Find by name").fill("vin")
    expect(links(page)).to_have_count(1)
    assert part(page, "Preview").inner_text() == before


def wav(tones: dict[float, float], seconds: float = 0.5) -> bytes:
    """Return a recording of tones (Hz to share of full scale) in 16 bits."""
    time_s = np.arange(round(seconds * WAV_RATE_HZ)) / WAV_RATE_HZ
    samples = sum(share * np.sin(2.0 * np.pi * hz * time_s + hz) for hz, share in tones.items())
    file = io.BytesIO()
    with wave.open(file, "wb") as out:
        out.setnchannels(1)
        out.setsampwidth(2)
        out.setframerate(WAV_RATE_HZ)
        out.writeframes(np.round(32_767.0 * np.asarray(samples)).astype("<i2").tobytes())
    return file.getvalue()


def drop(page: Page, name: str, content: bytes) -> None:
    """Drop a file somewhere on the page, as a hand does."""
    taken = page.evaluate(
        """([name, content]) => {
          const bytes = Uint8Array.from(atob(content), (letter) => letter.charCodeAt(0));
          const dataTransfer = new DataTransfer();
          dataTransfer.items.add(new File([bytes], name));
          return ["dragenter", "dragover", "drop"].map((type) => !document.body.dispatchEvent(
            new DragEvent(type, { dataTransfer, bubbles: true, cancelable: true })));
        }""",
        [name, base64.b64encode(content).decode()],
    )
    assert taken[1:] == [True, True]  # or the browser would leave the page for the file


def test_a_dropped_wav_is_felt(page: Page, lab: Lab) -> None:
    # Recorded at half the speed of the finger: felt an octave higher.
    drop(page, "Two Tones.wav", wav({100.0: 0.3, 200.0: 0.6}))
    recorded = part(page, "A recording becomes a texture")
    expect(recorded.get_by_label("Speed of the recording")).to_be_focused()
    page.keyboard.type(f"{SPEED_MM_S / 2.0}")
    recorded.get_by_label("Newtons at full scale").fill("0.1")
    expect(recorded.get_by_label("Name in the library")).to_have_value("two-tones")
    page.keyboard.press("Enter")
    expect(recorded).to_contain_text("Two Tones.wav is in the library as two-tones")
    preview = part(page, "Preview")
    expect(preview.get_by_role("heading", name="two-tones")).to_be_visible()
    expect(preview).to_contain_text("repeated every 12.5 mm")
    saved = frictus.Profile.model_validate(lab.ask("GET", "/textures/two-tones"))
    assert saved.period_mm == pytest.approx(12.5)
    assert max(saved.friction_n) < 0.1
    expect(preview).to_contain_text("strongest in the band of 400 Hz")

    preview.get_by_role("button", name="Feel it").click()
    expect(preview).to_contain_text("two-tones is on rig1: ")
    state = lab.scene(lambda state: state.scene.name == "two-tones")
    asked = lab.ask("POST", f"/preview?speed_mm_s={SPEED_MM_S}", saved.model_dump())["rms_n"]
    page.get_by_role("button", name="Arm", exact=True).click()
    expect(page.locator("#state")).to_have_text("ARMED")
    felt = felt_rms_n(lab.rig)
    page.keyboard.press("Escape")
    expect(page.locator("#state")).to_have_text("Disarmed")

    expected = state.applied.gain * np.array(asked)
    tones = [NOMINAL_HZ.index(200.0), NOMINAL_HZ.index(400.0)]
    assert expected[tones] == pytest.approx(
        state.applied.gain * np.array([0.03, 0.06]) / 2**0.5, 0.01
    )
    error_db = 20.0 * np.log10(felt[tones] / expected[tones])
    assert np.all(np.abs(error_db) < 1.5), error_db
    assert np.argmax(felt) == tones[1]
    others = np.delete(felt, tones)
    assert np.all(others < felt[tones[0]] / 2.0), felt


def felt_rms_n(rig: frictus.Rig) -> FloatArray:
    """Return the friction at the finger in third octaves, N rms: medians of steady windows.

    Medians, since a busy machine renders some windows with gaps.
    """
    length = 8_192
    powers: list[FloatArray] = []
    with rig.blocks("truth", timeout_s=60.0) as blocks:
        parts: list[FloatArray] = []
        while len(powers) < 9:
            block = next(blocks)
            if not isinstance(block, frictus.Block):
                parts = []
                continue
            parts.append(block.data.astype(np.float64))
            joined = np.concatenate(parts, axis=1)
            if joined.shape[1] < 2 * length:
                continue
            parts = []
            for window in windows(joined.shape[1], length):
                along = joined[2, window]
                # Until 0.25 s after a turn the touch sensor has not shown the new speed.
                settled = np.abs(joined[2, max(0, window.start - length) : window.stop])
                if abs(along.mean()) > 0.99 * SPEED_MM_S and settled.min() > 0.9 * SPEED_MM_S:
                    powers.append(band_power(joined[4], block.sample_rate_hz, [window]))
    return np.sqrt(np.median(np.array(powers), axis=0))


def test_a_csv_is_chosen_by_keyboard_and_a_malformed_one_refused_with_the_reason(
    page: Page, lab: Lab, tmp_path: Path
) -> None:
    linen = tmp_path / "linen.csv"
    time_s = np.arange(400) / 2_000.0
    linen.write_text("\n".join(f"{0.05 * math.sin(2e2 * math.pi * t):.6f}" for t in time_s))
    page.on("filechooser", lambda chooser: chooser.set_files(linen))
    recorded = part(page, "A recording becomes a texture")
    page.get_by_role("button", name="New texture").focus()
    page.keyboard.press("Tab")
    expect(recorded.get_by_label("File")).to_be_focused()
    page.keyboard.press("Enter")
    expect(recorded.get_by_label("Speed of the recording")).to_be_focused()
    page.keyboard.type("40")
    page.keyboard.press("Enter")
    expect(recorded).to_contain_text("has one column: give its sample_rate_hz")
    expect(recorded.get_by_label("Channel")).to_be_hidden()
    recorded.get_by_label("Sample rate").fill("2000")
    page.keyboard.press("Enter")
    expect(part(page, "Preview").get_by_role("heading", name="linen")).to_be_visible()
    expect(part(page, "Preview")).to_contain_text("strongest in the band of 125 Hz")
    assert lab.ask("GET", "/textures/linen")["period_mm"] == pytest.approx(8.0)

    drop(page, "torn.csv", b"0.1\n0.2\nrough\n")
    page.keyboard.type("40")
    page.keyboard.press("Enter")
    expect(recorded).to_contain_text("torn.csv is not a texture yet: ")
    expect(recorded).to_contain_text("line 3: 'rough' is not numbers")
    assert "torn" not in names(lab)
    drop(page, "noise.wav", b"RIFF, but not really")
    page.keyboard.type("40")
    page.keyboard.press("Enter")
    expect(recorded).to_contain_text("is not a WAV file with PCM samples")
    drop(page, "notes.txt", b"hello")
    expect(recorded).to_contain_text("notes.txt is neither a WAV nor a CSV file")
    expect(recorded.get_by_role("button", name="Make it a texture")).to_be_hidden()
    drop(page, "huge.wav", bytes(11_000_000))
    page.keyboard.type("40")
    page.keyboard.press("Enter")
    expect(recorded).to_contain_text("huge.wav is not a texture yet: the body is larger than")


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
    # Whoever holds the rig is named.
    with lab.rig.arm():
        scene.get_by_role("button", name="Remove the region").click()
        apply.click()
        expect(scene).to_contain_text("is held by 'tester'")
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


def test_anybody_can_use_it(page: Page) -> None:
    choose(page, "paper")
    page.get_by_role("button", name="Edit a copy").click()
    drop(page, "tone.wav", wav({100.0: 0.5}))
    part(page, "Scene: which texture is felt where").get_by_role(
        "button", name="Add a region"
    ).click()
    for summary in page.locator("#view-textures summary:visible").all():
        summary.click()
    expect_no_violations(page)


def test_reader_looks_and_sees_no_button_that_would_fail(lab: Lab, open_page: OpenPage) -> None:
    lab.rig.set_scene(LINES)
    with read_only(lab) as url, open_page() as page:
        enter(page, f"{url}#/textures/rig1/paper")
        expect(page.locator("#connection")).to_have_text("Live")
        expect(part(page, "Preview").get_by_text("On rig1: feasible gain ")).to_be_visible()
        scene = part(page, "Scene: which texture is felt where")
        expect(scene).to_contain_text("rig1 renders the scene lines (Lines): ")
        expect(scene.locator("canvas")).to_be_visible()
        assert page.locator("#view-textures").get_by_role("button").count() == 0
        expect(part(page, "A recording becomes a texture")).to_be_hidden()


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGKILL for others")
def test_loss_and_return_are_shown_without_a_reload(lab: Lab, open_page: OpenPage) -> None:
    with open_page(expected="ERR_") as page:
        arrive(page, lab, "paper")
        expect(part(page, "Preview").get_by_text("On rig1: ")).to_be_visible()
        scene = part(page, "Scene: which texture is felt where")
        expect(scene).to_contain_text("rig1 renders the scene")
        os.kill(lab.supervisor.pid_of("api"), signal.SIGKILL)
        expect(scene).to_contain_text("What rig1 renders is not known.")
        expect(page.locator("#connection")).to_contain_text("No connection")
        links(page).get_by_text("vinyl", exact=True).click()
        expect(part(page, "Preview").get_by_role("heading", name="vinyl")).to_be_visible()
        expect(page.locator("#connection")).to_contain_text("Live again", timeout=RETURN_MS)
        expect(part(page, "Preview")).to_contain_text("A spectrum of ")
        expect(part(page, "Preview").get_by_text("On rig1: ")).to_be_visible()
        expect(scene).to_contain_text("rig1 renders the scene")
        assert page.evaluate("window.loadedOnce")
