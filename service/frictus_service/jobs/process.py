"""The process of one job as whoever started it sees it, and what both say to one another."""

import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Annotated, Final, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter

from frictus.experiment import Protocol
from frictus.tls import Tls
from frictus_service.calibration.job import CalibrationResult, CalibrationSpec, Progress
from frictus_service.discovery.jobs import (
    DiscoveryProgress,
    DiscoveryResult,
    DiscoverySpec,
)
from frictus_service.errors import JobStateError
from frictus_service.experiments.job import ExperimentJob, Input, ParticipantScreen


class _Word(BaseModel):
    model_config = ConfigDict(frozen=True)


class Order(_Word):
    """The one line that the process of a calibration is given."""

    kind: Literal["calibration"] = "calibration"
    run: str
    """``module:function``, called as `frictus_service.calibration.run.run_calibration` is."""
    client: str
    """Its name to the rigs."""
    router: str
    tls: Tls | None = None
    spec: CalibrationSpec
    folder: Path
    """Of this calibration alone."""


class DiscoveryOrder(_Word):
    """The one line that the process of a discovery is given."""

    kind: Literal["discovery"] = "discovery"
    run: str
    """``module:function``, called as `discovery.jobs.carry_out` is."""
    spec: DiscoverySpec
    study: Path
    folder: Path
    """Of this discovery alone."""


class ExperimentOrder(_Word):
    """What the process of an experiment is given; a line for each `Input` follows."""

    kind: Literal["experiment"] = "experiment"
    run: str
    """``module:function``, called as `experiments.run.run_experiment` is."""
    client: str
    """Its name to the rigs."""
    router: str
    tls: Tls | None = None
    site: str
    job: ExperimentJob
    protocol: Protocol
    folder: Path
    """Of this experiment alone."""


AnyOrder = Annotated[Order | DiscoveryOrder | ExperimentOrder, Field(discriminator="kind")]
"""When the input of a process ends behind it, it shall stop."""
ORDER: Final[TypeAdapter[AnyOrder]] = TypeAdapter(AnyOrder)
INPUT: Final[TypeAdapter[Input]] = TypeAdapter(Input)


class Moved(_Word):
    """A calibration goes on."""

    kind: Literal["moved"] = "moved"
    progress: Progress


class Done(_Word):
    """A calibration has ended well."""

    kind: Literal["done"] = "done"
    result: CalibrationResult


class Looked(_Word):
    """A discovery goes on."""

    kind: Literal["looked"] = "looked"
    progress: DiscoveryProgress


class Found(_Word):
    """A discovery has ended well."""

    kind: Literal["found"] = "found"
    result: DiscoveryResult


class ScreenChanged(_Word):
    """An experiment shows something else."""

    kind: Literal["shown"] = "shown"
    screen: ParticipantScreen


class Completed(_Word):
    """An experiment has had its last trial."""

    kind: Literal["completed"] = "completed"


class Failed(_Word):
    """It cannot go on."""

    kind: Literal["failed"] = "failed"
    reason: str


class Stopped(_Word):
    """It has ended because it was told to."""

    kind: Literal["stopped"] = "stopped"


Said = Annotated[
    Moved | Done | Looked | Found | ScreenChanged | Completed | Failed | Stopped,
    Field(discriminator="kind"),
]
SAID: Final[TypeAdapter[Said]] = TypeAdapter(Said)


MOST_UNHEARD: Final = 16
"""Words that a process is given while it says nothing: they fit into any pipe."""
GRACE_S: Final = 30.0
"""What a process that was told to stop has for ending in order; then it is killed."""


class JobProcess:
    """A job under way, entered while it runs. Nothing here waits for a process that is stuck.

    Parameters
    ----------
    order : Order, DiscoveryOrder or ExperimentOrder
        What the process is told.
    """

    def __init__(self, order: AnyOrder) -> None:
        # Not of multiprocessing: the API process is itself a daemon, which may have no children
        # there. Both ends close with either process, however it ends.
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", "frictus_service.jobs.worker"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        self._order = order
        self._closing = threading.Lock()
        self._unheard = 0
        self._last_resort: threading.Timer | None = None

    @property
    def pid(self) -> int:
        """Process id."""
        return self._process.pid

    def __enter__(self) -> Self:
        """Give the order."""
        self.tell(self._order)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """End it, if it has not ended, and wait."""
        self.stop()
        assert self._process.stdout is not None
        self._process.stdout.close()
        self._process.wait()
        if self._last_resort is not None:
            self._last_resort.cancel()

    def tell(self, word: BaseModel) -> None:
        """Give it a line; from any thread. One that has ended, or was told to stop, gets none.

        Parameters
        ----------
        word : BaseModel
            Its order, or what it waits for.

        Raises
        ------
        JobStateError
            If it has said nothing to the last 16 words: a full pipe would hold up who tells.
        """
        assert self._process.stdin is not None
        with self._closing:
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

    def said(self) -> Iterator[Said]:
        """Yield what it says, until it ends."""
        assert self._process.stdout is not None
        for line in self._process.stdout:
            if line.endswith(b"\n"):  # or it was killed while it said this
                self._unheard = 0
                yield SAID.validate_json(line)

    def stop(self) -> None:
        """Tell it to stop; from any thread, any number of times. One that stays is killed."""
        assert self._process.stdin is not None
        with self._closing:
            if self._last_resort is None:
                self._last_resort = threading.Timer(GRACE_S, self._process.kill)
                self._last_resort.daemon = True
                self._last_resort.start()
            try:
                self._process.stdin.close()
            except OSError:
                pass  # what was not sent yet needs not be sent any more
