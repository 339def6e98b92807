"""The fit comes to rest, and says where a second solution explains the data alike."""

from dataclasses import replace

import numpy as np
import pytest
from tests.service.identification.observed import Bench, Finger, observations

from frictus_service.identification.documents import Settings
from frictus_service.identification.fit import joint_fit
from frictus_service.identification.fit.conditions import ObservationTable
from frictus_service.identification.fit.estimates import Fitted, Measured, friction_of
from frictus_service.identification.fit.joint_fit import ALIKE, Solution
from frictus_service.identification.fit.normal_equations import JointFitProblem
from frictus_service.identification.fit.transfer_functions import (
    CUTOFF,
    HIGHEST,
    LOWEST,
    first_order,
)
from frictus_service.identification.report.results import estimates_of, participants_of

# What phases say is worth far more than what sizes say, as on the simulated rig.
CLEAN = Bench(
    speeds=(20.0, 60.0, 100.0), forces=(0.4,), seconds=1.5, speed_wander=0.0, noise=1e-4
)


def seen(rng: np.random.Generator, bench: Bench = CLEAN) -> tuple[ObservationTable, Measured]:
    fingers = [Finger(delay_s=1e-4), Finger(gain_n=0.6, delay_s=5e-5)]
    table = ObservationTable.of(observations(fingers, bench, rng))
    return table, Measured.of(table)


def friction(table: ObservationTable, measured: Measured) -> Fitted:
    fitted = friction_of(table, measured, Settings())
    assert fitted is not None
    return fitted


def test_a_fit_that_begins_where_it_ended_stays_there(rng: np.random.Generator) -> None:
    """Weights and parameters have settled together: neither waits for the other."""
    table, measured = seen(rng)
    fitted = friction(table, measured)
    sample = fitted.selection.sample
    problem = JointFitProblem(sample, first_order, LOWEST, HIGHEST)
    first = joint_fit.fit(problem, fitted.fit.log_parameters, fitted.fit.delay_s)
    far = joint_fit.fit(problem, fitted.fit.log_parameters + 0.3, first.delay_s + 1e-4)
    assert first.settled.all()
    np.testing.assert_allclose(far.log_parameters, first.log_parameters, atol=1e-4)
    np.testing.assert_allclose(far.delay_s, first.delay_s, atol=1e-8)
    known = joint_fit.fit(problem, first.log_parameters, first.delay_s, first.spreads)
    np.testing.assert_allclose(known.log_parameters, first.log_parameters, atol=1e-4)


@pytest.mark.long
def test_intervals_of_few_tones_hold(rng: np.random.Generator) -> None:
    """Two or three of five tones tell nearly all of the delay, and the fit goes through them.

    What they pull said half of the delay's error, and four of five intervals held the cutoff.
    """
    bench = replace(CLEAN, tones_hz=(40.0, 80.0, 150.0, 250.0, 400.0), noise=4e-3)
    held = []
    for _ in range(40):
        finger = Finger(cutoff_0_hz=rng.uniform(150.0, 600.0), delay_s=1e-4)
        table = ObservationTable.of(observations([finger], bench, rng))
        measured = Measured.of(table)
        fitted = friction(table, measured)
        estimates = estimates_of(fitted.fit, fitted.selection.sample.people)
        truth = finger.cutoff_0_hz + finger.slope * measured.speed_mm_s[fitted.selection.groups]
        for each, cutoff_hz, settled in zip(estimates, truth, fitted.fit.settled, strict=True):
            interval = each[CUTOFF].ci95
            assert interval is not None
            if settled:
                held.append(interval[0] <= cutoff_hz <= interval[1])
    assert len(held) > 100
    assert np.mean(held) > 0.9


def test_speeds_beyond_the_law_do_not_lead(rng: np.random.Generator) -> None:
    """Half of a trial at either end of the law is beyond it: it was off by half and more."""
    fingers = [
        Finger(cutoff_0_hz=rng.uniform(330.0, 450.0), delay_s=1e-4, law_mm_s=(20.0, 100.0))
        for _ in range(4)
    ]
    bench = replace(CLEAN, seconds=10.0, speed_wander=0.05, trial_gain=0.05, segment_gain=0.0)
    table = ObservationTable.of(observations(fingers, bench, rng))
    measured = Measured.of(table)
    fit = friction(table, measured).fit
    truth = np.array([fingers[p].cutoff_0_hz for p in measured.person])
    truth = truth + fingers[0].slope * np.clip(measured.speed_mm_s, 20.0, 100.0)
    np.testing.assert_allclose(np.exp(fit.log_parameters[:, 1]), truth, rtol=0.04)


def test_one_solution_has_no_rival(rng: np.random.Generator) -> None:
    fitted = friction(*seen(rng))
    assert fitted.fit.rival_deficit == np.inf
    assert not fitted.fit.rival_shift.any()


@pytest.mark.parametrize(("deficit", "told"), [(0.9 * ALIKE, True), (1.1 * ALIKE, False)])
def test_a_second_solution_as_likely_is_in_the_interval(
    deficit: float, told: bool, rng: np.random.Generator
) -> None:
    table, measured = seen(rng, replace(CLEAN, noise=0.004))
    fitted = friction(table, measured)
    fit, people = fitted.fit, fitted.selection.sample.people
    best = Solution(fit.log_parameters, fit.delay_s, fit.settled, fit.spreads, 0.0)
    shift = np.where(people == 0, 0.5, 0.0)[:, np.newaxis] * [0.0, 1.0]
    other = replace(
        best,
        log_parameters=fit.log_parameters + shift,
        delay_s=fit.delay_s + np.array([4e-5, 0.0]),
        log_likelihood=-deficit,
    )
    rivalled = joint_fit.with_rival(fit, best, other, people)
    nowhere = {
        name: np.zeros(measured.person.size, dtype=np.bool_) for name in ("gain", "cutoff")
    }
    found = participants_of(
        table,
        measured,
        {"friction": replace(fitted, fit=rivalled), "mobility": None},
        nowhere,  # type: ignore[arg-type]
    )
    assert rivalled.rival_deficit == (deficit if told else np.inf)
    for person, has_rival in zip(found, (told, False), strict=True):
        assert person.friction is not None
        assert (person.friction.second_solution is not None) == has_rival
        for _, cutoff in person.friction.cutoff_at:
            assert cutoff.ci95 is not None
            assert (cutoff.ci95[1] > cutoff.value * np.exp(0.5)) == has_rival
