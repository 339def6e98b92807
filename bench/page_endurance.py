"""The dashboard watched for long: pictures per second, and whether memory grows.

`uv run python bench/page_endurance.py --minutes 30` prints the table of `docs/dashboard.md`.
A simulated finger strokes a texture; Chromium shows the live view, drawn in software. Linux
only: the memory of the API is read from /proc.
"""

import argparse
import os
import shutil
import sys
import time
from pathlib import Path
from typing import Final

import numpy as np
from playwright.sync_api import CDPSession, Page, expect, sync_playwright

import frictus
from frictus_laboratory.benchmarks.processes import RIG, config_of, serving
from frictus_service.library import SHIPPED, TextureLibrary

PATIENCE_MS: Final = 60_000.0
COUNT_MS: Final = 5_000
COUNT: Final = """ms => new Promise(done => {
  let drawn = 0;
  const end = performance.now() + ms;
  const draw = now => {
    if (now >= end) return done(1000 * drawn / ms);
    drawn++;
    requestAnimationFrame(draw);
  };
  requestAnimationFrame(draw);
})"""
SAMPLES: Final = 30
MB: Final = 1e6


def sample(page: Page, session: CDPSession, server: int) -> tuple[float, float, float]:
    """Return pictures per second, the page's heap and the server's memory, MB."""
    pictures = page.evaluate(COUNT, COUNT_MS)
    session.send("HeapProfiler.collectGarbage")
    heap = page.evaluate("performance.memory.usedJSHeapSize")
    pages = int(Path(f"/proc/{server}/statm").read_text(encoding="ascii").split()[1])
    return float(pictures), heap / MB, pages * os.sysconf("SC_PAGE_SIZE") / MB


def growth(minute: list[float], values: list[float]) -> str:
    """Return the straight line's rise, MB per hour, with its 95 % interval."""
    x, y = np.array(minute), np.array(values)
    (slope, _), spread = np.polyfit(x, y, 1, cov=True)
    return f"{60 * slope:+.1f} ± {60 * 1.96 * np.sqrt(spread[0, 0]):.1f}"


def main() -> None:
    """Watch, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=30.0)
    minutes = parser.parse_args().minutes
    path = shutil.which("chromium") or shutil.which("chromium-browser")
    if path is None:
        raise SystemExit("there is no chromium here: `apt-get install chromium` brings one")
    config = config_of()
    with (
        serving(config, ("rig", "api")) as supervisor,
        frictus.connect(config.router.endpoint) as client,
        sync_playwright() as playwright,
    ):
        rig = client.rig(RIG)
        rig.set_scene(TextureLibrary(SHIPPED).get("vinyl").texture)
        arguments = ["--no-sandbox", "--enable-precise-memory-info"]
        browser = playwright.chromium.launch(executable_path=path, args=arguments)
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        with rig.arm():
            page.goto(f"http://127.0.0.1:{config.api.port}/")
            expect(page.locator("#connection")).to_have_text("Live", timeout=PATIENCE_MS)
            watch(page, supervisor.pid_of("api"), minutes)


def watch(page: Page, server: int, minutes: float) -> None:
    """Take samples over the time, the first tenth of which is for caches to fill."""
    session = page.context.new_cdp_session(page)
    began_s = time.monotonic()
    minute: list[float] = []
    taken: list[tuple[float, float, float]] = []
    for number in range(SAMPLES):
        page.wait_for_timeout(
            max(0.0, 6e4 * minutes * number / SAMPLES - 1e3 * (time.monotonic() - began_s))
        )
        taken.append(sample(page, session, server))
        minute.append((time.monotonic() - began_s) / 60.0)
    kept = slice(SAMPLES // 10, None)
    pictures, heap, resident = (list(each) for each in zip(*taken, strict=True))
    expect(page.locator("#connection")).to_have_text("Live")
    expect(page.locator("#state")).to_have_text("ARMED")  # it was, all the time
    sys.stdout.write(
        "| what | median | least | most | growth, MB per hour |\n|---|---|---|---|---|\n"
        f"| pictures per second | {np.median(pictures):.0f} | {min(pictures):.0f} "
        f"| {max(pictures):.0f} | |\n"
    )
    for what, values in (("heap of the page, MB", heap), ("memory of the API, MB", resident)):
        sys.stdout.write(
            f"| {what} | {np.median(values):.1f} | {min(values):.1f} | {max(values):.1f} "
            f"| {growth(minute[kept], values[kept])} |\n"
        )


if __name__ == "__main__":
    main()
