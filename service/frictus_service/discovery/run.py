"""A discovery from a study file: reading, evidence, analysis."""

import secrets
from collections.abc import Callable
from pathlib import Path

from frictus_service.discovery.discover import discover
from frictus_service.discovery.document import Discovery, StudyFacts
from frictus_service.discovery.evidence.trial_evidence import study_evidence
from frictus_service.discovery.problem.base_models import base_model
from frictus_service.discovery.problem.nuisance import ResponseName
from frictus_service.study.importers import open_study


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
        If the study cannot be read.
    """
    tell = tell or (lambda line: None)
    seed = secrets.randbits(32) if seed is None else seed
    criticised = base_model(base, response)
    with open_study(path) as study:
        mount, trials, sha256 = study.info.mount, study.trials, study.sha256
    facts = StudyFacts(
        path=str(path),
        sha256=sha256,
        participants=len({trial.participant for trial in trials}),
        trials=len(trials),
        trials_used=0,
    )
    evidence = study_evidence(path, workers=workers, cache=cache, cluster=cluster, tell=tell)
    tell("criticising the base model")
    return discover(evidence, facts, mount, criticised, seed=seed)
