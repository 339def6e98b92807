"""The observations of a whole study: trials go through workers, known ones from a cache."""

import os
import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from frictus_service.identification.cache import Cache, state_of
from frictus_service.identification.observation import TrialObservations
from frictus_service.identification.observe import observe
from frictus_service.identification.response import NO_ROWS
from frictus_service.identification.workers import Crash, work_through
from frictus_service.study.digest import duplicates
from frictus_service.study.errors import TrialError
from frictus_service.study.importers import open_study
from frictus_service.study.study import Study
from frictus_service.study.trial import TrialInfo

TRIALS_PER_WORKER: Final = 30
"""A process takes longer to start than so many trials take."""


@dataclass(frozen=True, slots=True)
class Task:
    """One trial to be observed by a process that opens the study itself.

    Attributes
    ----------
    path : Path
        The study, at a place that the process reaches too.
    trial : TrialInfo
    cache : Path or None
        Folder of observations; likewise.
    """

    path: Path
    trial: TrialInfo
    cache: Path | None


def observe_study(
    path: Path | str,
    *,
    workers: int | None = None,
    cache: Path | str | None = None,
    cluster: str | None = None,
    tell: Callable[[str], None] | None = None,
) -> list[TrialObservations]:
    """Return the observations of all trials of a study, in the order of its trials.

    The trials are read by the workers, one at a time each, so that memory does not grow with
    the study. Trials that cannot be read or used, copies of others and trials that kept ending
    their workers are in the list too, not valid, with the reason.

    Parameters
    ----------
    path : Path or str
    workers : int or None
        Processes to spawn; 0 observes in this one. None: one per processor, and none for a few
        trials. Whatever the number, the result is the same.
    cache : Path or str or None
        Folder that keeps observations for the next time; None keeps nothing.
    cluster : str or None
        Address of a `dask.distributed` scheduler, such as ``tcp://host:8786``, whose workers
        are used instead; they must reach study and cache at the same paths.
    tell : callable or None
        Told what happens, a line at a time.

    Raises
    ------
    StudyError
        If the study cannot be read.
    WorkerError
        If worker processes do not start, or fail.
    ClusterError
        If the cluster cannot be used.
    """
    tell = tell or (lambda line: None)
    path = Path(path).resolve()
    kept = None if cache is None else Cache(Path(cache).resolve())
    with open_study(path) as study:
        for left_out in study.excluded:
            tell(f"trial {left_out.trial} is left out: {left_out.field} {left_out.reason}")
        contents = _Contents.of(path, kept)
        found = {trial.id: contents.find(trial, study) for trial in study.trials}
        tasks = [
            Task(path, trial, None if kept is None else kept.folder)
            for trial in study.trials
            if found[trial.id] is None
        ]
        tell(f"{len(found)} trials, {len(found) - len(tasks)} of them known already")
        for count, (task, outcome) in enumerate(_each(study, tasks, workers, cluster, tell), 1):
            found[task.trial.id] = _observed(task.trial, outcome)
            if count * 20 // len(tasks) > (count - 1) * 20 // len(tasks):
                tell(f"{count} of {len(tasks)} trials observed")
    observations = [each for each in found.values() if each is not None]
    if tasks:
        contents.keep(observations)
    return _without_copies(observations)


@dataclass(frozen=True, slots=True)
class _Contents:
    """What is known of a study file before it is read."""

    kept: Cache | None
    state: str
    hashes: dict[str, str]

    @classmethod
    def of(cls, path: Path, kept: Cache | None) -> "_Contents":
        # The time of a folder says nothing about the files in it.
        if kept is None or not path.is_file():
            return cls(None, "", {})
        state = state_of(path)
        return cls(kept, state, kept.contents(state))

    def find(self, trial: TrialInfo, study: Study) -> TrialObservations | None:
        sha256 = self.hashes.get(trial.id)
        if self.kept is None or sha256 is None:
            return None
        return self.kept.find(sha256, trial, study.info)

    def keep(self, observations: Sequence[TrialObservations]) -> None:
        if self.kept is not None:
            hashes = {each.info.id: each.sha256 for each in observations if each.sha256}
            self.kept.keep_contents(self.state, hashes)


def _each(
    study: Study,
    tasks: Sequence[Task],
    workers: int | None,
    cluster: str | None,
    tell: Callable[[str], None],
) -> Iterator[tuple[Task, TrialObservations | Crash]]:
    """Yield each task with its outcome, as they are done."""
    if workers is None:
        workers = min(os.cpu_count() or 1, len(tasks) // TRIALS_PER_WORKER)
    if workers < 0:
        raise ValueError(f"workers is {workers}; accepted: 0 (none), 1 and more, or None")
    if cluster is not None:
        from frictus_service.identification.cluster import work_on_cluster

        done = work_on_cluster(cluster, observe_task, tasks, tell, after=release)
    elif workers == 0:
        done = ((n, _read_and_observe(study, task)) for n, task in enumerate(tasks))
    else:
        done = work_through(observe_task, tasks, workers, tell)
    for number, outcome in done:
        yield tasks[number], outcome


def observe_task(task: Task) -> TrialObservations:
    """Do one task in whatever process; it keeps the study open for the next.

    Parameters
    ----------
    task : Task
    """
    with _HELD.lock:
        return _read_and_observe(_HELD.opened(task.path), task)


def release() -> None:
    """Close the study that this process keeps open."""
    with _HELD.lock:
        _HELD.close()


class _Held:
    """The study that a worker process has open; one thread at a time uses it."""

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self._path: Path | None = None
        self._study: Study | None = None

    def opened(self, path: Path) -> Study:
        if self._study is None or self._path != path:
            self.close()
            self._study = open_study(path)
            self._path = path
        return self._study

    def close(self) -> None:
        if self._study is not None:
            self._study.__exit__(None, None, None)
            self._study = None


_HELD: Final = _Held()


def _read_and_observe(study: Study, task: Task) -> TrialObservations:
    try:
        trial = study.read(task.trial.id)
    except TrialError as error:
        fault = error.exclusion
        return unusable(task.trial, f"{fault.field} {fault.reason}")
    cache = None if task.cache is None else Cache(task.cache)
    if cache is None:
        return observe(trial, study.info)
    observed = cache.find(trial.sha256, task.trial, study.info)
    if observed is None:
        observed = observe(trial, study.info)
        cache.keep(observed, study.info)
    return observed


def unusable(trial: TrialInfo, reason: str) -> TrialObservations:
    """Return the observations of a trial that says nothing, and why.

    Parameters
    ----------
    trial : TrialInfo
    reason : str
    """
    return TrialObservations(trial, "", False, (reason,), (), np.nan, np.nan, NO_ROWS)


def _observed(trial: TrialInfo, outcome: TrialObservations | Crash) -> TrialObservations:
    if not isinstance(outcome, Crash):
        return outcome
    return unusable(
        trial,
        f"{outcome.workers} worker processes ended while they observed it, the last one "
        f"{outcome.how}",
    )


def _without_copies(observations: list[TrialObservations]) -> list[TrialObservations]:
    """Return the same trials; of several with the same content only the first is valid."""
    hashes = [(each.info.id, each.sha256) for each in observations if each.sha256]
    copies = {copy.trial: copy.reason for copy in duplicates(hashes)}
    return [
        replace(each, valid=False, reasons=(*each.reasons, copies[each.info.id]))
        if each.info.id in copies
        else each
        for each in observations
    ]
