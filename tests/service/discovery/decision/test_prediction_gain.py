"""Gains are those of units that did not set the size: nothing gains nothing."""

import numpy as np
import pytest
from tests.service.discovery.made import MOUNT, PAPER, Design, made

from frictus_service.discovery.decision.prediction_gain import (
    DB,
    find_unexplained,
    gain_of,
    held_out,
    rms_of,
    unseen,
)
from frictus_service.discovery.evidence.evidence_rows import subjects_of
from frictus_service.discovery.evidence.observation_table import rows_of, units_of, used
from frictus_service.discovery.evidence.residuals import Compared
from frictus_service.discovery.inference.joint_gain import joint_gain
from frictus_service.discovery.inference.linear_model import (
    Unit,
    held_out_gain,
    project_out,
)
from frictus_service.discovery.inference.linearisation import Linearised, linearise
from frictus_service.discovery.inference.predictive_density import UnitCoefficients
from frictus_service.discovery.inference.significance import signs
from frictus_service.discovery.problem.candidates import Pattern, candidates_of
from frictus_service.discovery.problem.problem import DiscoveryProblem

SHARE = 0.06
CANDIDATES = tuple(candidates_of("friction"))
ASYMMETRY = [one.effect for one in CANDIDATES].index("direction_asymmetry")


def ground_of(
    rng: np.random.Generator, share: float, design: Design | None = None
) -> DiscoveryProblem:
    effects = [("direction_asymmetry", {"share": share})]
    trials = used(made(rng, effects, design or Design()))
    units = units_of(trials, "friction")
    subjects = tuple(subjects_of(rows_of(trials, units, "friction"), len(units.names)))
    return DiscoveryProblem(PAPER, MOUNT, "friction", subjects, CANDIDATES, ())


@pytest.mark.long
def test_nothing_gains_nothing(rng: np.random.Generator) -> None:
    """On average a size that others set costs half a nat among eight, and never gains."""
    gains = []
    for _ in range(4):
        units = linearise(ground_of(rng, 0.0), ()).units
        total = held_out_gain(project_out(units)).sum(axis=0)
        gains.append(total[total != 0.0])
    assert np.median(np.concatenate(gains)) < 0.5
    assert np.mean(np.concatenate(gains) > 0.0) < 0.6


def test_an_effect_gains_and_its_residual_shrinks(rng: np.random.Generator) -> None:
    problem = ground_of(rng, SHARE)
    before, after = linearise(problem, ()), linearise(problem, (ASYMMETRY,))
    assert after.coefficients.mean() == pytest.approx(SHARE, abs=0.003)
    per_unit = held_out_gain(project_out(after.units))[:, ASYMMETRY]
    assert np.all(per_unit > 0.0)
    named = UnitCoefficients.of(after.units, [ASYMMETRY])
    gain = gain_of(problem, named, (before, ()), (after, (ASYMMETRY,)), rng)
    assert gain.heldout_loglik == pytest.approx(named.held_out.sum())
    assert gain.heldout_loglik < per_unit.sum()  # each model with the scatter that it leaves
    assert gain.ci95 is not None
    assert 0.0 < gain.ci95[0] < gain.heldout_loglik < gain.ci95[1]
    less, more = gain.residual_db
    # The asymmetry adds to what is there anyway, as squares do.
    assert np.sqrt(less**2 - more**2) == pytest.approx(DB * SHARE, rel=0.15)


def test_who_says_nothing_is_not_counted_in_the_interval() -> None:
    problem = ground_of(np.random.default_rng(1), SHARE)
    model = linearise(problem, (ASYMMETRY,))
    named = UnitCoefficients.of(model.units, [ASYMMETRY])
    silent = UnitCoefficients(
        np.vstack([named.value, np.full((8, 1), np.nan)]),
        np.vstack([named.noise, np.zeros((8, 1, 1))]),
    )
    models = ((model, ()), (model, (ASYMMETRY,)))
    one, other = (
        gain_of(problem, found, *models, np.random.default_rng(2)) for found in (named, silent)
    )
    assert other.heldout_loglik == pytest.approx(one.heldout_loglik)
    assert other.ci95 == pytest.approx(one.ci95)


