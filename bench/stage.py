"""The stage, `frictus demo --page`, watched from outside: timed, or filmed.

`uv run python bench/stage.py timing` prints a table: from the command to the first stroke on
the page, and from a click to compensation that is switched, medians of several.
`uv run python bench/stage.py walk` writes the walk-through `docs/stage.webp`. Both run the
command as a newcomer does, and watch its page in Chromium.
"""

import argparse
import io
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

import numpy as np
from PIL import Image
from playwright.sync_api import Browser, Page, expect, sync_playwright

DOCS: Final = Path(__file__).parents[1] / "docs"
PATIENCE_MS: Final = 120_000.0
ADDRESS: Final = re.compile(r"the page: (http://127\.0\.0\.1:\d+/#/live/demo)")
STROKED: Final = """() => {
  const moving = parseFloat(document.querySelector(".gauge .number").textContent) > 10;
  return moving && document.querySelector("#state").textContent === "ARMED";
}"""
"""The rig is armed, and the strip says that the finger moves."""
SWITCHED: Final = """name => new Promise(done => {
  const button = [...document.querySelectorAll("#compensation-modes button")]
    .find(each => each.textContent === name);
  const begun = performance.now();
  const look = () => button.getAttribute("aria-pressed") === "true"
    ? done(performance.now() - begun) : requestAnimationFrame(look);
  button.click();
  look();
})"""
"""Milliseconds from the click until what is pressed is what the rig says is in force."""
LEFT: Final = """above => new Promise(done => {
  const begun = performance.now();
  const look = () => {
    const told = document.querySelector("#spectrum .summary").textContent;
    const rms = parseFloat((told.match(/([0-9.]+) dB rms/) ?? [])[1]);
    if (above ? rms > 1.21 : rms < 1.21) done(performance.now() - begun);
    else requestAnimationFrame(look);
  };
  look();
})"""
"""Milliseconds until the felt spectrum, averaged anew, shows it."""
FRAMES_PER_S: Final = 2.0
WIDTH: Final = 800
QUALITY: Final = 50


@contextmanager
def stage(bytecode: str) -> Iterator[tuple[str, float]]:
    """Run the command without a browser of its own; yield the page and when it was started.

    Parameters
    ----------
    bytecode : str
        Folder where Python keeps what it has compiled, as it does beside its modules where the
        environment does not forbid it.
    """
    environment = os.environ | {
        "BROWSER": "frictus-no-such-browser",
        "PYTHONPYCACHEPREFIX": bytecode,
    }
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    began_s = time.monotonic()
    process = subprocess.Popen(
        [
            sys.executable,
            "-c",
            "from frictus_service.cli import main; main()",
            "demo",
            "--page",
        ],
        stderr=subprocess.PIPE,
        text=True,
        env=environment,
    )
    assert process.stderr is not None
    try:
        found = (ADDRESS.search(line) for line in process.stderr)
        url = next((told[1] for told in found if told), None)
        if url is None:
            raise SystemExit("the demo gave no address")
        yield url, began_s
    finally:
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=60)
        sys.stderr.write(said)


def timing(browser: Browser, repeats: int, bytecode: str) -> None:
    """Print how long a newcomer waits."""
    values: dict[str, list[float]] = {name: [] for name in ("stroke", "switch", "spectrum")}
    with stage(bytecode):
        pass  # what is compiled once and kept is compiled by now
    for _ in range(repeats):
        page = browser.new_page(viewport={"width": 1440, "height": 900})
        with stage(bytecode) as (url, began_s):
            page.goto(url)
            page.wait_for_function(STROKED, timeout=PATIENCE_MS)
            values["stroke"].append(time.monotonic() - began_s)
            page.evaluate(LEFT, arg=False)
            for name, above in (("Off", True), ("Model", False)):
                values["switch"].append(page.evaluate(SWITCHED, name) / 1e3)
                values["spectrum"].append(page.evaluate(LEFT, above) / 1e3)
        page.close()
    rows = {
        "from the command (warm) to the first stroke on the page": ("stroke", "8"),
        "from the click to the switch that shows what is in force": ("switch", "0.5"),
        "from then until the felt spectrum has left the band, or is back": ("spectrum", ""),
    }
    sys.stdout.write(
        f"Load of the machine: {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores.\n"
    )
    sys.stdout.write(
        "| what, s | median | least | most | aim | n |\n|---|---|---|---|---|---|\n"
    )
    for what, (key, aim) in rows.items():
        found = values[key]
        sys.stdout.write(
            f"| {what} | {np.median(found):.2f} | {min(found):.2f} | {max(found):.2f} "
            f"| {aim} | {len(found)} |\n"
        )


class Film:
    """Pictures of a page at a steady rate, drawn small."""

    def __init__(self, page: Page) -> None:
        self.page = page
        self.pictures: list[Image.Image] = []

    def roll(self, seconds: float) -> None:
        """Take the pictures of some seconds of the page's life."""
        begun_s = time.monotonic()
        for number in range(round(seconds * FRAMES_PER_S)):
            wait_s = begun_s + number / FRAMES_PER_S - time.monotonic()
            self.page.wait_for_timeout(max(0.0, 1e3 * wait_s))
            with Image.open(io.BytesIO(self.page.screenshot())) as shot:
                height = round(shot.height * WIDTH / shot.width)
                self.pictures.append(shot.convert("RGB").resize((WIDTH, height)))

    def save(self, path: Path) -> None:
        """Write an animation that goes round."""
        first, *rest = self.pictures
        first.save(
            path,
            save_all=True,
            append_images=rest,
            duration=round(1e3 / FRAMES_PER_S),
            loop=0,
            quality=QUALITY,
            method=4,
        )
        size_mb = path.stat().st_size / 1e6
        seconds = len(self.pictures) / FRAMES_PER_S
        sys.stdout.write(
            f"{path}: {len(self.pictures)} pictures, {seconds:.0f} s, {size_mb:.2f} MB\n"
        )


def walk(browser: Browser, bytecode: str) -> None:
    """Film a minute: compensation off and on, the finger taken over, the stop."""
    page = browser.new_page(viewport={"width": 1440, "height": 900}, reduced_motion="reduce")
    with stage(bytecode) as (url, _):
        page.goto(url)
        page.evaluate(LEFT, arg=False)
        film = Film(page)
        film.roll(8)
        for name, seconds in (("Off", 12), ("Model", 10)):
            page.locator("#compensation").get_by_role("button", name=name).click()
            film.roll(seconds)
        page.locator("#surface").focus()
        for key in ("ArrowRight", "ArrowLeft") * 6:
            page.keyboard.down(key)
            film.roll(1.5)
            page.keyboard.up(key)
        film.roll(6)
        page.get_by_role("button", name="STOP").click()
        expect(page.locator("#state")).to_have_text("Disarmed")
        film.roll(6)
        film.save(DOCS / "stage.webp")


def main() -> None:
    """Time or film the stage."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=("timing", "walk"))
    parser.add_argument("--repeats", type=int, default=5)
    asked = parser.parse_args()
    path = shutil.which("chromium") or shutil.which("chromium-browser")
    if path is None:
        raise SystemExit("there is no chromium here: `apt-get install chromium` brings one")
    with sync_playwright() as playwright, tempfile.TemporaryDirectory() as bytecode:
        browser = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
        if asked.what == "timing":
            timing(browser, asked.repeats, bytecode)
        else:
            walk(browser, bytecode)
        browser.close()


if __name__ == "__main__":
    main()
