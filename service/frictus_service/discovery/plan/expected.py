"""The units that a programme will give, as far as they can be told before."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from frictus_service.discovery.evidence.evidence_rows import subjects_of
from frictus_service.discovery.evidence.observation_table import LEAST_UNITS, blocks_of, dealt
from frictus_service.discovery.evidence.residuals import Layout
from frictus_service.discovery.inference.covariance import Whitening
from frictus_service.discovery.inference.linear_model import Unit
from frictus_service.discovery.inference.linearisation import linearise
from frictus_service.discovery.plan.assumptions import Assumptions
from frictus_service.discovery.plan.programme import PlannedTrial, Programme
from frictus_service.discovery.plan.rows import rows_of_trials, strength
from frictus_service.discovery.plan.setup import Setup
from frictus_service.discovery.problem.nuisance import NUISANCE
from frictus_service.discovery.problem.problem import DiscoveryProblem, UnwhitenedUnit


def units_of_people(programme: Programme) -> list[tuple[PlannedTrial, ...]]:
    """Return the trials of each unit: people, or where there are too few, blocks of trials.

    Parameters
    ----------
    programme : Programme
        All trials of everybody, in order.
    """
    people = list(programme.people)
    if programme.participants >= LEAST_UNITS:
        return people
    blocks = blocks_of([sum(bool(trial.tones_hz) for trial in trials) for trials in people])
    if not any(blocks):
        return people
    units = []
    for trials, count in zip(people, blocks, strict=True):
        if count:
            block = dealt([trial.tones_hz for trial in trials], count)
            units += [
                tuple(trial for trial, of in zip(trials, block, strict=True) if of == k)
                for k in range(count)
            ]
    return units


def expected(
    programme: Programme,
    setup: Setup,
    assumptions: Assumptions,
    rng: np.random.Generator | None,
) -> tuple[Unit, ...]:
    """Return the units of those who stand in a programme; all readings are zero.

    Parameters
    ----------
    programme : Programme
        All trials of everybody, in order.
    setup : Setup
        Base model, rig and candidates.
    assumptions : Assumptions
        How readings scatter and people differ.
    rng : numpy.random.Generator or None
        Of how fingers wander about their targets; None: they do not.

    Raises
    ------
    DesignError
        If no tone of any trial can be measured.
    """
    trials = units_of_people(programme)
    rows = rows_of_trials(trials, programme.span_mm, setup, assumptions, rng)

    def known(layouts: Sequence[Layout], raws: Sequence[UnwhitenedUnit]) -> list[Whitening]:
        return [
            Whitening.of(
                raw,
                1.0 / assumptions.scatters(layout, rows.tones_hz, strength(own)),
                assumptions.deviation,
            )
            for layout, raw, own in zip(layouts, raws, trials, strict=True)
        ]

    subjects = subjects_of(rows, len(trials))
    problem = DiscoveryProblem(
        setup.base,
        setup.nominal_mount,
        setup.response,
        tuple(subjects),
        setup.candidates,
        (),
    )
    # What the base predicts is what will be measured: the units stand about it as they are.
    own = np.zeros(len(NUISANCE[setup.response]))
    met = [
        replace(each, measured=problem.predicted(each, own, (), np.zeros(0)))
        for each in subjects
    ]
    return linearise(replace(problem, subjects=tuple(met)), (), whiten=known).units
