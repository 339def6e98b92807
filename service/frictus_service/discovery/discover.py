"""From a study, or from evidence, to what a model gets wrong, why, and the extended model."""

import secrets
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from frictus.model import Model
from frictus_hardware.physics.linear import TransferFunction
from frictus_service.discovery.beyond.beyond import beside_form, look_beyond
from frictus_service.discovery.catalogue.causes import CAUSES
from frictus_service.discovery.decision.caveats import caveats_on
from frictus_service.discovery.decision.decision import decide
from frictus_service.discovery.decision.trial_accounting import trials_left_out, unreadable
from frictus_service.discovery.document import CauseTest, Discovery, StudyFacts
from frictus_service.discovery.evidence.band_noise import resolved
from frictus_service.discovery.evidence.evidence_rows import EvidenceRows, subjects_of
from frictus_service.discovery.evidence.observation_table import (
    LEAST_UNITS,
    UnitAssignment,
    comparable,
    rows_of,
    units_of,
    used,
)
from frictus_service.discovery.evidence.trial_evidence import (
    TrialEvidence,
    judged,
    study_evidence,
)
from frictus_service.discovery.inference.significance import signs
from frictus_service.discovery.one_recording.analysis import rank_recording
from frictus_service.discovery.problem.base_models import ResponseName, base_model, simulator_of
from frictus_service.discovery.problem.candidates import candidates_of, patterns_of
from frictus_service.discovery.problem.problem import DiscoveryProblem
from frictus_service.discovery.report.assembly import Assembly
from frictus_service.identification.plausibility.finding import leave_out, stop_if_implausible
from frictus_service.identification.plausibility.judge import judge_study
from frictus_service.study.file_state import unchanged
from frictus_service.study.importers import open_study


@dataclass(frozen=True, slots=True)
class PosedStudy:
    """A study as the question that a discovery asks.

    Attributes
    ----------
    facts : StudyFacts
        With the trials that are used, and why others are not.
    base : Model
        What is criticised.
    units : UnitAssignment
        Which trial belongs to which unit.
    notes : tuple of str
        What a reader must know first.
    rows : EvidenceRows or None
        None where there are too few people and trials for a test, as is the problem.
    problem : DiscoveryProblem or None
        Data, base model and candidates.
    """

    facts: StudyFacts
    base: Model
    units: UnitAssignment
    notes: tuple[str, ...]
    rows: EvidenceRows | None = None
    problem: DiscoveryProblem | None = None


def pose(
    evidence: Sequence[TrialEvidence],
    study: StudyFacts,
    mount: TransferFunction | None,
    base: Model,
) -> PosedStudy:
    """Return the regression problem of a study, from the evidence that can be used.

    Parameters
    ----------
    evidence, study, mount, base
        As for `discover`.

    Raises
    ------
    ImplausibleStudyError
        If a sign, a unit or an axis is wrong, so that every fit would be nonsense.
    """
    response: ResponseName = base.response
    findings = judge_study(judged(evidence), response)
    stop_if_implausible(findings, study.path)
    observed = leave_out((one.observed for one in evidence), findings)
    evidence = [
        replace(one, observed=each) for one, each in zip(evidence, observed, strict=True)
    ]
    evidence = resolved(evidence, response)
    usable = used(evidence)
    trials = comparable(usable, response)
    units = units_of(trials, response)
    told = (
        *(
            f"{one.trials} of {study.trials} trials cannot be read: {one.reason}."
            for one in study.left_out
        ),
        *(f"{finding.text}." for finding in findings),
        *caveats_on(evidence, usable, trials, units, response),
    )
    left_out = (*study.left_out, *trials_left_out(evidence, usable, trials, response))
    left_out = tuple(sorted(left_out, key=lambda one: -one.trials))
    study = study.model_copy(update={"trials_used": len(trials), "left_out": left_out})
    if len(units.names) < LEAST_UNITS:
        return PosedStudy(study, base, units, told)
    rows = rows_of(trials, units, response)
    problem = DiscoveryProblem(
        simulator_of(base, mount),
        mount,
        response,
        tuple(subjects_of(rows, len(units.names))),
        tuple(candidates_of(response, [effect.id for effect in base.effects])),
        tuple(patterns_of(rows.tones_hz.size, skin=response == "mobility")),
        base.validity.speed_mm_s,
        people=units.held_out == "participants",
    )
    return PosedStudy(study, base, units, told, rows, problem)


