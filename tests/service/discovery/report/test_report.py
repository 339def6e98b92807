"""The report: the verdict first, one file, complete, nothing of the study executed in it."""

import html
import io
import re
from html.parser import HTMLParser

import numpy as np
import pytest
from rich.console import Console
from tests.service.discovery.found import cause, discovery, left, pair

from frictus_service.cli.studies.discover import NOT_PRINTED, show, summary
from frictus_service.discovery.catalogue.cause import title
from frictus_service.discovery.catalogue.causes import CAUSES
from frictus_service.discovery.document import (
    Discovery,
    RankedModel,
    ResidualBin,
    RivalCost,
    TrialsLeftOut,
)
from frictus_service.discovery.one_recording.phrasing import taken_away
from frictus_service.discovery.report.figures import each_place_once
from frictus_service.discovery.report.findings import (
    gain_sentence,
    kept_share,
    parameters,
    place_of,
    places,
    verdict_sentence,
)
from frictus_service.discovery.report.page import SOURCES, bibtex, methods_paragraph, render
from frictus_service.discovery.report.residuals import by_relevance, remaining, residual_bode


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


def test_a_place_of_several_patterns_is_told_once_by_the_clearest() -> None:
    clear = left()
    unclear = clear.model_copy(update={"p_value": 2.0 * clear.p_value})
    clearest = clear.model_copy(update={"covariate": None, "p_value": 0.5 * clear.p_value})
    assert each_place_once([unclear, clear, clearest]) == (clearest, clear)


def test_everything_is_in_one_file(rng: np.random.Generator) -> None:
    found = everything(rng)
    page = Page(render(found))
    assert not page.open
    assert "script" not in page.tags
    pictures = [source for source in page.sources if not source.startswith("https://doi.org/")]
    assert all(source.startswith("data:image/png;base64,") for source in pictures)
    assert len(pictures) == 4
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
        (
            "clean",
            "explains these data: nothing that it gets wrong is reproducible in the mean",
        ),
        ("explained", "say why: speed dependent cutoff. Nothing else is left."),
        ("partly_explained", "140 to 220 Hz, by position"),
        ("unexplained", "no known cause explains it, most clearly in size, 140 to 220 Hz"),
    ],
)
def test_the_verdict_is_a_sentence(rng: np.random.Generator, verdict: str, said: str) -> None:
    unexplained = (left(),) if verdict in ("partly_explained", "unexplained") else ()
    found = discovery(rng, verdict=verdict, unexplained=unexplained)
    assert said in verdict_sentence(found)


def test_of_few_people_nothing_is_said_of_others(rng: np.random.Generator) -> None:
    found = discovery(rng, verdict="explained")
    assert found.evidence is not None
    assert verdict_sentence(found).startswith("The base model is wrong, ")
    for people, whose in ((4, "these 4 people"), (1, "this person")):
        few = found.evidence.model_copy(update={"participants": people, "held_out": "blocks"})
        sentence = verdict_sentence(found.model_copy(update={"evidence": few}))
        assert sentence.startswith(f"The base model is wrong of {whose}, ")


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
    axes, near = forest.axes
    low, high = found.causes[0].parameters["slope_hz_per_mm_s"].ci95 or (0.0, 0.0)
    assert near.get_xlim() == pytest.approx((2 * low - high, 2 * high - low))
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


def test_an_offset_that_all_levels_share_does_not_rank_a_covariate(
    rng: np.random.Generator,
) -> None:
    found = discovery(rng)
    (one, *_) = found.residuals
    offset = [
        one.model_copy(
            update={"covariate": "force", "level": force, "tone_hz": tone_hz, "before_db": 30.0}
        )
        for force in (0.2, 0.4)
        for tone_hz in (90.0, 270.0)
    ]
    both = found.model_copy(update={"residuals": (*offset, *found.residuals)})
    assert by_relevance(both) == ["speed", "force"]


