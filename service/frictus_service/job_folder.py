"""Jobs that are kept in folders: one folder each, with `job.json`, where the job stands.

A `job.json` that was torn is set aside as `job.json.damaged`. One that another version of
frictus wrote stays, for that version to read. Either is told in the log, and the others are
served.
"""

import contextlib
import logging
import os
import re
import secrets
import shutil
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, Generic, Literal, TypeVar

from pydantic import ValidationError

from frictus.lenient import Exact
from frictus_service.durable import replace_file
from frictus_service.errors import JobElsewhereError, JobStateError, UnknownJobError
from frictus_service.job_locks import hold, let_go

State = Literal["queued", "running", "interrupted", "cancelled", "failed", "done"]
ACTIVE: Final[tuple[State, ...]] = ("queued", "running")
JOB: Final = "job.json"
DAMAGED: Final = ".damaged"
_ID: Final = re.compile(r"[0-9a-f-]{1,64}")
_LOG: Final = logging.getLogger(__name__)


class FolderJob(Exact):
    """A job and where it stands."""

    id: str
    state: State
    created_utc_ns: int
    created_by: str
    updated_utc_ns: int
    failure: str | None = None


Job = TypeVar("Job", bound=FolderJob)


class JobFolder(Generic[Job]):
    """Keeps the jobs of one kind; one process writes each job, from any of its threads.

    Which one is said by who holds it (`job_locks`), from when it is queued until it has ended.

    Parameters
    ----------
    root : Path
        Holds a folder for each job.
    document : type
        Of `job.json`.
    kind : str
        What a job is called in messages, such as ``discovery``.
    unknown : type
        Raised where there is no such job.

    Attributes
    ----------
    kind : str
        As given.
    changes : int
        Grows whenever a job is in another state, or is found to be gone.
    """

    def __init__(
        self,
        root: Path,
        document: type[Job],
        kind: str,
        unknown: type[UnknownJobError],
    ) -> None:
        self.kind = kind
        self.changes = 0
        self._root, self._document, self._unknown = root, document, unknown
        self._lock = threading.Lock()
        self._told: set[str] = set()
        self._kept: set[str] = set()

    def folder(self, job: str) -> Path:
        """Return the absolute path of a job's folder."""
        return self._root.absolute() / job

    def add(
        self, by: str, fields: dict[str, Any], files: Mapping[str, bytes] | None = None
    ) -> Job:
        """Queue a job, and return it.

        Parameters
        ----------
        by : str
            Who asks.
        fields : dict
            Of the document, beyond those of every job.
        files : mapping of str to bytes or None
            What else its folder holds, by name.
        """
        now_ns = time.time_ns()
        began = time.strftime("%Y%m%d-%H%M%S", time.gmtime(now_ns / 1e9))
        job = self._document(
            id=f"{began}-{now_ns // 1_000 % 1_000_000:06d}{secrets.token_hex(2)}",
            state="queued",
            created_utc_ns=now_ns,
            created_by=by,
            updated_utc_ns=now_ns,
            **fields,
        )
        folder = self.folder(job.id)
        with self._lock:
            folder.mkdir(parents=True)
            hold(folder.parent, job.id)
            try:
                for name, content in (files or {}).items():
                    replace_file(folder / name, content)
                self._keep(job)
            except BaseException:  # a job that was not accepted is none
                let_go(folder.parent, job.id)
                shutil.rmtree(folder, ignore_errors=True)
                raise
        return job

    def get(self, job: str) -> Job:
        """Return where a job stands.

        Raises
        ------
        UnknownJobError
        """
        with self._lock:
            return self._read(job)

    def state(self, job: str) -> State:
        """Return in which state a job is.

        Raises
        ------
        UnknownJobError
        """
        return self.get(job).state

    def newest(self) -> Iterator[Job]:
        """Yield all jobs, newest first, each read as it is asked for."""
        # Their names begin with the time.
        names = sorted((path.parent.name for path in self._root.glob(f"*/{JOB}")), reverse=True)
        for name in names:
            with contextlib.suppress(UnknownJobError):  # set aside, and said
                yield self.get(name)

    def all(self) -> list[Job]:
        """Return all jobs, newest first."""
        return list(self.newest())

    def change(self, job: str, to: State, *, of: Sequence[State], **fields: Any) -> Job:
        """Put a job into another state, and return it.

        Parameters
        ----------
        job : str
            Its id.
        to : str
            The new state.
        of : sequence of str
            States that it may be in now.
        **fields : Any
            Of the document, with the new state; without ``failure`` there is none.

        Raises
        ------
        UnknownJobError, JobStateError
        JobElsewhereError
            If another process runs it.
        """
        with self._lock:
            try:
                found = self._read(job)
            except UnknownJobError:
                self.changes += 1  # whoever follows it learns that it is gone
                let_go(self._root.absolute(), job)
                raise
            if found.state not in of:
                raise JobStateError(
                    f"{self.kind} {job} is {found.state}: this is for one that is "
                    f"{' or '.join(of)}"
                )
            if not hold(self._root.absolute(), job):
                raise JobElsewhereError(
                    f"{self.kind} {job} is run by another API that works in the same folder: "
                    "ask that one, or end it; each API has a folder of studies of its own"
                )
            now = {"state": to, "updated_utc_ns": time.time_ns(), "failure": None}
            changed = found.model_copy(update=now | fields)
            self._keep(changed)
            if to not in ACTIVE:
                let_go(self._root.absolute(), job)
        return changed

    def interrupt(self) -> None:
        """Note that whatever ran, or waited, does so no more, but for what another API runs."""
        for job in self.all():
            if job.state in ACTIVE:
                try:
                    self.change(job.id, "interrupted", of=ACTIVE)
                except JobElsewhereError as error:
                    _LOG.warning("%s", error)
                except OSError as error:  # what can be read is served nevertheless
                    _LOG.warning("%s %s cannot be kept: %s", self.kind, job.id, error)

    def _read(self, job: str) -> Job:
        path = self.folder(job) / JOB
        if job in self._kept and not path.is_file():
            raise self._unknown(
                f"{self.kind} {job} is gone: {path.parent} was deleted or moved; put it "
                "back, or begin another one"
            )
        if not _ID.fullmatch(job) or not path.is_file():
            raise self._unknown(f"no {self.kind} {job[:80]!r}")
        try:
            return self._document.model_validate_json(path.read_bytes())
        except (ValidationError, OSError) as error:
            torn = isinstance(error, ValidationError) and _is_torn(error)
            ours = "it is torn" if torn else "another version of frictus wrote it"
            reason = error.strerror if isinstance(error, OSError) else ours
            told = f"{path} cannot be read ({reason})"
            if torn:
                with contextlib.suppress(OSError):  # of a folder that is read-only
                    os.replace(path, path.with_name(path.name + DAMAGED))
                    told += f" and was set aside as {path.name}{DAMAGED}"
            if told not in self._told:
                self._told.add(told)
                _LOG.warning("%s: the others are served", told)
            raise self._unknown(told) from error

    def _keep(self, job: Job) -> None:
        """Write where a job stands; called with the lock held."""
        content = job.model_dump_json(by_alias=True, indent=2)
        replace_file(self.folder(job.id) / JOB, content.encode())
        self._kept.add(job.id)
        self.changes += 1


def _is_torn(error: ValidationError) -> bool:
    """Return whether what was read is no JSON at all."""
    faults = error.errors(include_url=False, include_input=False, include_context=False)
    return faults[0]["type"] == "json_invalid"
