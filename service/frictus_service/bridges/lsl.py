"""The bridge to Lab Streaming Layer: streams and markers of a rig as outlets, markers back."""

import contextlib
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import pylsl

from frictus.block import Block
from frictus.client import Client
from frictus.closing import Closing
from frictus.gaps import BlockFeed, Gap
from frictus.keys import Topics
from frictus.messages import FingerState, MarkerState, Message, TimeState
from frictus.reception import Feed
from frictus.rig import Rig
from frictus.session import declare_publisher
from frictus_service.bridges.lsl_clock import LslClock
from frictus_service.bridges.lsl_outlets import (
    FINGER,
    FINGER_CHANNELS,
    MarkerOutlet,
    SampleOutlet,
    channels_of,
    described,
)
from frictus_service.bridges.markers import Marker, MarkerDetector, MarkerInlet

QUEUE: Final = 2_048
"""Messages of a topic held while this process is set aside: 10 s of 5 ms blocks."""
SAME_RUN_NS: Final = 500_000_000
"""A finger's state that is further off the fit belongs to another run than the newest."""


@dataclass(frozen=True, slots=True)
class BridgeReport:
    """What a bridge has done so far.

    Attributes
    ----------
    seconds : float
        Since it began.
    sent, filled : dict of str to int
        Samples by stream: measured ones, and NaN in place of lost ones.
    refused : int
        Blocks that have another shape or rate than the outlet.
    markers_sent, markers_received : int
        Events told on LSL, and taken in from there.
    clock_error_ms : float
        How far stamps were off the rig's newest fit when it came.
    cpu_percent : float
        Of one processor, since it began.
    """

    seconds: float
    sent: dict[str, int]
    filled: dict[str, int]
    refused: int
    markers_sent: int
    markers_received: int
    clock_error_ms: float
    cpu_percent: float


