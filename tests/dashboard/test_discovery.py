"""The view of discoveries before a real daemon: started by clicks, followed, read."""

import os
import re
import signal
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Locator, Page, expect
from tests.blind.generator.case import Case, Design, Hidden
from tests.blind.generator.study import Seeds, make_study
from tests.dashboard.conftest import OpenPage
from tests.dashboard.lab import WIDTHS, Lab, enter, expect_no_violations, read_only, running
from tests.dashboard.textures.view import drop
from tests.service.discovery.found import across, discovery, left, pair

from frictus_service.discovery.across_studies import page as across_page
from frictus_service.discovery.document import Discovery
from frictus_service.discovery.jobs import DiscoveryResult, DiscoverySpec, DiscoveryStore
from frictus_service.discovery.report.findings import verdict_sentence
from frictus_service.discovery.report.page import write

pytestmark = [pytest.mark.browser, pytest.mark.timeout(600)]

BEGUN_MS = 60_000
"""A job imports all that it needs first."""
DONE_MS = 300_000
RETURN_MS = 60_000
HIDDEN = (Hidden("direction_asymmetry", {"share": 0.15}),)
DESIGN = Design(participants=6, n_tones=3, n_speeds=2, n_forces=1, tones_per_trial=3)


def make(lab: Lab, name: str, rng: np.random.Generator) -> None:
    """Make a study in which a direction is felt more than the other."""
    lab.config.studies.mkdir(exist_ok=True)
    drawn = Seeds(*(int(seed) for seed in rng.integers(2**31, size=2)))
    make_study(lab.config.studies / name, Case("test", HIDDEN, DESIGN), drawn)


def keep(lab: Lab, found: Discovery) -> str:
    """Put a finished discovery on the shelf, and return its id."""
    lab.config.studies.mkdir(exist_ok=True)
    (lab.config.studies / "kept.h5").touch()
    shelf = DiscoveryStore(lab.config.studies)
    job = shelf.create(DiscoverySpec(study="kept.h5", base="constant-cutoff"), "somebody")
    write(found, shelf.folder(job.id))
    result = DiscoveryResult(
        verdict=found.verdict,
        sentence=verdict_sentence(found),
        causes=tuple(cause.id for cause in found.causes),
    )
    shelf.change(job.id, "done", of=("queued",), result=result)
    return job.id


@pytest.fixture(scope="module")
def lab(browser: object, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Lab]:
    """A daemon without a rig: none is needed to look at studies."""
    with running(tmp_path_factory.mktemp("lab"), rig=False) as lab:
        yield lab


def arrive(page: Page, lab: Lab) -> None:
    page.goto(lab.url)
    expect(page.locator("#connection")).to_have_text("Connected; no rig is present")
    page.get_by_role("link", name="Discovery", exact=True).click()
    expect(page.get_by_role("heading", name="What does a model get wrong?")).to_be_visible()


def state(page: Page) -> Locator:
    return page.locator("#view-discovery [data-state]")


def test_a_discovery_by_clicks_alone(
    lab: Lab, open_page: OpenPage, rng: np.random.Generator
) -> None:
    make(lab, "visit1.h5", rng)
    with open_page() as page:
        arrive(page, lab)
        page.get_by_label("Study").select_option("visit1.h5")
        page.get_by_label("Model that is criticised").select_option(
            label="The paper's speed law"
        )
        page.get_by_role("button", name="Start").click()
        expect(state(page)).to_have_text("Runs")
        first = page.url
        page.get_by_role("button", name="Start").click()  # one more: it has to wait
        expect(state(page)).to_have_text("Waits for its turn")
        page.get_by_role("button", name="Cancel").click()
        page.goto(first)
        expect(page.locator("#view-discovery ol")).to_contain_text(
            "36 trials",
            timeout=BEGUN_MS,
        )
        expect(state(page)).to_have_text("Done", timeout=DONE_MS)
        causes = page.get_by_role("table", name="Causes that the data name")
        asymmetry = causes.get_by_role("row", name="direction asymmetry")
        expect(asymmetry).to_contain_text("share 0.1")
        expect(asymmetry).to_contain_text("95 %")
        report = page.locator("#view-discovery .report")
        expect(report).to_contain_text("6 participants")
        expect(report).to_contain_text("Log-likelihood of held-out data")
        pictures = report.get_by_role("img")
        expect(pictures.first).to_have_attribute("alt", re.compile("residual Bode plot by"))
        expect(report.get_by_role("img", name="parameters by participant")).to_be_visible()
        drawn = pictures.evaluate_all(
            "each => each.map(({ complete, naturalWidth: w }) => complete && w > 300)"
        )
        assert all(drawn)
        expect(report.locator("figcaption").first).to_contain_text("line at zero")
        expect_no_violations(page, WIDTHS)
        earlier = page.get_by_role("table", name="The newest first").locator("tbody tr")
        expect(earlier).to_have_count(2)
        expect(earlier.first).to_contain_text("Cancelled")
        with page.expect_popup() as opened:
            page.get_by_role("link", name="Open the report with figures").click()
        expect(opened.value.get_by_role("heading", level=1)).to_contain_text("What the model")
        page.reload()
        expect(asymmetry).to_be_visible()