def discover(
    evidence: Sequence[TrialEvidence],
    study: StudyFacts,
    mount: TransferFunction | None,
    base: Model,
    *,
    seed: int = 0,
) -> Discovery:
    """Criticise a base model, name causes, extend it, and measure the gain.

    Parameters
    ----------
    evidence : sequence of TrialEvidence
        Of a whole study, in any order.
    study : StudyFacts
        Its path, hash, participants, trials, and why some of them cannot be read.
    mount : TransferFunction or None
        The study's.
    base : Model
        What is criticised; everybody's own gain and cutoff (mass, damping and stiffness of the
        skin) are fitted in any case.
    seed : int
        Of random sign flips, where there are too many units to try all.

    Raises
    ------
    ImplausibleStudyError
        If a sign, a unit or an axis is wrong, so that every fit would be nonsense.
    """
    return criticise(pose(evidence, study, mount, base), seed=seed)


def criticise(posed: PosedStudy, *, seed: int = 0) -> Discovery:
    """Return what a discovery finds in a study that was posed.

    Parameters
    ----------
    posed : PosedStudy
        From `pose`.
    seed : int
        As for `discover`.
    """
    problem, rows, units = posed.problem, posed.rows, posed.units
    if problem is None or rows is None:
        return nothing_tested(posed.facts, posed.base, seed, posed.notes)
    flips = signs(len(units.names), np.random.default_rng(seed))
    # Matrices are small: threads would wait for each other longer than they work.
    with threadpool_limits(limits=1):
        first = decide(problem, flips)
        problem = first.problem
        beyond = look_beyond(problem, first, flips)
        found = first
        if beyond.form is not None:
            found = beside_form(beyond, first, decide(beyond.problem, flips))
        return Assembly(
            problem,
            units,
            rows,
            first,
            found,
            beyond,
            flips,
            posed.base,
            posed.facts,
            seed,
            posed.notes,
        ).document()


def discover_study(
    path: Path | str,
    *,
    response: ResponseName = "friction",
    base: str = "paper",
    seed: int | None = None,
    workers: int | None = None,
    cache: Path | str | None = None,
    cluster: str | None = None,
    tell: Callable[[str], None] | None = None,
) -> Discovery:
    """Return what a base model gets wrong in a study, and why.

    Parameters
    ----------
    path : Path or str
        A study file.
    response : {'friction', 'mobility'}
    base : str
        ``paper``, ``constant-cutoff`` or the path of a model.
    seed : int or None
        Of everything random; None: a fresh one, which the document holds.
    workers, cache, cluster, tell
        As for `identification.pipeline.study.observe_study`.

    Raises
    ------
    BaseModelError
        If there is no such base model.
    StudyError
        If the study cannot be read, changes meanwhile, or is implausible as for `discover`.
    """
    tell = tell or (lambda line: None)
    seed = secrets.randbits(32) if seed is None else seed
    criticised = base_model(base, response)
    with unchanged(path):
        facts, mount = facts_of(path)
        evidence = study_evidence(
            path, workers=workers, cache=cache, cluster=cluster, tell=tell
        )
        tell("criticising the base model")
        found = discover(evidence, facts, mount, criticised, seed=seed)
        if found.verdict is not None:
            return found
        late_s = max(
            (one.statistics.positions_earlier_s for one in judged(evidence)), default=0.0
        )
        recording, notes = rank_recording(path, criticised, tell, late_s)
    more = {"one_recording": recording, "notes": (*found.notes, *notes)}
    return found.model_copy(update=more)


def facts_of(path: Path | str) -> tuple[StudyFacts, TransferFunction | None]:
    """Return what a document says of a study before its trials are read, and its mount.

    Raises
    ------
    StudyError
        If the study cannot be read.
    """
    with open_study(path) as study:
        mount, trials, sha256 = study.info.mount, study.trials, study.sha256
        excluded, simulated = study.excluded, study.info.simulated
    facts = StudyFacts(
        path=str(path),
        sha256=sha256,
        simulated=simulated,
        participants=len({trial.participant for trial in trials}),
        trials=len(trials) + len(excluded),
        trials_used=0,
        left_out=unreadable(excluded),
    )
    return facts, mount


def nothing_tested(
    study: StudyFacts, base: Model, seed: int, notes: tuple[str, ...]
) -> Discovery:
    """Return the document where nothing could be tested."""
    return Discovery(
        code_version=version("frictus"),
        seed=seed,
        study=study,
        response=base.response,
        base_model=base,
        extended_model=base,
        verdict=None,
        causes=(),
        cannot_tell=(),
        unexplained=(),
        explained_share=None,
        gain=None,
        tests=tuple(
            CauseTest(id=name, not_tested="too few participants and trials")
            for name, cause in CAUSES.items()
            if cause.response in (base.response, "both")
        ),
        notes=notes,
    )