def test_each_model_has_its_own_error_bars(rng: np.random.Generator) -> None:
    found = discovery(rng)
    wide = tuple(
        one.model_copy(update={"before_error_db": 3.0, "before_error_deg": 5.0})
        for one in found.residuals
    )
    figure = residual_bode(found.model_copy(update={"residuals": wide}), "speed")
    for axes, half in zip(figure.axes, (3.0, 0.1, 5.0, 0.6), strict=True):
        (bars,) = axes.containers[0].lines[2]  # type: ignore[attr-defined]
        lengths = [np.ptp(segment[:, 1]) for segment in bars.get_segments()]
        assert lengths == pytest.approx([2.0 * half] * len(lengths))


def test_what_is_left_is_said_where_everything_is_explained(rng: np.random.Generator) -> None:
    found = discovery(rng)
    told = remaining(found)
    assert told is not None
    covariate, rows = told
    assert covariate == "speed"
    assert [one.tone_hz for one in rows] == sorted({one.tone_hz for one in found.residuals})
    assert max(one.before_db for one in rows) > 1.0 > max(one.after_db for one in rows)
    assert not any(one.beyond for one in rows)
    (first, *others) = found.residuals
    off = first.model_copy(update={"after_db": -9.0})
    _, rows = remaining(found.model_copy(update={"residuals": (off, *others)})) or ("", [])
    assert [one.tone_hz for one in rows if one.beyond] == [first.tone_hz]
    assert "(-9 dB)" in rows[0].largest
    assert remaining(empty(rng)) is None


def test_reasons_and_methods_are_told_whole(rng: np.random.Generator) -> None:
    found = discovery(rng)
    reasons = tuple(TrialsLeftOut(reason=f"reason {k}", trials=14 - k) for k in range(12))
    study = found.study.model_copy(update={"left_out": reasons})
    text = Page(render(found.model_copy(update={"study": study}))).text
    assert all(each.reason in text for each in reasons)
    methods = methods_paragraph(found)
    assert methods is not None
    for number in (
        "467 of 480 trials",
        "8 participants",
        "13 were left out",
        found.study.sha256,
        str(found.seed),
        f"of {len(found.tests)} in",
    ):
        assert number in methods
    assert methods in text
    assert bibtex().count("@article{") == len(SOURCES)
    assert bibtex().count("{") == bibtex().count("}")
    assert methods_paragraph(empty(rng)) is None


def test_gain_is_told_as_a_share(rng: np.random.Generator) -> None:
    found = discovery(rng)
    assert found.gain is not None
    assert "91.3 % of the mean square" in gain_sentence(found.gain)  # 1 - (0.71 / 2.41)²
    assert "nats" not in gain_sentence(found.gain)
    worse = found.gain.model_copy(update={"residual_deg": (0.9, 0.9001)})
    assert "and nothing in phase" in gain_sentence(worse)
    worse = found.gain.model_copy(update={"residual_deg": (0.9, 0.909)})
    assert "and nothing (it leaves 2 % more) in phase" in gain_sentence(worse)


def test_rivals_are_told_by_what_they_keep(rng: np.random.Generator) -> None:
    rivals = (
        RivalCost(id="cutoff_drift", nats_per_unit=30.0, cost=10.0, ci95=(-2.0, 22.0)),
        RivalCost(id="channel_delay", nats_per_unit=-1.0, cost=41.0, ci95=(30.0, 52.0)),
    )
    text = Page(render(discovery(rng, causes=(cause(rng, rivals=rivals),)))).text
    assert [kept_share(one) for one in rivals] == ["75 %", "nothing"]
    assert "75 %" in text
    assert text.count("no: the interval of its cost holds zero") == 1


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


def test_a_share_that_was_never_computed_is_unknown_and_not_zero() -> None:
    older = {"causes": [], "parameters": {}, "heldout_loglik": 3.0}
    older |= {"standard_error": 1.0, "aic": -4.0}
    model = RankedModel.model_validate(older)
    assert taken_away(model) == "unknown"
    assert taken_away(model.model_copy(update={"explained": 0.25})) == "25 %"
