"""Markers that another program sends on LSL, taken in for a rig's recording."""

import contextlib
import threading
from collections.abc import Callable
from types import TracebackType
from typing import Any, Final, Self

import pylsl

from frictus.messages import MAX_MARKER, MarkerState
from frictus_service.bridges.lsl_clock import LslClock

WAIT_S: Final = 0.2
CORRECTION_S: Final = 5.0
"""Longest wait for how far the other machine's clock is off."""


class MarkerInlet:
    """Follows an LSL stream by its name until it is closed; a context manager.

    Parameters
    ----------
    name : str
        Of the stream; one that is not there yet is waited for, one that went is looked for.
    clock : LslClock
        Gives the UTC of local time.
    take : callable
        Gets each marker, in a thread of the inlet's.

    Attributes
    ----------
    received : int
        Markers taken in.
    unreadable : int
        Those that have no time which a clock could say.
    """

    def __init__(self, name: str, clock: LslClock, take: Callable[[MarkerState], None]) -> None:
        self.received = self.unreadable = 0
        self._name = name
        self._clock = clock
        self._take = take
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._follow, name="lsl-markers", daemon=True)
        self._thread.start()

    def _follow(self) -> None:
        resolver = pylsl.ContinuousResolver(prop="name", value=self._name)
        while not self._over.wait(WAIT_S):
            found = resolver.results()
            if found:
                # A lost one is looked for anew: it may come back with other channels.
                with contextlib.suppress(RuntimeError):  # whatever pylsl raises
                    self._read(pylsl.StreamInlet(found[0], recover=False, as_numpy=True))

    def _read(self, inlet: Any) -> None:
        inlet.open_stream(CORRECTION_S)
        inlet.time_correction(CORRECTION_S)
        while not self._over.is_set():
            sample, stamp_s = inlet.pull_sample(WAIT_S)
            if sample is not None:
                self._pass_on(sample.tolist(), stamp_s + inlet.time_correction(CORRECTION_S))

    def _pass_on(self, sample: list[Any], local_s: float) -> None:
        text = " ".join(_text(value) for value in sample)[:MAX_MARKER]
        try:
            utc_ns = self._clock.utc_of(local_s)
            marker = MarkerState(utc_ns=utc_ns, source=f"lsl: {self._name}"[:100], text=text)
        except (ValueError, OverflowError):
            self.unreadable += 1
            return
        self._take(marker)
        self.received += 1

    def close(self) -> None:
        """Stop following."""
        self._over.set()
        self._thread.join()

    def __enter__(self) -> Self:
        """Return self."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Close."""
        self.close()


def _text(value: object) -> str:
    return value.decode(errors="replace") if isinstance(value, bytes) else str(value)
