"""Discoveries as jobs: what is asked, how far it is, and the folder that keeps each.

``studies/discoveries/ID/`` holds `job.json`, where the discovery stands; `events.jsonl`, what
it told; and, once it is done, what `report.page` writes.
"""

import contextlib
import errno
import json
import os
import re
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Annotated, Final, Literal, TypedDict

from pydantic import Field

from frictus.lenient import Exact
from frictus.model import Model
from frictus.names import Matching
from frictus_service.discovery.across_studies.document import MOST_STUDIES
from frictus_service.discovery.document import Response, Verdict
from frictus_service.durable import replace_file
from frictus_service.errors import (
    DiscoveryCancelledError,
    UnknownDiscoveryError,
    UnknownStudyError,
    listed,
)
from frictus_service.job_folder import FolderJob, JobFolder

STUDY_NAME: Final = r"^\w[\w.-]*(/\w[\w.-]*)*$"
StudyName = Annotated[
    str,
    Field(max_length=200),
    Matching(STUDY_NAME, "a file as /v1/studies lists it is accepted, such as visit1.h5"),
]
StudyNames = Annotated[tuple[StudyName, ...], Field(min_length=2, max_length=MOST_STUDIES)]


class DiscoverySpec(Exact):
    """One discovery."""

    study: Annotated[
        StudyName | StudyNames,
        Field(
            description="File below the folder of studies, such as visit1.h5; or several: "
            "what holds in all of them"
        ),
    ]
    response: Response = "friction"
    base: Annotated[
        Literal["paper", "constant-cutoff"] | Model,
        Field(description="What is criticised; a `model/1` document may stand here"),
    ] = "paper"
    seed: Annotated[
        int | None, Field(ge=0, lt=2**53, description="Of random draws; null: fresh")
    ] = None

    @property
    def studies(self) -> tuple[str, ...]:
        """The files that are meant."""
        return (self.study,) if isinstance(self.study, str) else self.study


class DiscoveryProgress(Exact):
    """What a discovery is at."""

    message: str


class DiscoveryResult(Exact):
    """What came of it; the report has all."""

    verdict: Verdict | None
    """Null of several studies, and where nothing could be tested."""
    sentence: str
    """The verdict, or the answer of several studies, in words."""
    causes: tuple[str, ...]
    """Named, or in the model of several studies."""


class DiscoveryJob(FolderJob):
    """A discovery and where it stands."""

    spec: DiscoverySpec
    progress: DiscoveryProgress | None = None
    result: DiscoveryResult | None = None


class DiscoveryJobs(Exact):
    """All discoveries of this machine, newest first."""

    discoveries: list[DiscoveryJob]


class DiscoveryEvent(Exact):
    """One thing that a discovery told; numbered from 1 without gaps."""

    number: int
    kind: Literal["state", "progress"]
    data: str
    """JSON: the state, or the progress."""


BASE: Final = "base_model.json"
OBSERVATIONS: Final = "observations"
"""Beside the folders of all discoveries: by content, so that each trial is read once."""


def carry_out(
    spec: DiscoverySpec,
    studies: Sequence[Path],
    folder: Path,
    tell: Callable[[DiscoveryProgress], None],
    cancelled: Callable[[], bool],
) -> DiscoveryResult:
    """Carry out a discovery; its report lies in `folder` then.

    Parameters
    ----------
    spec : DiscoverySpec
        What the discovery was asked for.
    studies : sequence of Path
        The files that it names.
    folder : Path
        Of this discovery alone.
    tell : callable
        Told what it is at.
    cancelled : callable
        Asked whenever something is told.

    Raises
    ------
    DiscoveryCancelledError
    """

    def told(line: str) -> None:
        if cancelled():
            raise DiscoveryCancelledError("cancelled; there is no report")
        tell(DiscoveryProgress(message=line))

    asked: _Asked = {
        "response": spec.response,
        "base": _base(spec, folder),
        "seed": spec.seed,
        "cache": folder.parent / OBSERVATIONS,
        "tell": told,
    }
    if isinstance(spec.study, str):
        return _one(studies[0], folder, asked)
    return _several(studies, folder, asked)


class _Asked(TypedDict):
    """What is asked of a study, or of several."""

    response: Response
    base: str
    seed: int | None
    cache: Path
    tell: Callable[[str], None]


def _one(study: Path, folder: Path, asked: _Asked) -> DiscoveryResult:
    from frictus_service.discovery.discover import discover_study
    from frictus_service.discovery.report import page
    from frictus_service.discovery.report.findings import verdict_sentence

    found = discover_study(study, **asked)
    asked["tell"]("writing the report")
    page.write(found, folder)
    return DiscoveryResult(
        verdict=found.verdict,
        sentence=verdict_sentence(found),
        causes=tuple(cause.id for cause in found.causes),
    )


