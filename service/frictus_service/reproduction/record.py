"""A simulated study as a file: trials simulated in workers, written by one."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from frictus_service.identification.pipeline.workers import Crash, WorkerError, work_through
from frictus_service.reproduction.plan import TrialPlan
from frictus_service.reproduction.simulate import STEPS, simulate_trial, study_info
from frictus_service.study.trial import Trial
from frictus_service.study.writer import StudyWriter


def record_study(
    path: Path,
    plans: Sequence[TrialPlan],
    workers: int = 0,
    tell: Callable[[str], None] = lambda _: None,
) -> None:
    """Simulate trials and write them to a new `study/1` file, in the order of the plans.

    Parameters
    ----------
    path : Path
        Of the file.
    plans : sequence of TrialPlan
        The truth in them does not go into the file.
    workers : int
        Processes that simulate, on which nothing in the file depends. 0: this one.
    tell : callable
        Told what happens, a line at a time.

    Raises
    ------
    StudyError
        If there is such a file already.
    WorkerError
        If worker processes do not start, or fail.
    """
    with StudyWriter(path, study_info()) as writer:
        for written, trial in enumerate(simulate_all(plans, workers, tell), start=1):
            writer.add(trial, STEPS)
            if written * 20 // len(plans) > (written - 1) * 20 // len(plans):
                tell(f"{written} of {len(plans)} trials simulated")


def simulate_all(
    plans: Sequence[TrialPlan],
    workers: int = 0,
    tell: Callable[[str], None] = lambda _: None,
) -> Iterator[Trial]:
    """Yield the trials of plans, in their order.

    Parameters
    ----------
    plans : sequence of TrialPlan
        One for each trial.
    workers : int
        Processes to spawn; 0: none.
    tell : callable
        Told of workers that died.

    Raises
    ------
    WorkerError
        If worker processes do not start, or fail.
    """
    if workers == 0:
        yield from map(simulate_trial, plans)
        return
    early: dict[int, Trial] = {}
    following = 0
    for number, outcome in work_through(simulate_trial, plans, workers, tell):
        if isinstance(outcome, Crash):
            raise WorkerError(
                f"{outcome.workers} worker processes ended while they simulated trial "
                f"{plans[number].info.id}, the last one {outcome.how}"
            )
        early[number] = outcome
        while following in early:
            yield early.pop(following)
            following += 1
