"""Notes: what was left out, what the design cannot show, and what was compared."""

from dataclasses import replace

import numpy as np
import pytest
from tests.service.discovery.made import Design, made

from frictus_service.discovery.decision.caveats import caveats_on, explained_by
from frictus_service.discovery.decision.trial_accounting import missing_trials
from frictus_service.discovery.evidence.observation_table import (
    LEAST_TRIALS,
    comparable,
    units_of,
    used,
)
from frictus_service.discovery.evidence.trial_evidence import TrialEvidence
from frictus_service.discovery.inference.linear_model import Unit


def notes(evidence: list[TrialEvidence]) -> tuple[str, ...]:
    usable = used(evidence)
    trials = comparable(usable, "friction")
    return caveats_on(evidence, usable, trials, units_of(trials, "friction"), "friction")


def invalid(one: TrialEvidence, *reasons: str) -> TrialEvidence:
    return replace(one, observed=replace(one.observed, valid=False, reasons=reasons))


def test_nothing_to_say(rng: np.random.Generator) -> None:
    assert notes(made(rng)) == ()


def test_all_kinds_of_reasons_are_counted_with_an_example_each(
    rng: np.random.Generator,
) -> None:
    evidence = made(rng)
    for k in range(5):
        slow = f"too slow: {k}.5 mm/s, -{k}0% from its target"
        reason = slow if k < 3 else "lifted: the force fell to 0.01 N"
        evidence[k] = invalid(evidence[k], reason, "clipped")
    (told,) = notes(evidence)
    assert told == (
        f"5 of {len(evidence)} trials are not used: 5 x clipped; "
        "3 x too slow: 0.5 mm/s, -00% from its target; "
        "2 x lifted: the force fell to 0.01 N."
    )


def test_trials_without_a_sweep(rng: np.random.Generator) -> None:
    evidence = made(rng)
    names = evidence[0].stretches.__dataclass_fields__
    none = {name: getattr(evidence[0].stretches, name)[:0] for name in names}
    evidence[0] = replace(evidence[0], stretches=replace(evidence[0].stretches, **none))
    (told,) = notes(evidence)
    assert told.startswith(f"1 of {len(evidence)} trials are not used: 1 x there is no steady")


def test_designs_of_one_level(rng: np.random.Generator) -> None:
    for name, design in (
        ("speed", Design(speeds_mm_s=(60.0,))),
        ("force", Design(forces_n=(0.4,))),
    ):
        (told,) = notes(made(rng, design=design))
        assert told.startswith(f"All trials have one target {name}:")


def test_few_people(rng: np.random.Generator) -> None:
    (one,) = notes(made(rng, design=Design(1, repeats=4)))
    assert one.startswith("1 participant, below 6: blocks")
    (some,) = notes(made(rng, design=Design(5)))
    assert some.startswith("5 participants, below 6: blocks")
    (few,) = notes(made(rng, design=Design(1, repeats=3)))
    assert few.startswith("Nothing was tested: 36 usable trials of 1 participants")
    assert few.endswith(
        "measure 12 more trials that give a friction response, or 5 more participants."
    )
    assert notes([])[0].startswith("Nothing was tested: 0 usable trials")


@pytest.mark.parametrize(
    ("telling", "more"),
    [([], 48), ([36], 12), ([48], 0), ([47], 1), ([7, 7, 1], 1 + 1 + 7 + 24), ([50], 0)],
)
def test_how_many_trials_are_missing(telling: list[int], more: int) -> None:
    assert missing_trials(telling) == more


def test_who_is_left_out_and_why(rng: np.random.Generator) -> None:
    evidence = made(rng, design=Design(5))
    of_last = [one for one in evidence if one.observed.info.participant == "P04"]
    few = [one for one in evidence if one not in of_last[LEAST_TRIALS - 1 :]]
    told, blocks = notes(few)
    assert told.startswith(f"Left out: P04: fewer than {LEAST_TRIALS} usable trials")
    assert blocks.startswith("4 participants, below 6: blocks")
    of_one = [
        silent(one) if one.observed.info.participant == "P07" else one for one in made(rng)
    ]
    told, why = notes(of_one)
    assert why.startswith("24 usable trials without a friction response: ")
    assert why.endswith(
        "24 x no response could be measured where speed, force and position are known."
    )
    assert told == "Left out: P07: no usable trial says anything of the friction response."


def silent(one: TrialEvidence) -> TrialEvidence:
    """Return a trial of which nothing measured the response."""
    rows = one.observed.rows
    rows = replace(rows, friction_response=rows.friction_response * np.nan)
    return replace(one, observed=replace(one.observed, rows=rows))


def test_what_is_explained_knows_no_units_of_columns(rng: np.random.Generator) -> None:
    none = np.zeros((40, 0))
    unit = Unit(none, np.ones((40, 1)), none, none, none[0], none[0], none[0] > 0, none[0] > 0)
    columns = list(rng.normal(size=(6, 40, 2)))
    misfits = [each.sum(axis=1) + rng.normal(size=40) for each in columns]
    plain = explained_by([unit] * 6, misfits, columns)
    assert 0.3 < plain < 1.0
    scaled = [each * np.array([1e8, 0.1]) for each in columns]
    assert explained_by([unit] * 6, misfits, scaled) == pytest.approx(plain)
