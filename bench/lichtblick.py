"""Open what `frictus export --to foxglove` and `frictus foxglove` give in Lichtblick itself.

`uv run python bench/lichtblick.py BUILD --shots FOLDER` takes Lichtblick's web build (the
folder with its index.html, which is no part of this project), records a simulated rig, and
opens the exported file, then the live rig, with the shipped layout in Chromium without a
window. It fails where Lichtblick complains or a panel stays empty, and keeps a picture of each.
"""

import argparse
import contextlib
import io
import json
import re
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any, Final

import numpy as np
from PIL import Image
from playwright.sync_api import Browser, ConsoleMessage, Page, sync_playwright

import frictus
from frictus_laboratory.benchmarks.processes import config_of, serving
from frictus_service.config import Config
from frictus_service.recording.foxglove import LAYOUT, export_foxglove

RECORD_S: Final = 4.0
PATIENCE_S: Final = 120.0
PLACE: Final = "/*LICHTBLICK_SUITE_DEFAULT_LAYOUT_PLACEHOLDER*/"
"""In its index.html: what stands there is the layout it begins with."""
FILE: Final = "/pilot_foxglove.mcap"
COMMAND: Final = "from frictus_service.cli import main; main()"
LEAST_SHARE: Final = 0.001
"""Of a panel's pixels that have a colour: lines and states have; text and grids are grey."""
TEXTURE: Final = frictus.Spectrum(
    components=[frictus.Component(amplitude_n=0.1, cycles_per_mm=1.0)]
)


class Handler(SimpleHTTPRequestHandler):
    """Serves the build with the layout in it, and a recording part by part."""

    def __init__(self, recording: Path, *given: Any, **options: Any) -> None:
        self._recording = recording
        super().__init__(*given, **options)

    def log_message(self, format: str, *args: object) -> None:
        """Say nothing."""

    def do_GET(self) -> None:
        """Answer."""
        path = self.path.partition("?")[0]
        if path == FILE:
            self._answer_part(self._recording.read_bytes())
        elif path == "/":
            text = (Path(self.directory) / "index.html").read_text(encoding="utf-8")
            layout = LAYOUT.read_text(encoding="utf-8")
            assert PLACE in text, "this build has no place for a layout"
            self._answer(200, text.replace(PLACE, layout).encode(), "text/html")
        else:
            super().do_GET()

    def _answer_part(self, content: bytes) -> None:
        asked = re.fullmatch(r"bytes=(\d+)-(\d*)", self.headers.get("Range", ""))
        kind = "application/octet-stream"
        if asked is None:
            self._answer(200, content, kind, **{"Accept-Ranges": "bytes"})
            return
        begin, end = int(asked[1]), int(asked[2] or len(content) - 1) + 1
        told = f"bytes {begin}-{end - 1}/{len(content)}"
        self._answer(206, content[begin:end], kind, **{"Content-Range": told})

    def _answer(self, code: int, content: bytes, kind: str, **headers: str) -> None:
        self.send_response(code)
        headers |= {"Content-Type": kind, "Content-Length": str(len(content))}
        for name, value in headers.items():
            self.send_header(name, value)
        self.end_headers()
        with contextlib.suppress(ConnectionError):  # it asks, and breaks off
            self.wfile.write(content)


@contextlib.contextmanager
def served(build: Path, recording: Path) -> Iterator[str]:
    """Serve; give the address."""
    handler = partial(Handler, recording, directory=str(build))
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()


@contextlib.contextmanager
def playing(config: Config) -> Iterator[frictus.Rig]:
    """Play a texture on the rig."""
    with frictus.connect(config.router.endpoint) as client:
        rig = client.rig(config.rig, wait_s=30.0)
        with rig.arm(lease_ms=10_000):  # a browser that starts takes every core
            rig.set_scene(TEXTURE)
            yield rig


def record(config: Config, name: str = "pilot") -> Path:
    """Record a rig that plays a texture; return the exported file."""
    with playing(config) as rig:
        rig.record(name)
        time.sleep(RECORD_S)
        rig.end_recording()
    out = config.recordings / FILE.strip("/")
    export_foxglove(config.recordings / f"{name}.mcap", out)
    return out


@contextlib.contextmanager
def live(config: Config) -> Iterator[str]:
    """Run the bridge; give its address."""
    command = [sys.executable, "-c", COMMAND, "foxglove", "--json", "--port", "0"]
    command += ["--rig", config.rig, "--router", config.router.endpoint]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as bridge:
        assert bridge.stdout is not None
        yield json.loads(bridge.stdout.readline())["url"]
        bridge.kill()


def look(browser: Browser, url: str, shot: Path) -> None:
    """Open Lichtblick, wait until every plot has drawn, and keep a picture.

    Raises
    ------
    SystemExit
        If it complains, or a panel stays empty.
    """
    page = browser.new_page(viewport={"width": 1400, "height": 1000})
    page.set_default_timeout(1_000.0 * PATIENCE_S)
    complaints: list[str] = []
    alerts: list[str] = []

    def hear(told: ConsoleMessage) -> None:
        if told.type == "error" and not told.text.startswith("Warning: "):  # of its own build
            complaints.append(told.text)
        elif told.text.startswith("Player alert"):
            alerts.append(told.text[:200])

    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("console", hear)
    page.goto(url)
    end_s, empty = time.monotonic() + PATIENCE_S, ["all panels"]
    while empty and time.monotonic() < end_s:
        page.wait_for_timeout(1_000)
        empty = [name for name, share in coloured(page) if share < LEAST_SHARE] or (
            [] if coloured(page) else ["all panels"]
        )
    page.screenshot(path=shot)
    page.close()
    sys.stdout.write(f"{shot}: empty {empty}; complaints {complaints}; alerts {alerts}\n")
    if empty or complaints:
        raise SystemExit(1)


def coloured(page: Page) -> list[tuple[str, float]]:
    """Return for every panel that draws what share of it has a colour."""
    found = []
    for number, canvas in enumerate(page.locator("canvas").all()):
        if (box := canvas.bounding_box()) is None or box["width"] < 100 or box["height"] < 50:
            continue
        picture = Image.open(io.BytesIO(page.screenshot(clip=box))).convert("RGB")
        pixels = np.asarray(picture, int)
        share = float(np.mean(np.ptp(pixels, axis=2) > 60))
        found.append((f"panel {number}", share))
    return found


def main() -> None:
    """Open both."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("build", type=Path)
    parser.add_argument("--shots", type=Path, default=Path())
    given = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="frictus-") as folder, sync_playwright() as driver:
        config = config_of().model_copy(update={"recordings": Path(folder)})
        browser = driver.chromium.launch(
            executable_path=shutil.which("chromium"), args=["--no-sandbox"]
        )
        with serving(config, ("rig", "recorder")):
            recording = record(config)
            with served(given.build, recording) as base:
                file = f"{base}/?ds=remote-file&ds.url={base}{FILE}"
                look(browser, file, given.shots / "lichtblick_file.png")
                with playing(config), live(config) as url:
                    rig = f"{base}/?ds=foxglove-websocket&ds.url={url}"
                    look(browser, rig, given.shots / "lichtblick_live.png")
        browser.close()


if __name__ == "__main__":
    main()