def _several(studies: Sequence[Path], folder: Path, asked: _Asked) -> DiscoveryResult:
    from frictus_service.discovery.across_studies import page
    from frictus_service.discovery.across_studies.across import discover_across

    found = discover_across(studies, folder, **asked)
    asked["tell"]("writing the report")
    page.write(found, folder)
    return DiscoveryResult(
        verdict=None,
        sentence=found.sentence,
        causes=tuple(cause.id for cause in found.causes if cause.in_model),
    )


def _base(spec: DiscoverySpec, folder: Path) -> str:
    if isinstance(spec.base, str):
        return spec.base
    kept = folder / BASE
    replace_file(kept, spec.base.to_json())
    return str(kept)


FOLDER: Final = "discoveries"
EVENTS: Final = "events.jsonl"
_NAME: Final = re.compile(STUDY_NAME)
_MOST_LISTED: Final = 20


class DiscoveryStore(JobFolder[DiscoveryJob]):
    """Keeps discoveries; one process per folder writes it, from any of its threads.

    Parameters
    ----------
    studies : Path
        The folder of studies.
    """

    def __init__(self, studies: Path) -> None:
        super().__init__(studies / FOLDER, DiscoveryJob, "discovery", UnknownDiscoveryError)
        self._studies = studies

    def study(self, name: str) -> Path:
        """Return the absolute path of a study.

        Raises
        ------
        UnknownStudyError
        """
        folder = self._studies.resolve()
        try:
            path = folder / name
            if path.is_file() and (real := path.resolve()).is_relative_to(folder):
                return real
        except OSError as error:
            if error.errno != errno.ENAMETOOLONG:
                raise
        there = listed(sorted(self.studies()), _MOST_LISTED) or "none"
        raise UnknownStudyError(f"no study {name!r} in the folder of studies; there: {there}")

    def studies(self) -> dict[str, Path]:
        """Return the studies that a discovery can name, and their absolute paths."""
        folder = self._studies.resolve()
        found = {}
        for path in (*folder.glob("*.h5"), *folder.glob("*/study.h5")):
            name = path.relative_to(folder).as_posix()
            # A pipe or a link to itself that is called like one is no study.
            wanted = _NAME.fullmatch(name) and path.is_file()
            if wanted and path.resolve().is_relative_to(folder):
                found[name] = path
        return found

    def create(self, spec: DiscoverySpec, by: str) -> DiscoveryJob:
        """Queue a discovery.

        Raises
        ------
        UnknownStudyError
        """
        for name in spec.studies:
            self.study(name)
        return self.add(by, {"spec": spec})

    def progress(self, discovery: str, progress: DiscoveryProgress) -> None:
        """Keep what a running discovery is at."""
        with self._lock:
            job = self._read(discovery)
            update = {"progress": progress, "updated_utc_ns": time.time_ns()}
            with self._telling(job.id, "progress", progress.model_dump_json()):
                super()._keep(job.model_copy(update=update))

    def events(self, discovery: str, after: int) -> list[DiscoveryEvent]:
        """Return what a discovery told after an event, in order.

        Parameters
        ----------
        discovery : str
            Its id.
        after : int
            Number of the last event that is known; 0: from the beginning.
        """
        with self._lock:
            told = _whole_lines(self.folder(discovery) / EVENTS).splitlines()
        return [DiscoveryEvent.model_validate_json(line) for line in told[after:]]

    def _keep(self, job: DiscoveryJob) -> None:
        with self._telling(job.id, "state", json.dumps(job.state)):
            super()._keep(job)

    @contextlib.contextmanager
    def _telling(self, discovery: str, kind: str, data: str) -> Iterator[None]:
        """Add an event before what it tells is kept; take it back where that is refused.

        Whoever sees that a job has ended finds its last event.
        """
        path = self.folder(discovery) / EVENTS
        before = _whole_lines(path)
        event = {"number": 1 + before.count(b"\n"), "kind": kind, "data": data}
        with path.open("ab") as told:
            told.truncate(len(before))
            told.write(json.dumps(event).encode() + b"\n")
            told.flush()
            os.fsync(told.fileno())
        try:
            yield
        except OSError:
            with contextlib.suppress(OSError):  # of a folder that has gone
                os.truncate(path, len(before))
            raise


def _whole_lines(path: Path) -> bytes:
    """Return a file up to its last whole line: a crash may have cut one off."""
    content = path.read_bytes() if path.exists() else b""
    return content[: content.rfind(b"\n") + 1]
