"""The process of one job as whoever started it sees it: what it is given, what it says."""

import queue
import subprocess
import sys
import threading
from abc import abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Final, Literal, Self

from pydantic import BaseModel, ConfigDict, TypeAdapter

import frictus
from frictus.tls import Tls
from frictus_service.config import Config
from frictus_service.errors import JobStateError


@dataclass(frozen=True, slots=True)
class ParentLink:
    """What the work of a job has to do with whoever started its process.

    Attributes
    ----------
    report : callable
        Takes what the job is at.
    inputs : queue
        What it is given while it runs.
    cancelled : callable
        Whether it is to stop.
    """

    report: Callable[[BaseModel], None]
    inputs: "queue.SimpleQueue[Any]"
    cancelled: Callable[[], bool]


class Work(BaseModel):
    """What the process of a job is given as its first line, and what it does with it."""

    model_config = ConfigDict(frozen=True)
    inputs: ClassVar[TypeAdapter[Any] | None] = None
    """Of the lines that follow; None: there are none."""
    run: str
    """``module:function`` that does it."""
    folder: Path
    """Of this job alone."""

    @abstractmethod
    def carry_out(self, run: Callable[..., Any], parent: ParentLink) -> BaseModel | None:
        """Do it in the process of the job, and return what came of it.

        Parameters
        ----------
        run : callable
            As `run` names it.
        parent : ParentLink
            Whoever started the process.
        """


class RigAccount(BaseModel):
    """By what name, and how, a job reaches the rigs."""

    model_config = ConfigDict(frozen=True)
    client: str
    router: str
    tls: Tls | None = None

    @classmethod
    def of(cls, config: Config, created_by: str, kind: str, job: str) -> Self:
        """Return the account of a job.

        Parameters
        ----------
        config : Config
            Its router and certificates are used.
        created_by : str
            Who began the job: whoever finds the rig held reads it.
        kind, job : str
            Kind and id of the job.
        """
        client = f"{created_by}.{kind}-{job[-8:]}"
        return cls(client=client, router=config.router.endpoint, tls=config.tls("client"))

    def connect(self) -> frictus.Client:
        """Return a client of that name.

        Raises
        ------
        LinkError
        """
        return frictus.connect(self.router, self.client, tls=self.tls)


class Word(BaseModel):
    """One thing that the process of a job says; all but ``progress`` are its last."""

    model_config = ConfigDict(frozen=True)
    kind: Literal["progress", "done", "failed", "stopped"]
    """``stopped``: it has ended because it was told to."""
    data: str = ""
    """JSON: what it is at, or what came of it; plain: why it failed."""


MOST_UNHEARD: Final = 16
"""Words that a process is given while it says nothing: they fit into any pipe."""
GRACE_S: Final = 30.0
"""What a process that was told to stop has for ending in order; then it is killed."""


class JobProcess:
    """A job under way, entered while it runs. Nothing here waits for a process that is stuck.

    Parameters
    ----------
    work : Work
        What the process is given.
    """

    def __init__(self, work: Work) -> None:
        # Not of multiprocessing: the API process is itself a daemon, which may have no children
        # there. Both ends close with either process, however it ends.
        kind = f"{type(work).__module__}:{type(work).__name__}"
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", "frictus_service.jobs.worker", kind],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        self._work = work
        self._telling = threading.Lock()
        self._unheard = 0
        self._stopping = False
        self._to_stop = threading.Lock()
        self._last_resort = threading.Timer(GRACE_S, self._process.kill)
        self._last_resort.daemon = True

    @property
    def pid(self) -> int:
        """Process id."""
        return self._process.pid

    def __enter__(self) -> Self:
        """Give it its work."""
        self.tell(self._work)
        return self

    def __exit__(self, *_: object) -> None:
        """End it, if it has not ended, and wait."""
        self.stop()
        assert self._process.stdout is not None
        self._process.stdout.close()
        self._process.wait()
        self._last_resort.cancel()

    def tell(self, word: BaseModel) -> None:
        """Give it a line; from any thread. One that has ended, or was told to stop, gets none.

        Parameters
        ----------
        word : BaseModel
            Its work, or what it waits for.

        Raises
        ------
        JobStateError
            If it has said nothing to the last 16 words: a full pipe would hold up who tells.
        """
        assert self._process.stdin is not None
        with self._telling:
            if self._unheard >= MOST_UNHEARD:
                raise JobStateError(
                    f"its process takes nothing in since it was told {MOST_UNHEARD} things: "
                    "wait, or stop it"
                )
            self._unheard += 1
            try:
                self._process.stdin.write(word.model_dump_json(by_alias=True).encode() + b"\n")
                self._process.stdin.flush()
            except (OSError, ValueError):
                pass  # it has ended already: nothing will be said
        if self._stopping:
            self._end_input()

    def said(self) -> Iterator[Word]:
        """Yield what it says, until it ends."""
        assert self._process.stdout is not None
        for line in self._process.stdout:
            if line.endswith(b"\n"):  # or it was killed while it said this
                self._unheard = 0
                yield Word.model_validate_json(line)

    def stop(self) -> None:
        """Tell it to stop; from any thread, any number of times. One that stays is killed."""
        with self._to_stop:
            if not self._stopping:
                self._stopping = True
                self._last_resort.start()
        self._end_input()

    def _end_input(self) -> None:
        # Work may be larger than a pipe, and one that is stuck takes none: whoever holds the
        # lock then ends the input once it is free.
        if self._telling.acquire(blocking=False):
            assert self._process.stdin is not None
            try:
                self._process.stdin.close()
            except OSError:
                pass  # what was not sent yet needs not be sent any more
            finally:
                self._telling.release()