def test_a_study_is_added_by_a_click_and_chosen(
    lab: Lab, open_page: OpenPage, rng: np.random.Generator, tmp_path: Path
) -> None:
    make(lab, "mine.h5", rng)
    mine = (lab.config.studies / "mine.h5").rename(tmp_path / "mine.h5")
    (tmp_path / "no.h5").write_text("mice")
    (tmp_path / "my study.h5").touch()
    with open_page(expected="422") as page:
        arrive(page, lab)
        adding, told = page.get_by_label("Add a file of yours"), page.get_by_role("status")
        adding.set_input_files(tmp_path / "my study.h5")
        expect(told.filter(has_text="Rename the file")).to_be_visible()
        adding.set_input_files(tmp_path / "no.h5")
        refused = told.filter(has_text="no.h5 is not added: no.h5 is not an HDF5 file")
        expect(refused).to_be_visible(timeout=BEGUN_MS)
        adding.set_input_files(mine)
        expect(told.filter(has_text="mine.h5 is added")).to_be_visible(timeout=BEGUN_MS)
        expect(page.get_by_label("Study")).to_have_value("mine.h5")
        expect_no_violations(page, WIDTHS)
    assert (lab.config.studies / "mine.h5").read_bytes() == mine.read_bytes()


def test_a_study_is_dropped_and_what_is_none_refused(
    lab: Lab, open_page: OpenPage, rng: np.random.Generator, tmp_path: Path
) -> None:
    make(lab, "dropped.h5", rng)
    mine = (lab.config.studies / "dropped.h5").rename(tmp_path / "dropped.h5").read_bytes()
    with open_page() as page:
        arrive(page, lab)
        told = page.locator("#view-discovery").get_by_role("status")
        for name in ("visit1.zip", "visit1"):  # a folder comes as a file without an ending
            drop(page, name, b"mice")
            refused = told.filter(has_text=f"{name} is no .h5 file, as a study is")
            expect(refused).to_contain_text("add the .h5 in it")
        marked = page.locator("[data-dropping]")
        expect(marked).to_have_count(0)
        page.evaluate(
            """() => {
              const dataTransfer = new DataTransfer();
              dataTransfer.items.add(new File([], "dropped.h5"));
              const asked = { dataTransfer, bubbles: true, cancelable: true };
              document.body.dispatchEvent(new DragEvent("dragover", asked));
            }"""
        )
        expect(marked).to_contain_text("Add a file of yours")
        expect_no_violations(page, WIDTHS)
        drop(page, "dropped.h5", mine)
        expect(marked).to_have_count(0)
        expect(told.filter(has_text="dropped.h5 is added")).to_be_visible(timeout=BEGUN_MS)
        expect(page.get_by_label("Study")).to_have_value("dropped.h5")
    assert (lab.config.studies / "dropped.h5").read_bytes() == mine


