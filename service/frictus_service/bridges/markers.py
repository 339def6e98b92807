"""Markers: what happens on a rig as texts with a time, and what other programs send on LSL."""

import contextlib
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, Final

import pylsl

from frictus.closing import Closing
from frictus.messages import (
    MAX_MARKER,
    GuidanceState,
    MarkerState,
    Message,
    RigStatus,
    SceneState,
)
from frictus_service.bridges.lsl_clock import LslClock


@dataclass(frozen=True, slots=True)
class Marker:
    """An event.

    Attributes
    ----------
    utc_ns : int
        When, by the rig's clock; 0: it does not say.
    text : str
        One word that says what kind it is, and what it is.
    """

    utc_ns: int
    text: str


@dataclass(slots=True)
class MarkerDetector:
    """Finds what has changed in what a rig says again and again; the first is a change, too."""

    _last: dict[str, str] = field(default_factory=dict)

    def markers_of(self, message: Message) -> list[Marker]:
        """Return what has changed with a message.

        Parameters
        ----------
        message : Message
            A scene, a status or a guidance; others change nothing.
        """
        found = []
        for utc_ns, kind, detail in _facts(message):
            if self._last.get(kind) != detail:
                known = kind in self._last
                self._last[kind] = detail
                if detail or known:  # no fault is no event before there was one
                    found.append(Marker(utc_ns, f"{kind} {detail or 'cleared'}"))
        return found


def _facts(message: Message) -> Iterator[tuple[int, str, str]]:
    """Yield time, kind and value of what a message says."""
    match message:
        case SceneState():
            name = f" {message.scene.name}" if message.scene.name else ""
            source = "" if message.source == "scene" else f"{message.source} "
            yield message.utc_ns or 0, "scene", f"{source}{message.etag}{name}"
        case RigStatus():
            yield message.utc_ns, "run", str(message.run)
            yield message.utc_ns, "state", message.state
            fault = message.fault
            if fault is None:
                yield message.utc_ns, "fault", ""
            else:
                yield fault.utc_ns, "fault", f"{fault.kind}: {fault.reason}"
        case GuidanceState():
            yield message.utc_ns, "trial", f"{message.trial} {message.phase}"


WAIT_S: Final = 0.2
CORRECTION_S: Final = 5.0
"""Longest wait for how far the other machine's clock is off."""


class MarkerInlet(Closing):
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


def _text(value: object) -> str:
    return value.decode(errors="replace") if isinstance(value, bytes) else str(value)
