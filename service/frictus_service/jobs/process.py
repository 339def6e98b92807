"""The process of one job, as whoever started it sees it."""

import subprocess
import sys
import threading
from collections.abc import Iterator
from types import TracebackType
from typing import Self

from frictus_service.jobs.job_protocol import SAID, AnyOrder, Said


class JobProcess:
    """A job under way, entered while it runs.

    Parameters
    ----------
    order : Order or DiscoveryOrder
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

    @property
    def pid(self) -> int:
        """Process id."""
        return self._process.pid

    def __enter__(self) -> Self:
        """Give the order."""
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(self._order.model_dump_json(by_alias=True).encode())
            self._process.stdin.write(b"\n")
            self._process.stdin.flush()
        except OSError:
            pass  # it has ended already: nothing will be said
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

    def said(self) -> Iterator[Said]:
        """Yield what it says, until it ends."""
        assert self._process.stdout is not None
        for line in self._process.stdout:
            if line.endswith(b"\n"):  # or it was killed while it said this
                yield SAID.validate_json(line)

    def stop(self) -> None:
        """Tell it to stop; from any thread, any number of times."""
        assert self._process.stdin is not None
        with self._closing:
            try:
                self._process.stdin.close()
            except OSError:
                pass  # what was not sent yet needs not be sent any more
