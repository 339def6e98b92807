"""The same work on many tasks, in processes of their own: what is read from one trial, by whom.

A worker holds one task at a time, so that it is known which task a dead worker had: it is given
to another, and a task that keeps killing its workers is told as such. Workers are spawned, with
one thread each for linear algebra: more would only be in each other's way.
"""

import hashlib
import multiprocessing
import os
import signal
import traceback
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, fields
from functools import lru_cache
from importlib import import_module
from multiprocessing.connection import wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from frictus_service.errors import ServiceError, StudyError
from frictus_service.identification.observation.response import TrialObservations
from frictus_service.processes import quiet_numerics
from frictus_service.study.trial import StudyInfo, Trial

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Table = NDArray[np.void]
Columns = TypeVar("Columns", bound="DataclassInstance")


def table_of(columns: "DataclassInstance") -> Table:
    """Return a dataclass of arrays of shape (n,) as a structured array of shape (n,).

    Parameters
    ----------
    columns : dataclass instance
        All of its fields are arrays of the same length.
    """
    arrays = {field.name: getattr(columns, field.name) for field in fields(columns)}
    (count,) = {array.size for array in arrays.values()}
    table = np.empty(count, dtype=[(name, array.dtype) for name, array in arrays.items()])
    for name, array in arrays.items():
        table[name] = array
    return table


def columns_of(kind: type[Columns], table: Table) -> Columns:
    """Return the dataclass whose columns a structured array holds.

    Parameters
    ----------
    kind : type
        The dataclass.
    table : ndarray, shape (n,)
        From `table_of`.
    """
    columns: dict[str, Any] = {field.name: table[field.name].copy() for field in fields(kind)}
    return kind(**columns)


@dataclass(frozen=True, slots=True)
class Reading:
    """What was read from a trial.

    Attributes
    ----------
    observed : TrialObservations
        Responses, and whether the trial may be used.
    more : mapping of str to ndarray
        What the reader adds to the observations, as structured arrays by name; empty where a
        trial could not be read.
    """

    observed: TrialObservations
    more: Mapping[str, Table] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Reader:
    """A pure function of a trial, known by its name and its source.

    Attributes
    ----------
    name : str
        Of what it reads; files in the cache end in it.
    read : callable
        Of a module, so that a worker can import it.
    sources : tuple of str
        Modules, besides those of the observations, on which the result depends.
    """

    name: str
    read: Callable[[Trial, StudyInfo], Reading]
    sources: tuple[str, ...] = ()

    @property
    def version(self) -> str:
        """Hash of the source of its modules."""
        return version_of(self.sources)


@lru_cache(maxsize=8)
def version_of(modules: tuple[str, ...]) -> str:
    """Return the hash of the source of modules.

    Parameters
    ----------
    modules : tuple of str
        Their full names.
    """
    hashed = hashlib.sha256()
    for name in modules:
        hashed.update(Path(str(import_module(name).__file__)).read_bytes())
    return hashed.hexdigest()


Task = TypeVar("Task")
Result = TypeVar("Result")

MOST_CRASHES: Final = 3
"""Workers that a task may take with it."""

ONE_THREAD: Final = {
    name: "1"
    for name in (
        "MKL_NUM_THREADS",
        "NUMBA_NUM_THREADS",
        "OMP_NUM_THREADS",
        "OPENBLAS_NUM_THREADS",
        "VECLIB_MAXIMUM_THREADS",
    )
}
_READY: Final = "ready"


class WorkerError(ServiceError, RuntimeError):
    """Worker processes do not start, or their work fails; the text says how."""


@dataclass(frozen=True, slots=True)
class Crash:
    """A task that no worker survived.

    Attributes
    ----------
    workers : int
        How many it was given to.
    how : str
        The last of them ended.
    """

    workers: int
    how: str


@dataclass(slots=True)
class _Worker:
    process: BaseProcess
    pipe: Any
    ready: bool = False
    task: int | None = None
    exit_code: int | None = None


