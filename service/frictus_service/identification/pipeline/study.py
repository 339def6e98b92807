"""What all trials of a study say: they go through workers, known ones come from a cache."""

import os
import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from frictus_service.errors import TrialError
from frictus_service.identification.observation.observe import course_of, observe_along
from frictus_service.identification.observation.response import NO_ROWS, TrialObservations
from frictus_service.identification.pipeline.cache import Cache
from frictus_service.identification.pipeline.workers import Crash, Reader, Reading, work_through
from frictus_service.identification.plausibility import trial_statistics, turns
from frictus_service.identification.plausibility.pool import TrialRecord
from frictus_service.identification.plausibility.position_delay import (
    delay_text,
    sensor_delay_s,
)
from frictus_service.identification.plausibility.trial_statistics import (
    TrialStatistics,
    statistics_of,
)
from frictus_service.study.file_state import state_of, unchanged
from frictus_service.study.importers import Study, open_study
from frictus_service.study.layout import duplicates, in_time
from frictus_service.study.trial import StudyInfo, Trial, TrialInfo

TRIALS_PER_WORKER: Final = 30
"""A process takes longer to start than so many trials take."""
STATISTICS: Final = "statistics"
"""Name of the table that holds the statistics of a trial."""


def read_observations(trial: Trial, study: StudyInfo) -> Reading:
    """Return the observations of a trial, and what its plausibility is judged by."""
    course = course_of(trial)
    statistics = statistics_of(trial, study, course).as_table()
    return Reading(observe_along(course, trial, study), {STATISTICS: statistics})


SOURCES: Final = (trial_statistics.__name__, turns.__name__)
OBSERVER: Final = Reader("observations", read_observations, SOURCES)


