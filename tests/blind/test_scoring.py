"""Scores and rates, on reports of which the worth is known."""

from typing import Any

import numpy as np
import pytest
from tests.blind.campaign import tasks
from tests.blind.cases import KINDS, REALISTIC, draw_case
from tests.blind.generator import Case, Hidden
from tests.blind.judgement import Rate, rates
from tests.blind.scoring import score

TONES = (40.0, 130.0, 180.0, 500.0, 1700.0)
DELAY = Case("single", (Hidden("channel_delay", {"delay_s": 4e-6}),))
MODE = Case(
    "unknown", (Hidden("hidden_mode", {"depth": 0.2, "frequency_hz": 180.0}, "unknown"),)
)


def report(
    named: dict[str, tuple[str, float, float]] | None = None,
    pairs: tuple[tuple[str, str], ...] = (),
    left: tuple[dict[str, Any], ...] = (),
    forms: tuple[str, ...] = (),
) -> dict[str, Any]:
    """Return a report that names causes with an interval of `delay_s`."""
    causes = [
        {
            "id": name,
            "verdict": verdict,
            "parameters": {"delay_s": {"value": (low + high) / 2.0, "ci95": [low, high]}},
        }
        for name, (verdict, low, high) in (named or {}).items()
    ]
    return {
        "verdict": "explained" if named else "clean",
        "causes": causes,
        "cannot_tell": [{"between": list(pair)} for pair in pairs],
        "unexplained": list(left),
        "characterised": [{"id": form} for form in forms],
        "gain": {"heldout_loglik": 12.0} if named else None,
        "explained_share": None,
    }


def test_a_named_cause_is_found_and_its_interval_judged() -> None:
    hit = score(report({"channel_delay": ("confirmed", 3e-6, 5e-6)}), DELAY, TONES)
    assert hit.found == {"channel_delay": "confirmed"}
    assert hit.covered == {"channel_delay": True}
    miss = score(report({"channel_delay": ("confirmed", 5e-6, 7e-6)}), DELAY, TONES)
    assert miss.covered == {"channel_delay": False}


def test_intervals_of_where_a_mode_is_are_judged_too() -> None:
    truth = {"share": 0.4, "frequency_hz": 230.0, "quality": 4.0}
    said = {
        "share": {"value": 0.41, "ci95": [0.38, 0.44]},
        "frequency_hz": {"value": 230.1, "ci95": [229.8, 230.4]},
        "quality": {"value": 4.2, "ci95": [4.1, 4.3]},
    }
    named = {"id": "second_mode", "verdict": "confirmed", "parameters": said}
    case = Case("skin", (Hidden("second_mode", truth),))
    found = score(report() | {"causes": [named]}, case, TONES)
    assert found.covered == {
        "second_mode": True,
        "second_mode.frequency_hz": True,
        "second_mode.quality": False,
    }


def test_an_early_channel_is_of_a_kind_of_its_own(rng: np.random.Generator) -> None:
    (early,) = draw_case("early", "channel_delay", rng).hidden
    (late,) = draw_case("single", "channel_delay", rng).hidden
    assert early.parameters["delay_s"] == -late.parameters["delay_s"] < 0.0


def test_a_pair_that_holds_the_truth_counts_and_another_accuses() -> None:
    held = score(report(pairs=(("fractional_rolloff", "channel_delay"),)), DELAY, TONES)
    assert held.found == {"channel_delay": "cannot_tell"}
    assert not held.false_pairs
    other = score(report(pairs=(("gain_drift", "speed_dependent_gain"),)), DELAY, TONES)
    assert other.found == {"channel_delay": ""}
    assert other.false_pairs == [["gain_drift", "speed_dependent_gain"]]


def test_a_cause_that_is_not_there_is_false() -> None:
    found = score(report({"charge_leakage": ("confirmed", 0.0, 1.0)}), Case("null"), TONES)
    assert found.false == {"charge_leakage": "confirmed"}


@pytest.mark.parametrize(
    ("covariate", "band", "located"),
    [
        (None, [180.0, 180.0], True),
        (None, [130.0, 180.0], True),
        (None, [40.0, 1700.0], False),
        (None, [500.0, 500.0], False),
        ("speed", [180.0, 180.0], False),
    ],
)
def test_an_unknown_effect_is_located_by_its_tones(
    covariate: str | None, band: list[float], located: bool
) -> None:
    entry = {"channel": "size", "band_hz": band, "covariate": covariate, "p_value": 0.01}
    assert score(report(left=(entry,)), MODE, TONES).located is located


@pytest.mark.parametrize(
    ("forms", "formed"),
    [((), False), (("extra_resonance", "echo"), True), (("echo", "extra_resonance"), False)],
)
def test_the_form_that_explains_most_is_the_one_that_counts(
    forms: tuple[str, ...], formed: bool
) -> None:
    assert score(report(forms=forms), MODE, TONES).formed is formed


@pytest.mark.parametrize(("hits", "kept"), [(15, True), (16, False), (0, True)])
def test_fifteen_false_causes_of_two_hundred_do_not_refute_five_percent(
    hits: int, kept: bool
) -> None:
    assert Rate("null", hits, 200, most=0.05, chance=True).kept is kept


def test_nothing_counted_keeps_no_bound() -> None:
    assert not Rate("none", 0, 0, least=0.9).kept
    assert not any(rate.kept for rate in rates([]))


def test_an_error_breaks_the_bound_of_errors() -> None:
    line = {"name": "null//0", "seed": 1, "task": {"kind": "null", "which": ""}, "error": "x"}
    assert not rates([line])[0].kept


def test_a_campaign_holds_what_is_promised(rng: np.random.Generator) -> None:
    every = tasks()
    count = {kind: sum(task.kind == kind for task in every) for kind in KINDS}
    assert len({task.name for task in every}) == len(every)
    assert count["null"] == 200
    assert {task.which for task in every if task.kind == "single"} == set(REALISTIC)
    assert sum(task.seconds > 2.0 for task in every) == 10
    assert count["single"] + 2 * count["pair"] >= 200
    for kind, (names, _) in KINDS.items():
        for which in names:
            assert draw_case(kind, which, rng).kind == kind
