"""What must change with the data, and what must not."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import datetime, timedelta
from typing import Any

import numpy as np
import pytest
from tests.service.discovery.made import (
    BEGAN,
    dose_in,
    found_in,
    made,
    named,
    suspected,
)

from frictus_hardware.arrays import FloatArray
from frictus_service.discovery import discover as engine
from frictus_service.discovery.evidence.trial_evidence import TrialEvidence
from frictus_service.discovery.problem.candidates import Candidate, candidates_of

pytestmark = pytest.mark.long

Change = Callable[[FloatArray], FloatArray]
MIDDLE_MM = 35.0

BY_COVARIATE = (
    ("direction", "direction_asymmetry", {"share": 0.06}),
    ("normal_force_n", "force_dependent_gain", {"exponent": 0.3}),
    ("minutes", "gain_drift", {"per_minute": 0.06}),
)


def with_column(one: TrialEvidence, name: str, change: Change) -> TrialEvidence:
    """Return the evidence of a trial measured elsewhere, or at another time."""
    if name == "minutes":
        started = datetime.fromisoformat(one.observed.info.started_utc)
        midnight = BEGAN.replace(hour=0) + timedelta(days=(started - BEGAN).days)
        minutes = (started - midnight).total_seconds() / 60.0
        moved = midnight + timedelta(minutes=float(change(np.array(minutes))))
        info = replace(one.observed.info, started_utc=moved.isoformat())
        return replace(one, observed=replace(one.observed, info=info))
    rows, stretches = one.observed.rows, one.stretches
    of_rows: dict[str, Any] = {name: change(getattr(rows, name))}
    of_stretches: dict[str, Any] = {name: change(getattr(stretches, name))}
    return replace(
        one,
        observed=replace(one.observed, rows=replace(rows, **of_rows)),
        stretches=replace(stretches, **of_stretches),
    )


def changed(
    evidence: Sequence[TrialEvidence], name: str, change: Change
) -> list[TrialEvidence]:
    return [with_column(one, name, change) for one in evidence]


def shuffled(
    evidence: Sequence[TrialEvidence], name: str, rng: np.random.Generator
) -> list[TrialEvidence]:
    """Return trials with a covariate as it was in others of the same person."""
    if name == "direction":  # varies within a trial: half of them are turned round
        turn = FLIPS[name]
        return [with_column(one, name, turn) if rng.random() < 0.5 else one for one in evidence]
    found = []
    for person in sorted({one.observed.info.participant for one in evidence}):
        own = [one for one in evidence if one.observed.info.participant == person]
        found += [
            _as_in(one, own[k], name)
            for one, k in zip(own, rng.permutation(len(own)), strict=True)
        ]
    return found


def _as_in(one: TrialEvidence, other: TrialEvidence, name: str) -> TrialEvidence:
    """Return a trial with the forces, or the time, of another."""
    info, given = one.observed.info, other.observed.info
    if name == "minutes":
        info = replace(info, started_utc=given.started_utc)
        return replace(one, observed=replace(one.observed, info=info))
    info = replace(info, force_n=given.force_n)
    rows = replace(one.observed.rows, normal_force_n=other.observed.rows.normal_force_n)
    stretches = replace(one.stretches, normal_force_n=other.stretches.normal_force_n)
    return replace(
        one, observed=replace(one.observed, info=info, rows=rows), stretches=stretches
    )


FLIPS: dict[str, Change] = {
    "direction": lambda direction: -direction,
    "normal_force_n": lambda force: 0.4**2 / force,
    "minutes": lambda minutes: 1000.0 - minutes,
}


def test_a_covariate_is_shuffled_and_turned_round(rng: np.random.Generator) -> None:
    name, cause, size = BY_COVARIATE[int(rng.integers(len(BY_COVARIATE)))]
    evidence = made(rng, [(cause, size)])
    found = found_in(evidence)
    (dose,) = size.values()
    assert dose_in(found, cause) == pytest.approx(dose, rel=0.25)
    turned = found_in(changed(evidence, name, FLIPS[name]))
    assert dose_in(turned, cause) == pytest.approx(-dose_in(found, cause), rel=0.05)
    # By chance one shuffle in twenty may name it; not each of three.
    others = (found_in(shuffled(evidence, name, rng)) for _ in range(3))
    assert any(cause not in suspected(other) for other in others)


def test_names_of_people_and_order_of_trials_say_nothing(rng: np.random.Generator) -> None:
    evidence = made(rng, [("direction_asymmetry", {"share": 0.06})])
    people = sorted({one.observed.info.participant for one in evidence})
    other = dict(zip(people, rng.permutation(people), strict=True))
    again = []
    for k in rng.permutation(len(evidence)):
        observed = evidence[k].observed
        info = replace(observed.info, participant=str(other[observed.info.participant]))
        again.append(replace(evidence[k], observed=replace(observed, info=info)))
    first, second = found_in(evidence), found_in(again)
    assert second.verdict == first.verdict
    assert named(second) == named(first)
    assert "direction_asymmetry" in named(first)
    assert dose_in(second, "direction_asymmetry") == pytest.approx(
        dose_in(first, "direction_asymmetry"), rel=1e-6
    )
    assert [test.p_value for test in second.tests] == [test.p_value for test in first.tests]


def test_half_the_dose_is_half_the_size(rng: np.random.Generator) -> None:
    seed, name = int(rng.integers(2**32)), "residual_quadratic"
    whole, half = (
        dose_in(found_in(made(np.random.default_rng(seed), [(name, {"share": share})])), name)
        for share in (0.016, 0.008)
    )
    assert whole - half == pytest.approx(0.008, rel=0.1)  # the same noise in both


UNITS: list[tuple[str, str, dict[str, float], float]] = [
    ("minutes", "gain_drift", {"per_minute": 0.06}, 60.0),
    ("position_mm", "position_dependent_gain", {"per_mm": 0.005}, 0.1),
]


def test_units_do_not_change_the_verdict(rng: np.random.Generator) -> None:
    name, cause, size, times = UNITS[int(rng.integers(len(UNITS)))]
    zero = MIDDLE_MM if name == "position_mm" else 0.0
    evidence = made(rng, [(cause, size)])
    first = found_in(evidence)
    stretched = changed(evidence, name, lambda x: zero + times * (x - zero))
    second = found_in(stretched)
    assert (second.verdict, named(second)) == (first.verdict, named(first))
    assert times * dose_in(second, cause) == pytest.approx(dose_in(first, cause), rel=0.05)


ALONE: list[tuple[str, dict[str, float]]] = [
    ("cutoff_drift", {"per_minute": 0.06}),
    ("position_dependent_gain", {"per_mm": 0.005}),
    ("residual_quadratic", {"share": 0.0096}),
    ("mains_interference", {"amplitude_n": 0.004}),
]


def test_without_its_cause_an_effect_is_unexplained(
    rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    cause, size = ALONE[int(rng.integers(len(ALONE)))]

    def others(*asked: object) -> list[Candidate]:
        return [one for one in candidates_of("friction") if one.effect != cause]

    monkeypatch.setattr(engine, "candidates_of", others)
    found = found_in(made(rng, [(cause, size)]))
    assert found.verdict in ("unexplained", "partly_explained")
    assert found.unexplained
    assert cause not in {test.id for test in found.tests}
