"""The view of textures, as a hand uses it."""

import base64
import io
import wave
from typing import Any, Final

import numpy as np
from playwright.sync_api import Locator, Page, expect
from tests.dashboard.lab import Lab

import frictus

SPEED_MM_S: Final = 50.0
"""Of the virtual finger, and at which the page shows levels at first."""
WAV_RATE_HZ: Final = 8_000
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


def names(lab: Lab) -> list[str]:
    return [texture["name"] for texture in lab.ask("GET", "/textures")["textures"]]


def figure(value: float) -> str:
    """A number as the page tells it."""
    return f"{float(f'{value:.3g}'):g}"


def told_gain(applied: dict[str, Any]) -> str:
    return f"{figure(100.0 * applied['gain'])} % of the friction asked for"


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
