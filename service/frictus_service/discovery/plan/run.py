"""A plan from a file: a study that was run, or a design."""

import secrets
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from frictus_hardware.physics.linear import Mount, TransferFunction
from frictus_service.discovery.evidence.band_noise import resolved
from frictus_service.discovery.evidence.evidence_rows import EvidenceRows, subjects_of
from frictus_service.discovery.evidence.observation_table import (
    comparable,
    rows_of,
    units_of,
    used,
)
from frictus_service.discovery.evidence.trial_evidence import TrialEvidence, study_evidence
from frictus_service.discovery.plan.assumptions import Assumptions, assumed, estimated
from frictus_service.discovery.plan.documents import Plan, Setup, read_design, wanted_sizes
from frictus_service.discovery.plan.plan import plan
from frictus_service.discovery.plan.programme import PlannedTrial, Programme, programme_of
from frictus_service.discovery.plan.rows import strength
from frictus_service.discovery.problem.base_models import ResponseName, base_model, simulator_of
from frictus_service.discovery.problem.candidates import candidates_of
from frictus_service.discovery.problem.problem import DiscoveryProblem
from frictus_service.errors import DesignError
from frictus_service.study.importers import open_study

ORDINARY_S = 20.0
"""From trial to trial, where a study does not say."""


def plan_file(
    path: Path,
    *,
    response: ResponseName = "friction",
    base: str = "paper",
    wanted: Mapping[str, float] | None = None,
    seed: int | None = None,
    workers: int | None = None,
    cache: Path | None = None,
    tell: Callable[[str], None] | None = None,
) -> Plan:
    """Return what a design, or the design of a study, shows.

    Parameters
    ----------
    path : Path
        A `design/1` file, ending in .json, or a study.
    response : {'friction', 'mobility'}
    base : str
        As for `frictus discover`.
    wanted : mapping of str to float or None
        Sizes that shall be shown, by effect; others are the usual ones.
    seed : int or None
        None: a fresh one, which the document holds.
    workers, cache, tell
        As for `identification.pipeline.study.observe_study`.

    Raises
    ------
    DesignError
        If the design cannot be used, or a wanted size.
    BaseModelError
        If there is no such base model.
    StudyError
        If the study cannot be read.
    """
    tell = tell or (lambda line: None)
    seed = secrets.randbits(32) if seed is None else seed
    model = base_model(base, response)
    sizes = wanted_sizes(wanted or {})
    candidates = tuple(candidates_of(response, [effect.id for effect in model.effects]))

    def setup(mount: TransferFunction | None, carrier_hz: float = 7000.0) -> Setup:
        return Setup(simulator_of(model, mount), mount, response, candidates, carrier_hz)

    if path.suffix == ".json":
        design = read_design(path)
        programme = programme_of(design, np.random.default_rng(seed))
        known, assumptions = setup(Mount().lateral), assumed(response, candidates)
    else:
        with open_study(path) as study:
            known = setup(study.info.mount, study.info.carrier_hz)
            lengths = {
                info.id: study.n_samples(info.id) / info.sample_rate_hz for info in study.trials
            }
        evidence = study_evidence(path, workers=workers, cache=cache, tell=tell)
        trials = used(resolved(evidence, response))
        tell("how its readings scatter")
        programme, assumptions = of_study(trials, lengths, known)
    # Matrices are small: threads would wait for each other longer than they work.
    with threadpool_limits(limits=1):
        return plan(programme, known, assumptions, sizes, str(path), seed=seed, tell=tell)


def of_study(
    trials: Sequence[TrialEvidence], seconds: Mapping[str, float], setup: Setup
) -> tuple[Programme, Assumptions]:
    """Return the trials of a study, and how its readings scatter and its people differ.

    Parameters
    ----------
    trials : sequence of TrialEvidence
        From `table.used`; those of people of whom they say too little are left out.
    seconds : mapping of str to float
        Length of each trial, by id.
    setup : Setup

    Raises
    ------
    DesignError
        If no trial can be used, or those that can say no tones, or no target.
    """
    if not any(one.observed.info.tones_hz for one in trials):
        raise DesignError(
            "no usable trial of this study says its tones: there is no design to plan with; "
            "accepted: a study of trials with tones, or a design/1 file"
        )
    infos = [one.observed.info for one in trials]
    without = sum(not min(info.speed_mm_s, info.force_n) > 0.0 for info in infos)
    if without:
        raise DesignError(
            f"{without} of {len(trials)} usable trials have no target speed or no target force "
            "(0: none was asked for): there is no design to plan with; accepted: a study with "
            "targets above 0, or a design/1 file"
        )
    trials = comparable(trials, setup.response)
    units = units_of(trials, setup.response)
    rows = rows_of(trials, units, setup.response)
    programme = _programme(trials, seconds, rows)
    problem = DiscoveryProblem(
        setup.base,
        setup.nominal_mount,
        setup.response,
        tuple(subjects_of(rows, len(units.names))),
        setup.candidates,
        (),
        people=units.held_out == "participants",
    )
    with threadpool_limits(limits=1):
        return programme, estimated(problem, rows, strength(programme.trials))


def _programme(
    trials: Sequence[TrialEvidence], seconds: Mapping[str, float], rows: EvidenceRows
) -> Programme:
    """Return the programme of trials that were run, by participant and time."""
    minutes = rows.trials.circumstances.minutes
    people: dict[str, list[PlannedTrial]] = {}
    for one, at in zip(trials, minutes.tolist(), strict=True):
        info = one.observed.info
        asked = PlannedTrial(
            info.speed_mm_s, info.force_n, info.tones_hz, info.drive_vpp, seconds[info.id], at
        )
        people.setdefault(info.participant, []).append(asked)
    return Programme(
        people=tuple(map(tuple, people.values())),
        participants=len(people),
        span_mm=_span_mm(rows),
        trial_every_s=_every_s(list(people.values())),
        shuffled=False,
        done=True,
    )


def _span_mm(rows: EvidenceRows) -> float:
    """Return the stroke: half as long again as the middles of its outer thirds are apart."""
    position = rows.rows.circumstances.position_mm
    low, high = np.quantile(position, [0.05, 0.95])
    return float(max(1.5 * (high - low), 5.0))


def _every_s(people: Sequence[Sequence[PlannedTrial]]) -> float:
    steps = [
        60.0 * (after.minutes - before.minutes)
        for own in people
        for before, after in pairwise(own)
        if after.minutes > before.minutes
    ]
    return float(np.median(steps)) if steps else ORDINARY_S
