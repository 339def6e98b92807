"""The pictures of the dashboard in `docs/`: `uv run python bench/screenshots.py`.

A site of its own: on one rig a virtual finger strokes two fabrics, on the other one follows
guidance and is calibrated twice; in a study something is hidden that a discovery finds; a
virtual participant feels a threshold experiment. All that the pictures show is done by clicks
in Chromium.
"""

import re
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Final

from playwright.sync_api import Browser, Page, expect, sync_playwright

sys.path.insert(0, str(Path(__file__).parents[1]))  # so that a script finds the tests

import numpy as np
from tests.blind.generator import Case, Design, Hidden, Seeds, make_study
from tests.dashboard.participants import asked, participant

import frictus
from frictus.experiment import SimulatedObserver
from frictus_hardware import SimulatedConfig
from frictus_hardware.simulated.config import SimulatedParticipant
from frictus_hardware.simulated.guided import GuidedStrokes
from frictus_service.config import (
    ApiConfig,
    Config,
    RegistryConfig,
    RouterConfig,
    TrackerConfig,
)
from frictus_service.daemon.processes.supervisor import Supervisor
from frictus_service.processes import free_endpoint, free_port

DOCS: Final = Path(__file__).parents[1] / "docs"
STROKED: Final = "rig1"
GUIDED: Final = "rig2"
FEELER: Final = SimulatedParticipant(cutoff_0_hz=800.0, slope_hz_per_mm_s=11.0)
"""Whom the model in force does not fit."""
PERSON: Final = SimulatedParticipant(cutoff_0_hz=460.0, slope_hz_per_mm_s=11.0)
LINES: Final = (0.4, 0.5, 0.63, 0.8, 1.0, 1.25, 1.6, 2.0, 2.5, 3.15, 4.0, 5.0, 6.3, 8.0)
BRIEF: Final = {
    "Speeds, mm/s": "30, 60, 90",
    "Forces, N": "0.4",
    "Longest recording, s": "30",
    "Approach, s": "1",
    "Recorded, s": "3",
}
HIDDEN: Final = (Hidden("direction_asymmetry", {"share": 0.15}),)
DESIGN: Final = Design(participants=8, n_tones=5, n_speeds=3, n_forces=1, tones_per_trial=5)
PATIENCE_MS: Final = 60_000.0
DONE_MS: Final = 300_000.0


def scene() -> frictus.Scene:
    """Return two textures side by side that stay within what the drive can give."""
    regions = [
        frictus.Region(
            name=name,
            x_mm=x_mm,
            texture=frictus.Spectrum(
                components=[
                    frictus.Component(
                        amplitude_n=peak_n / turns**tilt,
                        cycles_per_mm=turns,
                        phase_rad=turns**2,
                    )
                    for turns in LINES
                ]
            ),
        )
        for name, x_mm, peak_n, tilt in (
            ("Linen", (0, 36), 0.02, 0.2),
            ("Felt", (36, 70), 0.015, 0.6),
        )
    ]
    return frictus.Scene(name="two fabrics", regions=regions)


@contextmanager
def site(folder: Path) -> Iterator[Config]:
    """Run two rigs and a service that disturb nothing else on this machine."""
    config = Config(
        rig=STROKED,
        backend=SimulatedConfig(participant=FEELER),
        router=RouterConfig(endpoint=free_endpoint()),
        api=ApiConfig(port=free_port()),
        registry=RegistryConfig(url=f"sqlite:///{folder / 'registry.db'}"),
        textures=folder / "textures",
        studies=folder / "studies",
        tracker=TrackerConfig(audit=folder / "adaptations.jsonl"),
    )
    guided = config.model_copy(
        update={
            "rig": GUIDED,
            "backend": SimulatedConfig(finger=GuidedStrokes(), participant=PERSON),
            "router": RouterConfig(endpoint=config.router.endpoint, host=False),
        }
    )
    config.studies.mkdir()
    make_study(config.studies / "visit1.h5", Case("picture", HIDDEN, DESIGN), Seeds(1, 2))
    with ExitStack() as stack:
        for each, parts in ((config, ("rig", "api", "tracker")), (guided, ("rig",))):
            supervisor = stack.enter_context(Supervisor(each, parts))  # type: ignore[arg-type]
            supervisor.wait_ready(120.0)
        yield config


def live(page: Page) -> None:
    """Wait until there is something in every chart."""
    page.locator("#spectrum").scroll_into_view_if_needed()
    expect(page.locator(".summary")).to_contain_text("bands")


def textures(page: Page) -> None:
    """Look at a texture of the library."""
    view = page.locator("#view-textures")
    view.get_by_role("link", name="sandpaper", exact=True).click()
    expect(view.get_by_text(f"On {STROKED}: ")).to_be_visible()


def live_model(page: Page) -> None:
    """Watch the finger being learned for a minute."""
    gain = page.locator("[data-parameter=gain_n] .chart")
    expect(gain).to_have_attribute("data-entries", re.compile("^1[0-9]{2}$"), timeout=DONE_MS)


def calibrate(page: Page) -> None:
    """Begin a calibration, and wait for guidance."""
    view = page.locator("#view-calibrate")
    page.get_by_label("Participant").fill("P01")
    page.get_by_text("Settings", exact=True).click()
    for label, value in BRIEF.items():
        page.get_by_label(label).locator("visible=true").fill(value)
    page.get_by_role("button", name="Start").click()
    expect(view.get_by_text("Recording", exact=True)).to_be_visible()
    view.evaluate("section => section.scrollIntoView()")


