"""The report: the verdict first, one file, complete, nothing of the study executed in it."""

import html
import io
import re
from html.parser import HTMLParser

import numpy as np
import pytest
from rich.console import Console
from tests.service.discovery.found import cause, discovery, left, pair

from frictus_service.cli.discover import NOT_PRINTED, show, summary
from frictus_service.discovery.catalogue.cause import title
from frictus_service.discovery.catalogue.causes import CAUSES
from frictus_service.discovery.document import Discovery, ResidualBin
from frictus_service.discovery.report.findings import (
    by_relevance,
    gain_sentence,
    parameters,
    place_of,
    places,
    residual_bode,
    verdict_sentence,
)
from frictus_service.discovery.report.page import render


class Page(HTMLParser):
    """Tags, what they refer to, and the text."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.sources: list[str] = []
        self.open: list[str] = []
        self.text = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.sources += [value or "" for name, value in attrs if name in ("src", "href")]
        if tag not in ("meta", "img"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data


def everything(rng: np.random.Generator) -> Discovery:
    return discovery(
        rng,
        verdict="partly_explained",
        cannot_tell=(pair(),),
        unexplained=(left(),),
        notes=("<script>alert(1)</script>",),
    )


def empty(rng: np.random.Generator) -> Discovery:
    """Nothing could be tested."""
    found = discovery(rng)
    tests = tuple(
        test.model_copy(
            update={"statistic": None, "p_value": None, "not_tested": "no valid trial"}
        )
        for test in found.tests
    )
    return found.model_copy(
        update={
            "verdict": None,
            "causes": (),
            "extended_model": found.base_model,
            "explained_share": None,
            "gain": None,
            "evidence": None,
            "tests": tests,
            "unseen": (),
            "residuals": (),
            "levels": (),
            "notes": ("All 480 trials are invalid.",),
        }
    )


def test_everything_is_in_one_file(rng: np.random.Generator) -> None:
    found = everything(rng)
    page = Page(render(found))
    assert not page.open
    assert "script" not in page.tags
    assert all(source.startswith("data:image/png;base64,") for source in page.sources)
    assert len(page.sources) == 4
    text = re.sub(r"\s+", " ", page.text)
    assert text.index(verdict_sentence(found)) < text.index("Causes")
    (named,) = found.causes
    for said in (
        named.statement,
        named.next_experiment,
        named.alternatives[0].separating_experiment,
        found.cannot_tell[0].separating_experiment,
        place_of(found.unexplained[0]),
        "not tested: no trial says when it began",
        CAUSES[named.id].literature,
        found.study.path,
        *(title(test.id) for test in found.tests),
    ):
        assert said in text, said


def test_without_anything_to_test_it_still_stands(rng: np.random.Generator) -> None:
    found = empty(rng)
    page = Page(render(found))
    assert not page.sources
    assert "Nothing could be tested" in page.text
    assert "All 480 trials are invalid." in page.text
    assert page.text.count("not tested: no valid trial") == len(found.tests)
    assert "Cannot tell apart" not in page.text


@pytest.mark.parametrize(
    ("verdict", "said"),
    [
        ("clean", "explains these data"),
        ("explained", "say why: speed dependent cutoff. Nothing else is left."),
        ("partly_explained", "140 to 220 Hz, by position"),
        ("unexplained", "no known cause explains it, most clearly in size, 140 to 220 Hz"),
    ],
)
def test_the_verdict_is_a_sentence(rng: np.random.Generator, verdict: str, said: str) -> None:
    unexplained = (left(),) if verdict in ("partly_explained", "unexplained") else ()
    found = discovery(rng, verdict=verdict, unexplained=unexplained)
    assert said in verdict_sentence(found)


def test_a_family_and_a_pair_are_not_told_as_certain(rng: np.random.Generator) -> None:
    named = cause(rng, verdict="family")
    found = discovery(rng, causes=(named,), cannot_tell=(pair(),))
    sentence = verdict_sentence(found)
    assert "speed dependent cutoff, in another shape than the catalogue's" in sentence
    assert "either channel delay or fractional rolloff" in sentence
    assert "the right kind, another shape" in html.unescape(render(found))


def test_the_figures_show_what_is_told(rng: np.random.Generator) -> None:
    found = everything(rng)
    bode = residual_bode(found, "speed")
    size_before, size_after = bode.axes[:2]
    assert len(size_before.containers) == 5
    spread = [
        max(np.abs(line.get_ydata()).max() for line in axes.get_lines())
        for axes in (size_before, size_after)
    ]
    assert spread[0] > 3.0 > spread[1]
    forest = parameters(found)
    assert forest is not None
    (axes,) = forest.axes
    labels = [label.get_text() for label in axes.get_yticklabels()]
    assert labels == [*(f"P{i:02}" for i in range(1, 9)), "all"]
    where = places(found)
    assert where is not None
    (bar,) = where.axes[0].patches
    low, width = bar.get_x(), bar.get_width()  # type: ignore[attr-defined]
    assert low <= 140.0 < 220.0 <= low + width


def test_the_covariate_that_matters_comes_first(rng: np.random.Generator) -> None:
    found = discovery(rng)
    flat = [
        ResidualBin(
            covariate="force",
            level=force,
            tone_hz=100.0,
            before_db=rng.normal(0.0, 0.1),
            before_deg=rng.normal(0.0, 1.0),
            after_db=0.0,
            after_deg=0.0,
            error_db=0.1,
            error_deg=1.0,
        )
        for force in (0.2, 0.4, 0.6)
    ]
    both = found.model_copy(update={"residuals": (*flat, *found.residuals)})
    assert by_relevance(both) == ["speed", "force"]


def test_the_terminal_tells_the_same(rng: np.random.Generator) -> None:
    found = everything(rng)
    console = Console(width=200, record=True, file=io.StringIO())
    show(found, console)
    told = console.export_text()
    for said in (
        verdict_sentence(found),
        pair().separating_experiment,
        place_of(left()),
        "not tested: gain drift",
        "<script>",
    ):
        assert said in told, said
    assert found.gain is not None
    assert gain_sentence(found.gain) in told
    printed = summary(found)
    whole = found.model_dump(mode="json", by_alias=True)
    assert printed == {name: whole[name] for name in whole if name not in NOT_PRINTED}
