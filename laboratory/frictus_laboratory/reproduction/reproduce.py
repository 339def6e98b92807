"""`frictus paper`: people drawn, trials simulated to a file, which is analysed and shown."""

import os
import secrets
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
from rich.console import Console
from rich.table import Table

from frictus_laboratory.reproduction import paper
from frictus_laboratory.reproduction.comparison import compare
from frictus_laboratory.reproduction.paper import HEADINGS, Row, markdown
from frictus_laboratory.reproduction.plan import (
    StudyConditions,
    TrialPlan,
    log_tones,
    plan_study,
)
from frictus_laboratory.reproduction.population import draw_people
from frictus_laboratory.reproduction.simulate import STEPS, simulate_trial, study_info
from frictus_service.cli.options import wants_lines, write_line
from frictus_service.identification.analysis import identify
from frictus_service.identification.documents import Identification
from frictus_service.identification.pipeline.study import observe_study
from frictus_service.identification.pipeline.workers import Crash, WorkerError, work_through
from frictus_service.study.importers import open_study
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


BAD_SHARE: Final = 0.05
DELAY_S: Final = 1e-4
"""Of the drive, which no file declares."""

FULL: Final = StudyConditions(log_tones(15), bad_share=BAD_SHARE, delay_s=DELAY_S)
"""The paper's conditions: 375 trials of 10 s for each person."""
QUICK: Final = StudyConditions(
    log_tones(8), forces_n=(0.2, 0.4, 0.6), seconds=3.0, bad_share=BAD_SHARE, delay_s=DELAY_S
)
"""120 trials of 3 s for each person."""
QUICK_PARTICIPANTS: Final = 8
FULL_PARTICIPANTS: Final = paper.PARTICIPANTS


@dataclass(frozen=True, slots=True)
class Reproduction:
    """A simulated study and what came out of it.

    Attributes
    ----------
    rows : tuple of Row
        What was found beside what was put in.
    identification : Identification
        The document of an identification.
    bad_trials : int
        So many were simulated with a fault.
    """

    rows: tuple[Row, ...]
    identification: Identification
    bad_trials: int

    @property
    def account(self) -> str:
        """One line on the trials."""
        study = self.identification.study
        return (
            f"{study.participants} participants, {study.trials} trials, {study.trials_used} "
            f"used; {self.bad_trials} were simulated with a fault"
        )


def reproduce(
    path: Path,
    design: StudyConditions,
    participants: int,
    seed: int,
    workers: int,
    tell: Callable[[str], None],
) -> Reproduction:
    """Simulate a study into a new file, identify it from the file alone, and compare.

    The people who are drawn have the paper's values as their means.

    Parameters
    ----------
    path : Path
        Of the study file.
    design : StudyConditions
        Tones, speeds, forces and scatter.
    participants : int
        At least 2; below 6 no exact test can reach 5 %.
    seed : int
        Of everything random; the same seed gives the same result.
    workers : int
        Processes to spawn; 0: none.
    tell : callable
        Told what happens, a line at a time.

    Raises
    ------
    StudyError
        If there is such a file already.
    WorkerError
        If workers do not start, or fail.
    """
    rng = np.random.default_rng(seed)
    people = draw_people(participants, rng, centred=True)
    plans = plan_study(people, design, rng)
    record_study(path, plans, workers, tell)
    observations = observe_study(path, workers=workers, tell=tell)
    tell("identifying")
    with open_study(path) as study:
        found = identify(
            observations, path=path.name, sha256=study.sha256, unreadable=study.excluded
        )
    bad = sum(plan.fault is not None for plan in plans)
    return Reproduction(tuple(compare(found, people, plans)), found, bad)


def run_paper(
    participants: int | None,
    full: bool,
    seconds: float | None,
    out: Path | None,
    seed: int | None,
    workers: int | None,
    as_json: bool,
) -> None:
    """Simulate, analyse and show, with progress on standard error.

    Parameters
    ----------
    participants : int or None
        None: as the paper has.
    full : bool
        All of the paper's conditions, as long as they were.
    seconds : float or None
        Recorded per trial.
    out : Path or None
        Folder that keeps the study, the identification and the table.
    seed : int or None
        None: a fresh one, which is told.
    workers : int or None
        Processes; 0: none but this one. None: one per processor.
    as_json : bool
        JSON lines instead of a table.
    """
    design = FULL if full else QUICK
    design = design if seconds is None else replace(design, seconds=seconds)
    people = participants or (FULL_PARTICIPANTS if full else QUICK_PARTICIPANTS)
    seed = secrets.randbits(32) if seed is None else seed
    workers = (os.cpu_count() or 1) if workers is None else workers
    _tell(f"seed {seed}")
    with tempfile.TemporaryDirectory() if out is None else nullcontext(out) as folder:
        path = Path(folder) / "study.h5"
        found = reproduce(path, design, people, seed, workers, _tell)
    if out is not None:
        (out / "identification.json").write_bytes(found.identification.to_json())
        (out / "table.md").write_text(markdown(found.rows), encoding="utf-8")
    if wants_lines(as_json):
        write_line(seed=seed, account=found.account, rows=[row.fields() for row in found.rows])
    else:
        _show(found, Console())


def _tell(line: str) -> None:
    sys.stderr.write(f"{line}\n")
    sys.stderr.flush()


def _show(found: Reproduction, console: Console) -> None:
    table = Table(title="frictus paper")
    for heading in HEADINGS:
        table.add_column(heading)
    for row in found.rows:
        table.add_row(*row.cells())
    console.print(table)
    console.print(found.account, highlight=False)