class LslBridge(Closing):
    """Sends what a rig publishes to LSL while `turn` is called; a context manager.

    Parameters
    ----------
    client : Client
        Connected; it reads, and publishes markers where there is an inlet.
    rig : Rig
        Is there.
    streams : sequence of str
        Of `lsl_outlets.OUTLETS`; one that the rig has not stays silent.
    inlet : str or None
        Name of an LSL stream whose markers are published as `state/marker`.

    Raises
    ------
    LinkError
        If the rig says nothing.
    """

    def __init__(
        self, client: Client, rig: Rig, streams: Sequence[str], inlet: str | None = None
    ) -> None:
        status = rig.status()
        self._rig = rig
        self._rate_hz = status.sample_rate_hz
        self._block_samples = max(1, status.block_samples)
        self._clock = LslClock(pylsl.local_clock, time.time_ns)
        self._fit = rig.time()
        self._clock.follow(self._fit)
        self._detector = MarkerDetector()
        self._began_s, self._began_cpu_s = time.monotonic(), time.process_time()
        self._refused = 0
        self._markers = MarkerOutlet(status)
        self._outlets: dict[str, SampleOutlet] = {}
        self._blocks: dict[str, BlockFeed] = {}
        with contextlib.ExitStack() as held:
            for name in streams:
                channels = channels_of(name, status)
                if not channels:
                    continue  # a rig without further channels
                per_state = self._block_samples if name == FINGER else 1
                info = described(name, status, self._rate_hz / per_state, channels)
                self._outlets[name] = SampleOutlet(info)
                if name != FINGER:
                    feed = rig.blocks(name, capacity=QUEUE)  # type: ignore[arg-type]
                    self._blocks[name] = held.enter_context(feed)
            # The presence of the rig is watched by its token, which falls with its process.
            self._presence = held.enter_context(client.presence(rig.site))
            self._times = held.enter_context(rig.watch(Topics.TIME))
            self._fingers = held.enter_context(rig.watch(Topics.FINGER, capacity=QUEUE))
            self._states: list[Feed[Message]] = [
                held.enter_context(rig.watch(topic))
                for topic in (Topics.SCENE, Topics.STATUS, Topics.GUIDANCE)
            ]
            self._inlet: MarkerInlet | None = None
            if inlet is not None:
                key = rig.keys.of(Topics.MARKER)
                publisher = declare_publisher(client.session, key, Topics.MARKER)
                held.callback(publisher.undeclare)
                self._inlet = held.enter_context(
                    MarkerInlet(inlet, self._clock, _publishing(publisher))
                )
            self._held = held.pop_all()

    def turn(self) -> None:
        """Send what has come since; does not wait."""
        for fit in self._times.drain():
            assert isinstance(fit, TimeState)
            if self._clock.follow(fit):
                self._fit = fit
        for name, feed in self._blocks.items():
            for item in feed.drain():
                if isinstance(item, Gap):
                    self._tell_gap(name, item)
                else:
                    self._push_block(name, item)
        for state in self._fingers.drain():
            assert isinstance(state, FingerState)
            if FINGER in self._outlets:
                self._push_finger(state)
        for states in self._states:
            for message in states.drain():
                for marker in self._detector.markers_of(message):
                    self._tell(marker)
        for presence in self._presence.drain():
            if presence.rig.name == self._rig.name:
                text = "rig present" if presence.present else "rig gone"
                self._tell(Marker(time.time_ns(), text))

    def report(self) -> BridgeReport:
        """Return what was done so far."""
        seconds = time.monotonic() - self._began_s
        spent_s = time.process_time() - self._began_cpu_s
        return BridgeReport(
            seconds=seconds,
            sent={name: outlet.sent for name, outlet in self._outlets.items()},
            filled={name: outlet.filled for name, outlet in self._outlets.items()},
            refused=self._refused,
            markers_sent=self._markers.sent,
            markers_received=0 if self._inlet is None else self._inlet.received,
            clock_error_ms=self._clock.error_ms,
            cpu_percent=100.0 * spent_s / seconds,
        )

    def _push_block(self, name: str, block: Block) -> None:
        outlet = self._outlets[name]
        per_sample_ns = 1e9 / block.sample_rate_hz
        fits = len(block.data) == outlet.channels and block.sample_rate_hz == self._rate_hz
        if not fits or not self._clock.begin(
            block.run, block.first_sample, block.utc_ns, per_sample_ns
        ):
            self._refused += 1
            return
        rows = np.ascontiguousarray(block.data.T, np.float32)
        outlet.push(
            block.run,
            block.first_sample,
            rows,
            lambda sample: self._clock.stamp_s(block.run, sample),
        )

    def _push_finger(self, state: FingerState) -> None:
        fit = self._fit
        # First whether there can be such a sample: of others the fit's UTC may be no number.
        if (
            not self._clock.begin(fit.run, state.sample, state.utc_ns, fit.ns_per_sample)
            or abs(fit.utc_of(state.sample) - state.utc_ns) > SAME_RUN_NS
        ):
            self._refused += 1
            return
        row = np.array([[getattr(state, one.label) for one in FINGER_CHANNELS]], np.float32)

        def stamp_of(sequence: int) -> float:
            sample = state.sample + (sequence - state.sequence) * self._block_samples
            return self._clock.stamp_s(fit.run, sample)

        self._outlets[FINGER].push(fit.run, state.sequence, row, stamp_of)

    def _tell_gap(self, name: str, gap: Gap) -> None:
        run, sample = self._outlets[name].due
        text = f"gap {name} {gap.samples} {gap.reason} {gap.detail}".rstrip()
        known = run == self._fit.run and self._clock.knows(run)
        now_s = pylsl.local_clock()
        self._markers.push(text, self._clock.stamp_s(run, sample) if known else now_s)

    def _tell(self, marker: Marker) -> None:
        utc_ns = marker.utc_ns or time.time_ns()  # an old rig's scene says no time
        self._markers.push(marker.text, self._clock.local_s(utc_ns))

    def close(self) -> None:
        """Stop; the outlets vanish from the network."""
        self._held.close()
        self._outlets.clear()
        self._markers.close()


def _publishing(publisher: Any) -> Callable[[MarkerState], None]:
    def publish(marker: MarkerState) -> None:
        publisher.put(marker.to_json())

    return publish
