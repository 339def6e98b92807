"""From several studies to what holds in all of them and what differs between them."""

import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Final

from frictus_service.discovery.across_studies.common_causes import (
    choose_causes,
    pool_candidates,
)
from frictus_service.discovery.across_studies.document import (
    MOST_STUDIES,
    AcrossStudies,
    StudyLeftOut,
)
from frictus_service.discovery.across_studies.meta_analysis import LEAST_STUDIES
from frictus_service.discovery.across_studies.phrasing import answer
from frictus_service.discovery.across_studies.study_work import (
    StudyResult,
    StudyTask,
    reduce_study,
    sources_version,
)
from frictus_service.discovery.across_studies.verdicts import StudiesAbout
from frictus_service.discovery.catalogue.cause import title
from frictus_service.discovery.problem.base_models import (
    DEVIATING,
    NUISANCE,
    ResponseName,
    base_model,
)
from frictus_service.discovery.problem.candidates import candidates_of
from frictus_service.errors import StudyError
from frictus_service.identification.pipeline.study import release
from frictus_service.identification.pipeline.workers import Crash, work_through

MOST_ROUNDS: Final = 4
"""Of choosing causes and taking all studies about them."""
FEW_STUDIES: Final = 5
NOT_EXPLAINED: Final = frozenset({"partly_explained", "characterised", "unexplained"})

Outcome = StudyResult | StudyLeftOut


@dataclass(frozen=True, slots=True)
class Workforce:
    """Who reduces studies.

    Attributes
    ----------
    workers : int or None
        Processes to spawn; 0: this one; None: one per processor.
    cluster : str or None
        Address of a `dask.distributed` scheduler, whose workers are used instead; they must
        reach studies and results at the same paths.
    tell : callable
        Told what happens, a line at a time.
    """

    workers: int | None
    cluster: str | None
    tell: Callable[[str], None]

    def outcomes(self, tasks: Sequence[StudyTask]) -> list[Outcome]:
        """Return what came of each study, in their order."""
        found: dict[int, Outcome] = {}
        for count, (number, outcome) in enumerate(self._each(tasks), 1):
            task = tasks[number]
            found[number] = _died(outcome, task) if isinstance(outcome, Crash) else outcome
            self.tell(f"{count} of {len(tasks)} studies: {task.name}{_said(found[number])}")
        return [found[number] for number in range(len(tasks))]

    def _each(self, tasks: Sequence[StudyTask]) -> Iterator[tuple[int, Outcome | Crash]]:
        if self.cluster is not None:
            from frictus_service.identification.pipeline.dask_cluster import work_on_cluster

            yield from work_on_cluster(
                self.cluster, reduce_study, tasks, self.tell, after=release
            )
            return
        workers = min(os.cpu_count() or 1 if self.workers is None else self.workers, len(tasks))
        if workers == 0:
            yield from ((number, reduce_study(task)) for number, task in enumerate(tasks))
        else:
            yield from work_through(reduce_study, tasks, workers, self.tell)


def _died(crash: Crash, task: StudyTask) -> StudyLeftOut:
    reason = f"{crash.workers} workers ended while they had it, the last one {crash.how}"
    return StudyLeftOut(path=str(task.path), reason=reason)


def _said(outcome: Outcome) -> str:
    if isinstance(outcome, StudyLeftOut):
        return f" is left out: {outcome.reason}"
    causes = ", ".join(map(title, outcome.summary.causes))
    return f", by itself {outcome.summary.verdict}" + (f" ({causes})" if causes else "")