@dataclass(frozen=True, slots=True)
class Task:
    """One trial to be read by a process that opens the study itself.

    Attributes
    ----------
    path : Path
        The study, at a place that the process reaches too.
    trial : TrialInfo
        What was asked of the trial.
    cache : Path or None
        Folder of readings; likewise.
    reader : Reader
        What is read from a trial.
    late_s : float
        By which the times of its positions are taken earlier.
    """

    path: Path
    trial: TrialInfo
    cache: Path | None
    reader: Reader = OBSERVER
    late_s: float = 0.0


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
        Of the file.
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
        If the study cannot be read, or changes meanwhile.
    WorkerError
        If worker processes do not start, or fail.
    ClusterError
        If the cluster cannot be used.
    """
    readings = read_study(
        path, OBSERVER, workers=workers, cache=cache, cluster=cluster, tell=tell
    )
    return [reading.observed for reading in readings]


def read_study(
    path: Path | str,
    reader: Reader,
    *,
    workers: int | None = None,
    cache: Path | str | None = None,
    cluster: str | None = None,
    tell: Callable[[str], None] | None = None,
) -> list[Reading]:
    """Return the readings of all trials of a study, in the order of its trials.

    As `observe_study`, of which the observations are one reading. Where the study does not say
    how late its positions are, and they show one delay of the touch sensor, they are read anew
    without it, which `judge_study` tells.

    Parameters
    ----------
    path : Path or str
        Of the file.
    reader : Reader
        What is read from a trial.
    workers, cache, cluster, tell
        As for `observe_study`.
    """
    work = _Work(path, reader, workers, cache, cluster, tell)
    with unchanged(work.path), open_study(work.path) as study:
        for left_out in study.excluded:
            work.tell(f"trial {left_out.trial} is left out: {left_out.field} {left_out.reason}")
        readings = work.through(study)
        stated = study.info.positions_late_s is not None
        if not stated and (late_s := sensor_delay_s(records_of(readings))):
            work.tell(f"positions come {delay_text(late_s)}: trials are read without it")
            readings = [_earlier(each, late_s) for each in work.through(study, late_s)]
    return _without_copies(readings)


class _Work:
    """How the trials of a study are read."""

    def __init__(
        self,
        path: Path | str,
        reader: Reader,
        workers: int | None = None,
        cache: Path | str | None = None,
        cluster: str | None = None,
        tell: Callable[[str], None] | None = None,
    ) -> None:
        self.path = Path(path).resolve()
        self._reader, self._workers, self._cluster = reader, workers, cluster
        self._kept = None if cache is None else Cache(Path(cache).resolve(), reader)
        self.tell = tell or (lambda line: None)

    def through(self, study: Study, late_s: float = 0.0) -> list[Reading]:
        """Return the readings of all trials, whose positions are taken earlier."""
        kept = self._kept
        contents = _Contents.of(self.path, kept, late_s)
        found = {trial.id: contents.find(trial, study) for trial in study.trials}
        folder = None if kept is None else kept.folder
        tasks = [
            Task(self.path, trial, folder, self._reader, late_s)
            for trial in study.trials
            if found[trial.id] is None
        ]
        self.tell(f"{len(found)} trials, {len(found) - len(tasks)} of them known already")
        done = _each(study, tasks, self._workers, self._cluster, self.tell)
        for count, (task, outcome) in enumerate(done, 1):
            found[task.trial.id] = _reading_of(task.trial, outcome)
            if count * 20 // len(tasks) > (count - 1) * 20 // len(tasks):
                self.tell(f"{count} of {len(tasks)} trials observed")
        readings = [each for each in found.values() if each is not None]
        if tasks:
            contents.keep(readings)
        return readings


def _earlier(reading: Reading, late_s: float) -> Reading:
    """Return a reading whose statistics say by how much its positions were taken earlier."""
    if STATISTICS not in reading.more:
        return reading
    statistics = TrialStatistics.of_table(reading.more[STATISTICS])
    told = replace(statistics, positions_earlier_s=late_s).as_table()
    return replace(reading, more={**reading.more, STATISTICS: told})


def records_of(readings: Sequence[Reading]) -> list[TrialRecord]:
    """Return what the plausibility of a study is judged by: of all trials that could be read.

    Parameters
    ----------
    readings : sequence of Reading
        From `read_study`.
    """
    return [
        TrialRecord(reading.observed, TrialStatistics.of_table(reading.more[STATISTICS]))
        for reading in readings
        if STATISTICS in reading.more
    ]


@dataclass(frozen=True, slots=True)
class _Contents:
    """What is known of a study file before it is read."""

    kept: Cache | None
    state: str
    hashes: dict[str, str]

    @classmethod
    def of(cls, path: Path, kept: Cache | None, late_s: float) -> "_Contents":
        if kept is None:
            return cls(None, "", {})
        state = state_of(path)
        if late_s:
            state = f"{state}.{1e6 * late_s:.0f}us"
        return cls(kept, state, kept.contents(state))

    def find(self, trial: TrialInfo, study: Study) -> Reading | None:
        sha256 = self.hashes.get(trial.id)
        if self.kept is None or sha256 is None:
            return None
        return self.kept.find(sha256, trial, study.info)

    def keep(self, readings: Sequence[Reading]) -> None:
        if self.kept is not None:
            observed = [reading.observed for reading in readings]
            hashes = {each.info.id: each.sha256 for each in observed if each.sha256}
            if hashes:  # else the folder would be made for nothing
                self.kept.keep_contents(self.state, hashes)


def _each(
    study: Study,
    tasks: Sequence[Task],
    workers: int | None,
    cluster: str | None,
    tell: Callable[[str], None],
) -> Iterator[tuple[Task, Reading | Crash]]:
    """Yield each task with its outcome, as they are done."""
    if workers is None:
        workers = min(os.cpu_count() or 1, len(tasks) // TRIALS_PER_WORKER)
    if workers < 0:
        raise ValueError(f"workers is {workers}; accepted: 0 (none), 1 and more, or None")
    if cluster is not None:
        from frictus_service.identification.pipeline.dask_cluster import work_on_cluster

        done = work_on_cluster(cluster, read_task, tasks, tell, after=release)
    elif workers == 0:
        done = ((n, _read(study, task)) for n, task in enumerate(tasks))
    else:
        done = work_through(read_task, tasks, workers, tell)
    for number, outcome in done:
        yield tasks[number], outcome


def read_task(task: Task) -> Reading:
    """Do one task in whatever process; it keeps the study open for the next.

    Parameters
    ----------
    task : Task
        The trial and its file.
    """
    with _HELD.lock:
        return _read(_HELD.opened(task.path), task)


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


def _read(study: Study, task: Task) -> Reading:
    try:
        trial = in_time(study.read(task.trial.id), task.late_s)
    except TrialError as error:
        fault = error.exclusion
        return Reading(unusable(task.trial, f"{fault.field} {fault.reason}"))
    if task.cache is None:
        return task.reader.read(trial, study.info)
    cache = Cache(task.cache, task.reader)
    reading = cache.find(trial.sha256, task.trial, study.info)
    if reading is None:
        reading = task.reader.read(trial, study.info)
        cache.keep(reading, study.info)
    return reading


def unusable(trial: TrialInfo, reason: str) -> TrialObservations:
    """Return the observations of a trial that says nothing, and why.

    Parameters
    ----------
    trial : TrialInfo
        What was asked of the trial.
    reason : str
        One sentence, for people.
    """
    return TrialObservations(trial, "", False, (reason,), (), np.nan, np.nan, NO_ROWS)


def _reading_of(trial: TrialInfo, outcome: Reading | Crash) -> Reading:
    if not isinstance(outcome, Crash):
        return outcome
    reason = (
        f"{outcome.workers} worker processes ended while they observed it, the last one "
        f"{outcome.how}"
    )
    return Reading(unusable(trial, reason))


def _without_copies(readings: list[Reading]) -> list[Reading]:
    """Return the same trials; of several with the same data only the first is valid.

    The first is by participant, session and order: of one person under two names, all trials
    of one name stay, not some of each, which would still be two people.
    """

    def place(observed: TrialObservations) -> tuple[str, int, int]:
        return observed.info.participant, observed.info.session, observed.info.order

    observed = sorted((each.observed for each in readings), key=place)
    hashes = [(each.info.id, each.measured_sha256) for each in observed]
    copies = {copy.trial: copy.reason for copy in duplicates(h for h in hashes if h[1])}
    return [_marked(each, copies.get(each.observed.info.id)) for each in readings]


def _marked(reading: Reading, reason: str | None) -> Reading:
    if reason is None:
        return reading
    reasons = (*reading.observed.reasons, reason)
    return replace(reading, observed=replace(reading.observed, valid=False, reasons=reasons))
