"""The report: one file, complete, nothing of the study executed in it."""

import base64
import re
from dataclasses import replace
from html.parser import HTMLParser
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from tests.service.identification.observed import Bench, Finger, observations

from frictus_service.identification.analysis import identify
from frictus_service.identification.documents import Identification, Settings
from frictus_service.identification.observation.response import TrialObservations
from frictus_service.identification.report.page import named_models, render, write

BENCH = Bench(
    tones_hz=(30.0, 120.0, 450.0, 2000.0), speeds=(20.0, 100.0), forces=(0.3, 0.5), seconds=1.0
)


class Page(HTMLParser):
    """Tags, and what they refer to."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.sources: list[str] = []
        self.open: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.sources += [value or "" for name, value in attrs if name in ("src", "href")]
        if tag not in ("meta", "img"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def made(
    rng: np.random.Generator, n: int = 3, bench: Bench = BENCH
) -> tuple[Identification, list[TrialObservations]]:
    seen = observations([Finger(slope=13.8 + i) for i in range(n)], bench, rng)
    seen[0] = replace(seen[0], valid=False, reasons=("<script>alert(1)</script>",))
    return identify(seen, path="a & b.h5", settings=Settings(mixed_models=False)), seen


@pytest.mark.long
def test_everything_is_in_one_file(rng: np.random.Generator) -> None:
    found, seen = made(rng)
    text = render(found, seen)
    page = Page(text)
    assert not page.open
    assert "script" not in page.tags
    assert all(source.startswith("data:image/png;base64,") for source in page.sources)
    for source in page.sources:
        with Image.open(BytesIO(base64.b64decode(source.split(",", 1)[1]))) as image:
            assert image.width > 300
    # Laws, effects, five parameters, the correlation, and a Bode plot per participant.
    assert page.tags.count("img") == 1 + 1 + 5 + 1 + 3
    assert "&lt;script&gt;" in text
    assert "a &amp; b.h5" in text
    for caution in found.correlations[0].cautions:
        assert caution.replace("'", "&#39;") in text
    assert found.population is not None
    for value in found.population.values:
        assert value.mean.ci95 is not None
        low, high = value.mean.ci95
        assert f"{value.mean.value:.4g} [{low:.4g}, {high:.4g}]" in text


def test_without_law_population_or_skin_it_still_stands(rng: np.random.Generator) -> None:
    found, seen = made(rng, 1, replace(BENCH, speeds=(60.0,), forces=(0.4,)))
    text = render(found, seen)
    assert "One speed only" in text
    assert not Page(text).open
    few = replace(BENCH, tones_hz=(30.0, 120.0))
    found, seen = made(rng, 2, few)
    assert "No friction response" in render(found, seen)


@pytest.mark.long
def test_files_are_written_over_and_stale_models_go(
    rng: np.random.Generator, tmp_path: Path
) -> None:
    found, seen = made(rng, 2)
    first = write(found, seen, tmp_path)
    assert {path.name for path in first} >= {"report.html", "identification.json"}
    assert (tmp_path / "models" / "population-friction.json") in first
    assert (tmp_path / "models" / "participant-P02-friction.json") in first
    other = tmp_path / "models" / "calibrated.json"
    other.write_text("of somebody else")
    alone = [item for item in seen if item.info.participant == "P01"]
    again = write(identify(alone, settings=Settings(mixed_models=False)), alone, tmp_path)
    assert set(tmp_path.rglob("*.*")) == {*again, other}


def test_pseudonyms_cannot_leave_the_folder(rng: np.random.Generator) -> None:
    _, seen = made(rng, 2)
    pseudonyms = {"P01": "../../up", "P02": "___.._up"}
    renamed = [
        replace(item, info=replace(item.info, participant=pseudonyms[item.info.participant]))
        for item in seen
    ]
    found = identify(renamed, settings=Settings(mixed_models=False, sweeps=False))
    names = [name for name, _ in named_models(found)]
    assert len(names) == len(set(names)) == 5
    assert all(re.fullmatch(r"[A-Za-z0-9._-]+", name) for name in names)