def work_through(
    work: Callable[[Task], Result],
    tasks: Sequence[Task],
    workers: int,
    tell: Callable[[str], None],
) -> Iterator[tuple[int, Result | Crash]]:
    """Yield the number and the result of each task, as they are done.

    Parameters
    ----------
    work : callable
        Of a module, so that a worker can import it.
    tasks : sequence
        Small: each is sent to a worker when it is idle.
    workers : int
        At least 1.
    tell : callable
        Told of workers that died.

    Raises
    ------
    WorkerError
        If workers do not start, or the work raises an exception.
    """
    crew = _Crew(work, tell)
    try:
        for _ in range(min(workers, len(tasks))):
            crew.hire()
        yield from crew.through(tasks)
    finally:
        crew.dismiss()


class _Crew(Generic[Task, Result]):
    def __init__(self, work: Callable[[Task], Result], tell: Callable[[str], None]) -> None:
        self._work = work
        self._tell = tell
        self._context = multiprocessing.get_context("spawn")
        self._workers: list[_Worker] = []

    def hire(self) -> None:
        ours, theirs = self._context.Pipe()
        process = self._context.Process(
            target=_serve, args=(self._work, theirs), name="frictus-worker", daemon=True
        )
        with _environment(ONE_THREAD):
            process.start()
        theirs.close()  # else the pipe would not end with the worker
        self._workers.append(_Worker(process, ours))

    def through(self, tasks: Sequence[Task]) -> Iterator[tuple[int, Result | Crash]]:
        waiting = deque(range(len(tasks)))
        crashes = [0] * len(tasks)
        left = len(tasks)
        while left:
            for worker in self._heard():
                number = worker.task
                try:
                    said = worker.pipe.recv()
                except (EOFError, OSError):
                    self._replace(worker)
                    if number is None:
                        continue
                    crashes[number] += 1
                    if crashes[number] < MOST_CRASHES:
                        waiting.appendleft(number)
                        continue
                    left -= 1
                    yield (
                        number,
                        Crash(MOST_CRASHES, f"with exit code {worker.exit_code}"),
                    )
                else:
                    worker.ready, worker.task = True, None
                    if number is not None:
                        left -= 1
                        yield number, _result_in(said)
            self._hand_out(tasks, waiting)

    def _heard(self) -> list[_Worker]:
        """Wait for workers that say something, or die: then their pipe ends."""
        pipes = {worker.pipe: worker for worker in self._workers}
        return [pipes[pipe] for pipe in wait(list(pipes))]

    def _hand_out(self, tasks: Sequence[Task], waiting: deque[int]) -> None:
        for worker in self._workers:
            if waiting and worker.ready and worker.task is None:
                worker.task = waiting.popleft()
                # One that has died meanwhile is met by its pipe's end, task and all.
                with suppress(OSError):
                    worker.pipe.send(tasks[worker.task])

    def _replace(self, dead: _Worker) -> None:
        self._workers.remove(dead)
        dead.pipe.close()
        dead.process.join()
        dead.exit_code = dead.process.exitcode
        dead.process.close()
        if not dead.ready:
            raise WorkerError(
                f"a worker process ended with exit code {dead.exit_code} before it "
                "began: a script that uses workers needs `if __name__ == '__main__':`; "
                "workers=0 does without them"
            )
        self._tell(
            f"a worker process died with exit code {dead.exit_code}; what it was at is given "
            "to another"
        )
        self.hire()

    def dismiss(self) -> None:
        for worker in self._workers:
            worker.process.terminate()
        for worker in self._workers:
            worker.process.join()
            worker.process.close()
            worker.pipe.close()
        self._workers.clear()


def _result_in(said: Any) -> Any:
    done, result = said
    if not done:
        raise result
    return result


def _serve(work: Callable[[Any], Any], pipe: Any) -> None:
    """Be a worker, until the pipe ends."""
    quiet_numerics()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the parent, which ends us
    pipe.send(_READY)
    while True:
        try:
            task = pipe.recv()
        except (EOFError, OSError):
            return
        try:
            said = (True, work(task))
        except (StudyError, OSError) as error:  # the file has changed since: no bug
            said = (False, StudyError(str(error)))
        except Exception:
            failed = f"the work of a worker process failed:\n{traceback.format_exc()}"
            said = (False, WorkerError(failed))
        pipe.send(said)


@contextmanager
def _environment(wanted: dict[str, str]) -> Iterator[None]:
    """Set variables for children that start meanwhile: libraries read them when imported."""
    before = {name: os.environ.get(name) for name in wanted}
    os.environ.update(wanted)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