def test_held_out_sizes_are_those_of_others(rng: np.random.Generator) -> None:
    """One person without the effect is predicted with it, and not the other way round."""
    problem = ground_of(rng, SHARE)
    model = linearise(problem, (ASYMMETRY,))
    rests = held_out(problem, model, (ASYMMETRY,))
    others = project_out(model.units).estimates[:, ASYMMETRY]
    for place, (rest, subject) in enumerate(zip(rests, problem.subjects, strict=True)):
        size = float(np.delete(others, place).mean())
        own = problem.rest(subject, model.own[place], (ASYMMETRY,), np.array([size]))
        # Gain and cutoff are fitted beside that size, which tells no direction from another.
        moved = rest.size - own.size
        forth = subject.rows.circumstances.direction > 0.0
        assert abs(moved[forth].mean() - moved[~forth].mean()) < 1e-3
        assert np.all(np.abs(moved) < 0.1)


def of_two(rng: np.random.Generator) -> tuple[tuple[Unit, ...], list[int]]:
    """Return the units about a model of two effects that look alike, and the two."""
    names = [one.effect for one in CANDIDATES]
    pair = [names.index(name) for name in ("channel_delay", "fractional_rolloff")]
    delay, rolloff = {"delay_s": 2e-5}, {"excess_order": 0.1}
    trials = used(made(rng, [("channel_delay", delay), ("fractional_rolloff", rolloff)]))
    subjects = subjects_of(rows_of(trials, units_of(trials, "friction"), "friction"), 8)
    problem = DiscoveryProblem(PAPER, MOUNT, "friction", tuple(subjects), CANDIDATES, ())
    return linearise(problem, pair).units, pair


def test_the_gain_of_one_effect_is_its_own(rng: np.random.Generator) -> None:
    units = linearise(ground_of(rng, SHARE), (ASYMMETRY,)).units
    alone = held_out_gain(project_out(units))[:, ASYMMETRY]
    np.testing.assert_allclose(joint_gain(units, [ASYMMETRY]), alone, rtol=1e-6)
    assert not joint_gain(units, []).any()


def test_gains_together_know_no_order(rng: np.random.Generator) -> None:
    """Nor do they add up, where signatures are alike."""
    units, pair = of_two(rng)
    together = joint_gain(units, pair)
    np.testing.assert_allclose(joint_gain(units, pair[::-1]), together, rtol=1e-6)
    each = [
        held_out_gain(project_out(units, pair[1 - k : 2 - k]))[:, pair[k]].sum() for k in (0, 1)
    ]
    assert together.sum() > max(each)
    assert sum(each) != pytest.approx(together.sum(), rel=0.02)


def test_rms_is_of_all_rows(rng: np.random.Generator) -> None:
    zeros = Compared.zeros(4, 1)
    size = np.array([0.1, -0.1, 0.1, -0.1])
    one = Compared(size, 2.0 * size, *(getattr(zeros, n) for n in NAMES))
    db, degrees = rms_of([one, one])
    assert db == pytest.approx(0.1 * 20.0 / np.log(10.0))
    assert degrees == pytest.approx(np.degrees(0.2))


NAMES = ("second", "third", "line50", "line60", "low")


def test_who_does_not_know_a_pattern_leaves_its_size_known(rng: np.random.Generator) -> None:
    columns = rng.standard_normal((9, 60, 1))
    columns[-1] = 0.0
    units = [
        Unit(
            readings=2.0 * own[:, 0] + rng.standard_normal(60),
            own=own[:, :0],
            effects=own,
            generic=own[:, :0],
            accuracy=np.zeros(1),
            generic_accuracy=np.zeros(0),
            positive=np.zeros(1, dtype=np.bool_),
            squared=np.zeros(1, dtype=np.bool_),
        )
        for own in columns
    ]
    hum = (Pattern("line50", (), "none"),)
    problem = DiscoveryProblem(PAPER, MOUNT, "friction", (), (), hum)
    nothing = np.zeros((len(units), 0))
    model = Linearised((), nothing, (), nothing, ())
    (found,) = find_unexplained(problem, model, units, signs(len(units), rng))
    assert found.mean == pytest.approx(2.0, rel=0.15)


def test_unseen_conditions_are_the_middle_ones(rng: np.random.Generator) -> None:
    design = Design(speeds_mm_s=(20.0, 50.0, 100.0), forces_n=(0.2, 0.4))
    (found,) = unseen(ground_of(rng, SHARE, design), (ASYMMETRY,))
    assert (found.covariate, found.level) == ("speed", 50.0)
    assert found.residual_db[1] < found.residual_db[0]
