"""The charts of the page: traces, spectrogram and log, before a real daemon."""

import itertools
import re
import statistics
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Page, WebSocket, expect
from tests.dashboard.conftest import OpenPage
from tests.dashboard.lab import (
    Lab,
    arrive,
    expect_no_violations,
    samples,
)

pytestmark = pytest.mark.browser


def test_charts_move_and_their_words_follow(page: Page) -> None:
    page.emulate_media(reduced_motion="no-preference")
    for stream in ("force", "accel", "voltage"):
        seen = samples(page, stream)
        page.wait_for_function(
            """([stream, seen]) => parseInt(document.querySelector(
              `[data-stream=${stream}] .count`).textContent) > seen + 20000""",
            arg=[stream, seen],
        )
        expect(page.locator(f"[data-stream={stream}] .extent").first).to_contain_text(" to ")
    drawn = page.evaluate(
        """() => [...document.querySelectorAll("#traces canvas")].map((canvas) => {
          const { data } = canvas.getContext("2d").getImageData(
            0, 0, canvas.width, canvas.height);
          return data.some((value) => value > 0);
        })"""
    )
    assert drawn == [True, True, True]


def shown(page: Page, stream: str) -> str:
    return page.locator(f"[data-stream={stream}] figcaption").inner_text()


def test_traces_stand_are_looked_into_and_move_again(page: Page) -> None:
    title = page.locator("#traces-title")
    expect(title).to_have_text("What is measured, the last 2 s")
    page.get_by_role("button", name="10 s", exact=True).click()
    expect(title).to_have_text("What is measured, the last 10 s")
    page.get_by_role("button", name="Pause", exact=True).click()
    expect(title).to_have_text("What was measured, 10.00 s to 0.00 s before the pause")
    stood, seen = shown(page, "force"), samples(page, "force")
    page.wait_for_function(
        """(seen) => parseInt(document.querySelector(
          "[data-stream=force] .count").textContent) > seen + 40000""",
        arg=seen,
    )
    assert shown(page, "force") == stood  # samples come, what is shown stands
    # A part is chosen on one chart, and all show it.
    over = page.locator("[data-stream=accel] .u-over")
    over.scroll_into_view_if_needed()
    chart = over.bounding_box()
    assert chart is not None
    page.mouse.move(chart["x"] + 0.5 * chart["width"], chart["y"] + 20)
    page.mouse.down()
    page.mouse.move(chart["x"] + 0.75 * chart["width"], chart["y"] + 20, steps=4)
    page.mouse.up()
    expect(title).to_have_text(
        re.compile(r"^What was measured, (4\.9\d|5\.0\d)\ss to 2\.[45]\d\ss before the pause$")
    )
    # Where the pointer is, the words are of that column.
    page.mouse.move(chart["x"] + 0.3 * chart["width"], chart["y"] + 20)
    at = shown(page, "force")
    page.mouse.move(chart["x"] + 0.6 * chart["width"], chart["y"] + 20)
    expect(page.locator("[data-stream=force] figcaption")).not_to_have_text(at)
    page.get_by_label("Go back").fill("-3")
    expect(title).to_contain_text("s to 3.00 s before the pause")
    page.get_by_role("button", name="Go on").click()
    expect(title).to_have_text("What is measured, the last 2 s")


def test_traces_are_saved_as_they_are_shown(page: Page, tmp_path: Path) -> None:
    page.wait_for_function(
        "() => [...document.querySelectorAll('[data-stream] .count')]"
        ".every((count) => parseInt(count.textContent) > 20000)"
    )
    page.get_by_role("button", name="Pause", exact=True).click()
    files = {}
    for name in ("CSV", "PNG"):
        with page.expect_download() as saving:
            page.get_by_role("button", name=name).click()
        suffix = name.lower()
        assert re.fullmatch(
            rf"rig1_\d{{4}}-\d\d-\d\dT[\d-]+\.{suffix}", saving.value.suggested_filename
        )
        files[name] = tmp_path / f"traces.{suffix}"
        saving.value.save_as(files[name])
    assert files["PNG"].read_bytes()[:4] == b"\x89PNG"
    head, *rows = files["CSV"].read_text().splitlines()
    assert head.startswith(
        "begin (s),least Force on the finger x (N),greatest Force on the finger x"
    )
    values = np.array([[float(cell or "nan") for cell in row.split(",")] for row in rows])
    assert values.shape[1] == 1 + 2 * 7
    np.testing.assert_allclose(np.diff(values[:, 0]), 0.004, atol=1e-6)
    told = page.locator("[data-stream=force] .extent").nth(2).inner_text()
    assert told == f"{np.nanmin(values[:, 5]):.3f} to {np.nanmax(values[:, 6]):.3f}"