def discover_across(
    paths: Sequence[Path],
    folder: Path,
    *,
    response: ResponseName = "friction",
    base: str = "paper",
    seed: int | None = None,
    workers: int | None = None,
    cache: Path | None = None,
    cluster: str | None = None,
    tell: Callable[[str], None] | None = None,
) -> AcrossStudies:
    """Return what holds in all studies, and what differs between them.

    Parameters
    ----------
    paths : sequence of Path
        Of study files.
    folder : Path
        Of the studies' own reports, and of what is kept for the next run.
    response : {'friction', 'mobility'}
    base : str
        ``paper``, ``constant-cutoff`` or the path of a model.
    seed : int or None
        Of each study's own discovery; None: fresh, unless its result is there.
    workers, cluster, tell
        As for `Workforce`.
    cache : Path or None
        Of what trials say; None: below the folder.

    Raises
    ------
    BaseModelError
        If there is no such base model.
    StudyError
        If fewer than two studies can be used; the text says why each cannot.
    WorkerError, ClusterError
        If workers do not start, or the cluster cannot be used.
    """
    if len(paths) > MOST_STUDIES:
        raise StudyError(f"{len(paths)} studies; accepted: {LEAST_STUDIES} to {MOST_STUDIES}")
    folder = folder.resolve()
    criticised = base_model(base, response)
    work = Workforce(workers, cluster, tell or (lambda line: None))
    named = len(paths)
    paths = list(dict.fromkeys(path.resolve() for path in paths))
    if len(paths) < LEAST_STUDIES:
        raise StudyError(
            f"{named} names are of one and the same study; needed: {LEAST_STUDIES} or more"
        )
    tasks = [
        StudyTask(
            path=path,
            name=name,
            base=criticised,
            chosen=(),
            seed=seed,
            results=folder / "results",
            observations=(cache or folder / "observations").resolve(),
            report=folder / "studies" / f"{number:02}-{name.replace('/', '_')}",
            sources=sources_version(),
        )
        for number, (path, name) in enumerate(zip(paths, names_of(paths), strict=True), 1)
    ]
    work.tell("each study by itself")
    used, left_out = _usable(tasks, work)
    candidates = candidates_of(response, [effect.id for effect in criticised.effects])
    kinds = [candidate.effect for candidate in candidates]
    chosen: tuple[int, ...] = ()
    notes = []
    for attempt in range(MOST_ROUNDS):
        wanted = tuple(sorted(choose_causes([each.statistics for _, each in used], kinds)))
        if wanted == chosen:
            break
        if attempt == MOST_ROUNDS - 1:
            notes.append(
                f"which causes are in the model did not settle: {_named(kinds, chosen)}, or "
                f"{_named(kinds, wanted)}; sizes are about the former."
            )
            break
        chosen = wanted
        work.tell(f"all studies beside the same causes: {_named(kinds, chosen)}")
        tasks = [replace(task, chosen=chosen) for task, _ in used]
        used, more = _usable(tasks, work)
        left_out += more
    statistics = [each.statistics for _, each in used]
    about = StudiesAbout([each.summary for _, each in used], statistics, candidates, chosen)
    causes = about.causes(pool_candidates(statistics, chosen))
    return AcrossStudies(
        code_version=version("frictus"),
        response=response,
        base_model=criticised,
        sentence=answer(causes, len(used)),
        causes=tuple(causes),
        base_parameters=tuple(about.base_parameters(NUISANCE[response][: DEVIATING[response]])),
        studies=tuple(about.summaries),
        left_out=tuple(left_out),
        notes=(*notes, *_notes(about, left_out)),
    )


def _usable(
    tasks: Sequence[StudyTask], work: Workforce
) -> tuple[list[tuple[StudyTask, StudyResult]], list[StudyLeftOut]]:
    """Return the studies that can be used, and those that cannot.

    Raises
    ------
    StudyError
        If fewer than two can.
    """
    used: list[tuple[StudyTask, StudyResult]] = []
    left_out = []
    holder: dict[str, str] = {}
    for task, outcome in zip(tasks, work.outcomes(tasks), strict=True):
        if isinstance(outcome, StudyLeftOut):
            left_out.append(outcome)
            continue
        again = [holder[trial] for trial in outcome.trials if trial in holder]
        if again:
            reason = (
                f"{len(again)} of its {len(outcome.trials)} trials are those of {again[0]}: "
                "studies must not share data"
            )
            left_out.append(StudyLeftOut(path=str(task.path), reason=reason))
            work.tell(f"{task.name} is left out: {reason}")
            continue
        holder |= dict.fromkeys(outcome.trials, task.name)
        used.append((task, outcome))
    if len(used) < LEAST_STUDIES:
        reasons = "; ".join(f"{each.path}: {each.reason}" for each in left_out)
        raise StudyError(
            f"{len(used)} of {len(tasks)} studies can be used; needed: {LEAST_STUDIES} or "
            f"more. {reasons}"
        )
    return used, left_out


def names_of(paths: Sequence[Path]) -> list[str]:
    """Return a short name of each study: its path from where they part, without suffix."""
    try:
        common = Path(os.path.commonpath([path.parent for path in paths]))
    except ValueError:  # of several drives
        return [path.as_posix() for path in paths]
    return [path.relative_to(common).with_suffix("").as_posix() for path in paths]


def _named(kinds: Sequence[str], chosen: Sequence[int]) -> str:
    return ", ".join(title(kinds[k]) for k in chosen) or "none"


def _notes(about: StudiesAbout, left_out: Sequence[StudyLeftOut]) -> Iterator[str]:
    count = len(about.summaries)
    if left_out:
        yield f"{len(left_out)} of {count + len(left_out)} studies are left out; reasons below."
    if count < FEW_STUDIES:
        yield (
            f"{count} studies: a common size can hardly be significant, and tau is hardly "
            f"known; {FEW_STUDIES} or more say much more."
        )
    blocks = [each.name for each in about.summaries if each.held_out == "blocks"]
    if blocks:
        yield (
            f"In {', '.join(blocks)} there are fewer than six people: blocks of trials stand "
            "for people, and how people differ counts as a difference between studies."
        )
    common = {about.candidates[k].effect for k in about.chosen}
    alone = {name for each in about.summaries for name in each.causes} - common
    if alone:
        yield (
            "Named by some study itself, but not by all together: "
            f"{', '.join(title(name) for name in sorted(alone))}. One study in twenty names "
            "something by chance; sizes in every study stand in the document."
        )
    unexplained = [each.name for each in about.summaries if each.verdict in NOT_EXPLAINED]
    if unexplained:
        yield (
            f"Not all is explained in {', '.join(unexplained)}: forms beyond the catalogue are "
            "looked for in each study by itself only."
        )
