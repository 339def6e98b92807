"""Everything is linear about each person's own."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from tests.service.discovery.made import MOUNT, PAPER, USUAL, Design, made

from frictus_service.discovery.evidence.evidence_rows import subjects_of
from frictus_service.discovery.evidence.observation_table import rows_of, units_of, used
from frictus_service.discovery.evidence.residuals import Layout
from frictus_service.discovery.evidence.trial_evidence import TrialEvidence
from frictus_service.discovery.inference.covariance import Whitening, whiten
from frictus_service.discovery.inference.linear_model import project_out, similarity
from frictus_service.discovery.inference.linearisation import linearise
from frictus_service.discovery.inference.units_anew import as_designed
from frictus_service.discovery.problem.candidates import candidates_of
from frictus_service.discovery.problem.problem import DiscoveryProblem, UnwhitenedUnit

CANDIDATES = tuple(candidates_of("friction"))
NAMES = [candidate.effect for candidate in CANDIDATES]


def people(rng: np.random.Generator, slopes: Sequence[float]) -> list[TrialEvidence]:
    """Return the evidence of people whose cutoffs rise as fast as given, alike at 60 mm/s."""
    alike = replace(USUAL, people=0.0)  # else everybody's slope would be scaled with the cutoff
    found = []
    for number, slope in enumerate(slopes):
        less = 60.0 * (slope - PAPER.law.slope_hz_per_mm_s)
        law = replace(
            PAPER.law, cutoff_0_hz=PAPER.law.cutoff_0_hz - less, slope_hz_per_mm_s=slope
        )
        base, design = replace(PAPER, law=law), Design(participants=1)
        for one in made(rng, base=base, design=design, scatter=alike):
            info = replace(one.observed.info, participant=f"P{number:02}")
            found.append(replace(one, observed=replace(one.observed, info=info)))
    return found


def problem(evidence: Sequence[TrialEvidence]) -> DiscoveryProblem:
    trials = used(evidence)
    units = units_of(trials, "friction")
    subjects = subjects_of(rows_of(trials, units, "friction"), len(units.names))
    return DiscoveryProblem(PAPER, MOUNT, "friction", tuple(subjects), CANDIDATES, ())


def test_own_slopes_do_not_look_like_another_rolloff(rng: np.random.Generator) -> None:
    """About the population's slope, the curvature of everybody's own would be one in all."""
    own = 0.4 * PAPER.law.slope_hz_per_mm_s * np.repeat([-1.0, 1.0], 4)
    here = problem(people(rng, list(PAPER.law.slope_hz_per_mm_s + own)))
    left = project_out(linearise(here, ()).units)
    rolloff = left.estimates[:, NAMES.index("fractional_rolloff")]
    assert abs(rolloff.mean()) < 0.003
    slope = left.estimates[:, NAMES.index("speed_dependent_cutoff")]
    np.testing.assert_allclose(slope, own, atol=2.0)
    np.testing.assert_allclose(slope.reshape(2, 4).mean(axis=1), own[[0, -1]], atol=1.0)


def test_where_a_fit_begins_does_not_matter(rng: np.random.Generator) -> None:
    here = problem(made(rng, [("force_dependent_gain", {"exponent": 0.2})]))
    chosen = [NAMES.index("force_dependent_gain")]
    alone = linearise(here, chosen)
    begun = linearise(here, chosen, start=linearise(here, ()))
    np.testing.assert_allclose(alone.own, begun.own, atol=5e-3)
    np.testing.assert_allclose(alone.coefficients, begun.coefficients, rtol=0.05, atol=5e-3)


def test_the_design_tells_no_drift_from_speeds_in_blocks(rng: np.random.Generator) -> None:
    """Speeds that wander within a trial would; the design is what was asked for."""
    here = problem(made(rng, design=Design(blocked=True)))
    cosines = similarity(as_designed(here, linearise(here, ())))
    drift, speed = (NAMES.index(name) for name in ("gain_drift", "speed_dependent_gain"))
    assert cosines[drift, speed] > 0.9


def test_a_large_effect_leads_no_fit_astray(rng: np.random.Generator) -> None:
    """Whole steps would end where another roll-off and another slope make up for each other."""
    law = [("speed_dependent_cutoff", {"slope_hz_per_mm_s": 9.6})]
    alike = replace(USUAL, people=0.07)  # else somebody's cutoff falls to nothing when slow
    found = linearise(problem(made(rng, law, scatter=alike)), ())
    slope = project_out(found.units).estimates[:, NAMES.index("speed_dependent_cutoff")]
    np.testing.assert_allclose(slope, 9.6, atol=5.0)
    np.testing.assert_allclose(slope.mean(), 9.6, atol=1.0)
    assert np.all(np.abs(found.own[:, :2]) < 0.7)


def test_rounds_that_lead_astray_are_not_followed(rng: np.random.Generator) -> None:
    """As where a cutoff comes near to none: a person goes on, and all scatter more for it."""
    here = problem(made(rng))
    settled = linearise(here, ())
    rounds: list[int] = []

    def drifting(layouts: Sequence[Layout], raws: Sequence[UnwhitenedUnit]) -> list[Whitening]:
        first, *others = whiten(layouts, raws)
        rounds.append(len(rounds))
        if len(rounds) < 3:
            return [first, *others]
        free = np.full(raws[0].random_effects.shape[1], 100.0)  # so that no step looks too far
        farther = Whitening.of(raws[0], 0.5 * first.weight, first.deviation, free)
        on = first.random_coefficients + 0.2 * len(rounds)
        return [replace(farther, random_coefficients=on), *others]

    drifted = linearise(here, (), whiten=drifting)
    np.testing.assert_allclose(drifted.own, settled.own, atol=0.05)


def test_noise_of_the_drive_shows_no_compression(rng: np.random.Generator) -> None:
    """At one depth of modulation it is a gain, and what noise does to both is none of it."""
    evidence = [_of_noisy_drive(one, rng) for one in made(rng, design=Design(repeats=4))]
    of_compression = NAMES.index("amplitude_compression")
    seen = project_out(linearise(problem(evidence), ()).units)
    assert np.all(seen.information[:, of_compression] > 0.0)
    unseen = project_out(
        linearise(problem([_without_third(one) for one in evidence]), ()).units
    )
    assert np.all(unseen.information[:, of_compression] == 0.0)


def _of_noisy_drive(one: TrialEvidence, rng: np.random.Generator) -> TrialEvidence:
    """Return what a trial says where the drive was measured two thousandths off."""
    off = 1.0 + rng.normal(0.0, 2e-3, one.observed.rows.tone_hz.size)
    rows = one.observed.rows
    rows = replace(
        rows, message=rows.message * off, friction_response=rows.friction_response / off
    )
    return replace(one, observed=replace(one.observed, rows=rows))


def _without_third(one: TrialEvidence) -> TrialEvidence:
    third = one.harmonics.third * np.nan
    return replace(one, harmonics=replace(one.harmonics, third=third))