def test_a_channel_is_hidden_and_shown(page: Page) -> None:
    channel = page.get_by_role("button", name="Force on the finger, z")
    expect(channel).to_have_attribute("aria-pressed", "true")
    channel.click()
    expect(channel).to_have_attribute("aria-pressed", "false")
    expect_no_violations(page)
    channel.click()
    expect(channel).to_have_attribute("aria-pressed", "true")


def test_the_log_leads_to_what_was_measured_then(page: Page, lab: Lab) -> None:
    page.get_by_role("button", name="Arm", exact=True).click()
    lab.status(lambda status: status.state == "armed")
    page.keyboard.press("Escape")
    lab.status(lambda status: status.state == "disarmed")
    page.get_by_role("link", name="Models").click()
    page.locator("#events summary").click()
    page.locator("#events-list li", has_text="Armed").get_by_role("button").first.click()
    expect(page.locator("#traces-title")).to_have_text(
        re.compile(r"^What was measured, [\d.]+\ss to [\d.]+\ss before the pause$")
    )
    expect(page.get_by_role("link", name="Live", exact=True)).to_have_attribute(
        "aria-current", "page"
    )
    page.get_by_role("button", name="Go on").click()


def test_felt_friction_follows_the_target(page: Page, lab: Lab) -> None:
    page.get_by_role("button", name="Arm", exact=True).click()
    lab.status(lambda status: status.state == "armed")
    page.locator("#surface").focus()
    keys = itertools.cycle(("ArrowLeft", "ArrowRight"))
    # A busy machine renders with gaps: stroke until ten windows in a row had few of them.
    # What is not rendered at all lies tens of decibels below. The strongest tone is named while
    # the finger moves only.
    strongest = page.locator("#spectrogram figcaption")
    named = False
    while not (named and follows(page)):
        key = next(keys)
        page.keyboard.down(key)
        end_mm = 0.0 if key == "ArrowLeft" else 70.0
        lab.finger(lambda finger: abs(finger.x_mm - end_mm) < 6.0)  # noqa: B023
        told = strongest.text_content() or ""
        named = (
            named
            or re.fullmatch(r"Strongest now: \d+ Hz, -?\d+ dB re 1 N rms", told) is not None
        )
        page.keyboard.up(key)
    expect(page.locator(".summary")).to_contain_text("bands within 1.21 dB")
    painted = page.locator("#spectrogram canvas").evaluate(
        """(canvas) => {
          const { width, height } = canvas;
          const { data } = canvas.getContext("2d").getImageData(0, 0, width, height);
          return [height, data.filter((_, i) => i % 4 === 3).some((alpha) => alpha > 128)];
        }"""
    )
    assert painted == [52, True]  # up to 1 kHz in steps of 19.5 Hz
    page.keyboard.press("Escape")
    lab.status(lambda status: status.state == "disarmed")


def follows(page: Page) -> bool:
    told = page.locator("#spectrum tbody td:last-child").all_text_contents()
    errors = [abs(float(text)) for text in told if re.fullmatch(r"-?[\d.]+", text)]
    return len(errors) >= 6 and statistics.median(errors) < 2.0


def test_friction_is_sent_only_while_it_is_looked_at(lab: Lab, open_page: OpenPage) -> None:
    with open_page() as page:
        sockets: list[WebSocket] = []
        page.on("websocket", lambda socket: sockets.append(socket))
        arrive(page, lab.url)
        while len(sockets) < 2:  # that of the page, and that of the friction
            page.wait_for_event("websocket")
        sockets[1].wait_for_event("framereceived")  # it is open: it may be closed now
        with sockets[1].expect_event("close"):
            page.get_by_role("link", name="Models", exact=True).click()
        assert not sockets[0].is_closed()
        with page.expect_event("websocket"):
            page.get_by_role("link", name="Live", exact=True).click()
