"""A recording is dropped or chosen, becomes a texture, and is felt."""

import math
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Page, expect
from tests.clients.effect_files.made import ahap, continuous, event
from tests.dashboard.lab import Lab
from tests.dashboard.textures.view import SPEED_MM_S, drop, names, part, wav

import frictus
from frictus_hardware.arrays import FloatArray
from frictus_service.fidelity.preview import NOMINAL_HZ, band_power, windows

pytestmark = pytest.mark.browser


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
    expect(recorded).to_contain_text("noise.wav is not a WAV file")
    drop(page, "notes.txt", b"hello")
    expect(recorded).to_contain_text(
        "notes.txt: .wav, .csv, .ahap, .haptic, .hjif, .hmpg, .png"
    )
    expect(recorded.get_by_role("button", name="Make it a texture")).to_be_hidden()
    drop(page, "huge.wav", bytes(11_000_000))
    page.keyboard.type("40")
    page.keyboard.press("Enter")
    expect(recorded).to_contain_text("huge.wav is not a texture yet: the body is larger than")


def test_a_dropped_effect_is_over_time_or_at_a_speed_over_position(
    page: Page, lab: Lab
) -> None:
    buzz = ahap(continuous(0.0, 0.5, HapticSharpness=0.0), event("AudioCustom", 0.0))
    recorded = part(page, "A recording becomes a texture")
    drop(page, "buzz.ahap", buzz.encode())
    recorded.get_by_label("Newtons at full scale").fill("0.1")
    recorded.get_by_role("button", name="Make it a texture").click()
    expect(recorded).to_contain_text(
        "buzz.ahap is in the library as buzz; AudioCustom: left out"
    )
    assert lab.ask("GET", "/textures/buzz")["period_s"] == pytest.approx(0.5)
    drop(page, "laid.ahap", buzz.encode())
    expect(recorded.get_by_label("Speed at which it is felt in its own time")).to_have_value("")
    recorded.get_by_label("Speed at which it is felt in its own time").fill("40")
    page.keyboard.press("Enter")
    expect(recorded).to_contain_text("laid.ahap is in the library as laid")
    assert lab.ask("GET", "/textures/laid")["period_mm"] == pytest.approx(20.0)