def publish(page: Page) -> None:
    """Wait for the calibration, and publish and activate its model."""
    view = page.locator("#view-calibrate")
    expect(view.locator("[role=status].summary")).to_have_text("Done", timeout=DONE_MS)
    page.get_by_role("button", name="Publish").click()
    page.get_by_role("button", name=f"Activate on {GUIDED}").click()
    expect(view.get_by_text(f"{GUIDED} applies this version.")).to_be_visible()


def models(page: Page) -> None:
    """Compare both calibrations of the person."""
    page.get_by_label("Newest versions only").uncheck()
    page.get_by_role("link", name=f"{GUIDED}/P01@2").first.click()
    page.get_by_role("link", name=f"with {GUIDED}/P01@1").click()
    expect(page.get_by_role("heading", name="Phase, degrees")).to_be_visible()


def discovery(page: Page) -> None:
    """Find out what the paper's model gets wrong."""
    view = page.locator("#view-discovery")
    page.get_by_label("Study").select_option("visit1.h5")
    page.get_by_role("button", name="Start").click()
    expect(view.locator("[data-state]")).to_have_text("Done", timeout=DONE_MS)
    expect(view.locator("[data-verdict]")).to_be_visible()


def experiment(page: Page, tablet: Page, rig: frictus.Rig, trials: int) -> None:
    """Run the first trials of a ready protocol, answered by what the finger feels."""
    page.get_by_label("Protocol").select_option("detection")
    page.get_by_label("Participant").fill("P07")
    page.get_by_role("button", name="Arm the rig and start").click()
    asked(tablet).get_by_role("button", name="Begin").click()
    with participant(tablet, rig, SimulatedObserver(), np.random.default_rng(7)) as person:
        for _ in range(trials):
            person.answer()
    expect(asked(tablet).get_by_role("button", name="Second")).to_be_visible()


class Looking:
    """Takes pictures of a site.

    Parameters
    ----------
    browser : Browser
    url : str
        Of the dashboard.
    """

    def __init__(self, browser: Browser, url: str) -> None:
        self._browser = browser
        self._url = url

    @contextmanager
    def at(
        self, view: str, rig: str, scheme: str = "light", tall: int = 800, wide: int = 1280
    ) -> Iterator[Page]:
        """Open a view of a rig."""
        page = self._browser.new_page(
            viewport={"width": wide, "height": tall},
            color_scheme=scheme,  # type: ignore[arg-type]
            locale="en-GB",
        )
        page.set_default_timeout(PATIENCE_MS)
        page.goto(f"{self._url}#/{view}/{rig}")
        expect(page.locator("#connection")).to_have_text("Live")
        yield page
        page.close()

    def take(self, page: Page, name: str) -> None:
        """Keep what is on screen."""
        page.screenshot(path=DOCS / name)
        sys.stdout.write(f"{DOCS / name}\n")


def take_experiment(looking: Looking, rig: frictus.Rig) -> None:
    """Take pictures of both pages of an experiment, in the middle of it."""
    with (
        looking.at("participant", rig.name, tall=640, wide=1024) as tablet,
        looking.at("experiment", rig.name, tall=1250) as page,
    ):
        experiment(page, tablet, rig, trials=24)
        looking.take(tablet, "dashboard_participant.png")
        page.evaluate("scrollTo(0, 0)")
        looking.take(page, "dashboard_experiment.png")
        page.get_by_role("button", name="Stop the experiment").click()
        expect(page.get_by_text("Stopped: it can go on").first).to_be_visible()


def take_all(looking: Looking) -> None:
    """Take a picture of every view."""
    pictures: list[tuple[str, str, str, str, int, Callable[[Page], None]]] = [
        ("dashboard.png", "live", STROKED, "light", 800, live),
        ("dashboard_dark.png", "live", STROKED, "dark", 800, live),
        ("dashboard_textures.png", "textures", STROKED, "light", 1200, textures),
        ("dashboard_discovery.png", "discovery", STROKED, "light", 1200, discovery),
    ]
    for name, view, rig, scheme, tall, show in pictures:
        with looking.at(view, rig, scheme, tall) as page:
            show(page)
            page.evaluate("scrollTo(0, 0)")
            looking.take(page, name)
    with looking.at("live-model", STROKED, tall=900, wide=1440) as page:
        live_model(page)
        looking.take(page, "dashboard_live_model.png")
    for session in (1, 2):
        with looking.at("calibrate", GUIDED, tall=1000) as page:
            calibrate(page)
            if session == 1:
                looking.take(page, "dashboard_calibrate.png")
            publish(page)
            if session == 1:
                looking.take(page, "dashboard_calibrated.png")
    with looking.at("models", GUIDED, tall=1400) as page:
        models(page)
        page.evaluate("scrollTo(0, 0)")
        looking.take(page, "dashboard_models.png")


def main() -> None:
    """Write the pictures."""
    path = shutil.which("chromium") or shutil.which("chromium-browser")
    if path is None:
        raise SystemExit("there is no chromium here: `apt-get install chromium` brings one")
    expect.set_options(timeout=PATIENCE_MS)
    with (
        tempfile.TemporaryDirectory(prefix="frictus-pictures-") as folder,
        site(Path(folder)) as config,
        frictus.connect(config.router.endpoint, "linen-study") as client,
        sync_playwright() as playwright,
    ):
        rig = client.rig(STROKED)
        rig.set_scene(scene())
        browser = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
        looking = Looking(browser, f"http://127.0.0.1:{config.api.port}/dashboard/")
        with rig.arm():
            take_all(looking)
        take_experiment(looking, rig)
        browser.close()


if __name__ == "__main__":
    main()