def test_reads_every_part_of_a_report(
    lab: Lab, open_page: OpenPage, rng: np.random.Generator
) -> None:
    notes = ("the screen was changed in between",)
    found = discovery(
        rng,
        verdict="partly_explained",
        cannot_tell=(pair(),),
        unexplained=(left(),),
        notes=notes,
    )
    job = keep(lab, found)
    with open_page() as page:
        arrive(page, lab)
        page.get_by_role("table", name="The newest first").get_by_role("link").first.click()
        assert job in page.url
        view = page.locator("#view-discovery")
        expect(view.locator("[data-verdict]")).to_have_text("Partly explained")
        for told in (
            verdict_sentence(found),
            "confirmed: the catalogue's shape fits",
            "97 % of what is reproducibly wrong",
            "640 to 985",
            *notes,
        ):
            expect(view).to_contain_text(told)
        told_apart = page.get_by_role("table", name="It is one of the two")
        expect(told_apart.get_by_role("row", name="channel delay")).to_contain_text("0.96")
        rest = page.get_by_role("table", name="Reproducible, without a cause")
        expect(rest).to_contain_text("by position")
        untested = page.get_by_role("table", name="These causes were not looked for")
        expect(untested).to_contain_text("no trial says when it began")
        for summary in view.locator("summary").all():
            if summary.is_visible():
                summary.click()
        tests = page.get_by_role("table", name="p values are corrected for all causes together")
        expect(tests.get_by_role("row", name="speed dependent cutoff")).to_contain_text("named")
        expect_no_violations(page, WIDTHS)


def test_the_answer_of_several_studies_is_shown(lab: Lab, open_page: OpenPage) -> None:
    lab.config.studies.mkdir(exist_ok=True)
    shelf = DiscoveryStore(lab.config.studies)
    names = ("first", "second")
    for name in names:
        (lab.config.studies / f"{name}.h5").touch()
    job = shelf.create(DiscoverySpec(study=tuple(f"{name}.h5" for name in names)), "somebody")
    found = across(names)
    across_page.write(found, shelf.folder(job.id))
    result = DiscoveryResult(verdict=None, sentence=found.sentence, causes=())
    shelf.change(job.id, "done", of=("queued",), result=result)
    with open_page() as page:
        arrive(page, lab)
        row = page.get_by_role("row", name="first.h5, second.h5")
        expect(row).to_contain_text(found.sentence)
        row.get_by_role("link").click()
        view = page.locator("#view-discovery")
        expect(view.get_by_text(found.sentence, exact=True)).to_be_visible()
        expect(view).to_contain_text("Left out: bad.h5: it is no study")
        each = page.get_by_role("table", name="Each study by itself")
        expect(each.get_by_role("row", name="second")).to_contain_text(
            "nothing reproducible is wrong"
        )
        expect_no_violations(page, WIDTHS)


def test_reader_reads_and_saves_but_starts_nothing(
    lab: Lab, open_page: OpenPage, rng: np.random.Generator
) -> None:
    job = keep(lab, discovery(rng))
    with read_only(lab) as url, open_page(accept_downloads=True) as page:
        enter(page, f"{url}#/discovery//{job}")
        expect(page.locator("#view-discovery [data-verdict]")).to_have_text("Explained")
        expect(page.get_by_text("takes a token with the scope calibrate")).to_be_visible()
        expect(page.get_by_role("button", name="Start")).to_be_hidden()
        # A link could not present the token.
        expect(page.get_by_role("link", name="Open the report")).to_have_count(0)
        with page.expect_download() as saved:
            page.get_by_role("button", name="Save the report with figures").click()
        assert saved.value.suggested_filename == f"discovery-{job}.html"
        assert "<img" in Path(saved.value.path()).read_text("utf-8")


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGKILL for others")
def test_an_api_that_dies_is_told_and_what_it_did_is_interrupted(
    lab: Lab, open_page: OpenPage, rng: np.random.Generator
) -> None:
    make(lab, "visit2.h5", rng)
    with open_page(expected="net::ERR_") as page:
        arrive(page, lab)
        page.get_by_label("Study").select_option("visit2.h5")
        page.get_by_role("button", name="Start").click()
        expect(state(page)).to_have_text("Runs")
        os.kill(lab.supervisor.pid_of("api"), signal.SIGKILL)
        expect(
            page.get_by_text("No word from the service: this is from before.")
        ).to_be_visible()
        expect(page.get_by_role("button", name="Cancel")).to_be_hidden()
        expect(state(page)).to_contain_text("Interrupted", timeout=RETURN_MS)
