"""The same work on an existing `dask.distributed` cluster."""

from collections.abc import Callable, Iterator, Sequence
from importlib import import_module
from typing import Any, Final, TypeVar

from frictus_service.errors import ServiceError
from frictus_service.identification.pipeline.workers import Crash

Task = TypeVar("Task")
Result = TypeVar("Result")

PER_THREAD: Final = 2
"""Tasks under way per thread of the cluster: one at work, one at hand."""

CONNECT_S: Final = 20.0


class ClusterError(ServiceError, ConnectionError):
    """The cluster cannot be used; the text says why."""


def work_on_cluster(
    address: str,
    work: Callable[[Task], Result],
    tasks: Sequence[Task],
    tell: Callable[[str], None],
    after: Callable[[], None],
    timeout_s: float = CONNECT_S,
) -> Iterator[tuple[int, Result | Crash]]:
    """Yield the number and the result of each task, as they are done.

    The scheduler gives the task of a worker that died to another. No more tasks are under way
    than keep the cluster busy, so that memory does not grow with their number.

    Parameters
    ----------
    address : str
        Of the scheduler, such as ``tcp://host:8786``.
    work : callable
        Of a module that the workers can import.
    tasks : sequence
        What can be pickled.
    tell : callable
        Told who works.
    after : callable
        Called on every worker in the end.
    timeout_s : float
        How long the scheduler may take to answer.

    Raises
    ------
    ClusterError
        If `distributed` is not installed, no scheduler answers, or it has no workers.
    """
    try:
        distributed: Any = import_module("distributed")
    except ImportError as error:
        raise ClusterError(
            "a cluster needs dask.distributed: pip install 'frictus[cluster]'"
        ) from error
    try:
        client = distributed.Client(address, timeout=timeout_s, set_as_default=False)
    except (OSError, ValueError) as error:
        raise ClusterError(
            f"no dask scheduler answers at {address} ({error}): start one with `dask "
            "scheduler` and workers with `dask worker`, and give its address"
        ) from error
    with client:
        try:
            client.wait_for_workers(1, timeout=timeout_s)
        except TimeoutError as error:
            raise ClusterError(
                f"the scheduler at {address} has no workers: start some with `dask worker "
                f"{address}`"
            ) from error
        threads = sum(client.nthreads().values())
        tell(f"{threads} threads of the cluster at {address} work")
        yield from _flow(distributed, client, work, tasks, PER_THREAD * threads)
        client.run(after, on_error="ignore")  # one may just have died


def _flow(
    distributed: Any,
    client: Any,
    work: Callable[[Task], Result],
    tasks: Sequence[Task],
    under_way: int,
) -> Iterator[tuple[int, Result | Crash]]:
    numbers: dict[Any, int] = {}
    suspects: list[int] = []
    coming = iter(enumerate(tasks))

    def submit(number: int, task: Task) -> Any:
        future = client.submit(work, task, pure=False)
        numbers[future] = number
        return future

    first = [submit(*next(coming)) for _ in range(min(under_way, len(tasks)))]
    done = distributed.as_completed(first, loop=client.loop)
    for future in done:
        number = numbers.pop(future)
        try:
            yield number, future.result()
        except distributed.KilledWorker:
            suspects.append(number)
        following = next(coming, None)
        if following is not None:
            done.add(submit(*following))
    # Tasks that waited at a worker when it died are blamed too: alone, each shows what it is.
    for number in suspects:
        try:
            yield number, client.submit(work, tasks[number], pure=False).result()
        except distributed.KilledWorker as error:
            last = error.last_worker.address
            yield number, Crash(error.allowed_failures + 1, f"at {last}")
