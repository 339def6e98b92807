"""One study, read and reduced by whatever process has it; results are kept by content.

A process holds the evidence of one study at a time. What it finds is kept in a folder under the
hash of the study's content, of the base model, of the causes beside which it was taken, and of
the source of all that takes part: a run that was broken off goes on where it was.
"""

import hashlib
import json
import secrets
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib import import_module
from pathlib import Path
from typing import Final

from threadpoolctl import threadpool_limits

from frictus.lenient import Exact
from frictus.model import Model
from frictus_service.discovery.across_studies.document import StudyLeftOut, StudyOutcome
from frictus_service.discovery.across_studies.study_statistics import (
    StudyStatistics,
    condense,
    decode,
    encode,
)
from frictus_service.discovery.discover import PosedStudy, criticise, facts_of, pose
from frictus_service.discovery.document import DOCUMENT, REPORT, Discovery
from frictus_service.discovery.evidence.trial_evidence import study_evidence
from frictus_service.discovery.inference.linearisation import linearise
from frictus_service.discovery.inference.units_anew import as_designed
from frictus_service.discovery.problem.base_models import DEVIATING
from frictus_service.discovery.problem.problem import DiscoveryProblem
from frictus_service.discovery.report import page
from frictus_service.errors import ServiceError, StudyError
from frictus_service.identification.pipeline.cache import seal, unsealed
from frictus_service.study.file_state import unchanged

_SOURCES: Final = (
    "frictus_hardware.physics",
    "frictus_service.data_import",
    "frictus_service.discovery",
    "frictus_service.identification",
    "frictus_service.study",
)


@lru_cache(maxsize=1)
def sources_version() -> str:
    """Return the hash of the source of all that turns a study into a result."""
    hashed = hashlib.sha256()
    for package in _SOURCES:
        for file in sorted(Path(import_module(package).__path__[0]).rglob("*.py")):
            hashed.update(file.read_bytes())
    return hashed.hexdigest()


@dataclass(frozen=True, slots=True)
class StudyTask:
    """One study to be reduced; all paths are reached by the process that does it.

    Attributes
    ----------
    path : Path
        The study.
    name : str
        Of the study among the others.
    base : Model
        What is criticised.
    chosen : tuple of int
        Candidates in the model about which it is taken.
    seed : int or None
        Of its own discovery; None: fresh, unless a result is there.
    results, observations : Path
        Folders of what is kept of studies, and of trials.
    report : Path
        Folder of its own discovery's report.
    sources : str
        Of `sources_version`, where the work was asked for.
    """

    path: Path
    name: str
    base: Model
    chosen: tuple[int, ...]
    seed: int | None
    results: Path
    observations: Path
    report: Path
    sources: str


class StudyRecord(Exact):
    """A study's own discovery, and which trials it rests on."""

    discovery: Discovery
    trials: tuple[str, ...]
    """Hashes of the content of all that could be read."""


@dataclass(frozen=True, slots=True)
class StudyResult:
    """One study reduced.

    Attributes
    ----------
    summary : StudyOutcome
        By itself.
    statistics : StudyStatistics
        About the model with the chosen causes.
    trials : tuple of str
        Hashes of what was measured in its trials, whatever their attributes are.
    """

    summary: StudyOutcome
    statistics: StudyStatistics
    trials: tuple[str, ...]


_ONE_STUDY: Final = threading.Lock()
"""A dask worker may have several threads; they would hold a study each."""


def reduce_study(task: StudyTask) -> StudyResult | StudyLeftOut:
    """Reduce one study, or say why it is not used.

    Parameters
    ----------
    task : StudyTask
        The study, the base model, and the causes beside which sizes are taken.
    """
    try:
        with _ONE_STUDY, threadpool_limits(limits=1):
            return _reduced(task)
    except (ServiceError, OSError) as error:
        return StudyLeftOut(path=str(task.path), reason=str(error))
    except Exception as error:  # one file must not cost all other studies
        reason = f"unexpected {type(error).__name__}: {error}; `frictus discover` of it alone, "
        return StudyLeftOut(path=str(task.path), reason=f"{reason}with --debug, shows where")


def _reduced(task: StudyTask) -> StudyResult:
    if sources_version() != task.sources:
        raise StudyError(
            "the worker that had it runs another version of frictus; install the same one"
        )
    with unchanged(task.path):
        facts, mount = facts_of(task.path)
        asked = [facts.sha256, task.sources, task.base.to_json()]
        of_record = _place(task, [*asked, task.seed], "discovery")
        of_statistics = _place(task, [*asked, task.chosen], "statistics")
        kept_record, kept_statistics = unsealed(of_record), unsealed(of_statistics)
        known = kept_record is not None and kept_statistics is not None
        evidence = (
            [] if known else study_evidence(task.path, workers=0, cache=task.observations)
        )
    if kept_record is None or kept_statistics is None:
        posed = pose(evidence, facts, mount, task.base)
        if posed.problem is None:
            raise StudyError(" ".join(("nothing can be tested in it:", *posed.notes)))
        if kept_record is None:
            seen = (one.observed.measured_sha256 for one in evidence)
            hashes = tuple(measured for measured in seen if measured)
            kept_record = _record(task, posed, hashes)
            seal(of_record, kept_record)
        if kept_statistics is None:
            kept_statistics = encode(statistics_of(posed.problem, task.chosen))
            seal(of_statistics, kept_statistics)
    record = StudyRecord.model_validate_json(kept_record)
    _report(task, record.discovery)
    summary = _summary(task, record.discovery)
    return StudyResult(summary, decode(kept_statistics), record.trials)


def _place(task: StudyTask, asked: Sequence[object], kind: str) -> Path:
    text = json.dumps(asked, default=lambda value: bytes(value).decode())
    return task.results / f"{hashlib.sha256(text.encode()).hexdigest()}.{kind}"


def _record(task: StudyTask, posed: PosedStudy, trials: tuple[str, ...]) -> bytes:
    seed = secrets.randbits(32) if task.seed is None else task.seed
    found = criticise(posed, seed=seed)
    return StudyRecord(discovery=found, trials=trials).model_dump_json(by_alias=True).encode()


def _report(task: StudyTask, found: Discovery) -> None:
    """Write the report of a study by itself, unless it is there."""
    kept = task.report / DOCUMENT
    if not (kept.is_file() and kept.read_bytes() == found.to_json()):
        page.write(found, task.report)


def statistics_of(problem: DiscoveryProblem, chosen: Sequence[int]) -> StudyStatistics:
    """Return a study about the model with some causes.

    Parameters
    ----------
    problem : DiscoveryProblem
        Data, base model and candidates.
    chosen : sequence of int
        Candidates.
    """
    model = linearise(problem, (), patterns=())
    if chosen:
        model = linearise(problem, chosen, patterns=(), start=model)
    return StudyStatistics(
        units=tuple(map(condense, model.units)),
        designed=tuple(map(condense, as_designed(problem, model))),
        own=model.own[:, : DEVIATING[problem.response]],
    )


def _summary(task: StudyTask, found: Discovery) -> StudyOutcome:
    study, evidence = found.study, found.evidence
    return StudyOutcome(
        name=task.name,
        path=str(task.path),
        sha256=study.sha256,
        participants=study.participants,
        trials=study.trials,
        trials_used=study.trials_used,
        held_out="blocks" if evidence is None else evidence.held_out,
        verdict=found.verdict,
        causes=tuple(cause.id for cause in found.causes),
        report=(task.report / REPORT).relative_to(task.report.parents[1]).as_posix(),
    )
