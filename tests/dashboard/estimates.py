"""Estimates of a finger as a tracker publishes them, for a page to show."""

import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

import frictus
from frictus.keys import Topics
from frictus.messages import (
    EstimateState,
    Interval,
    LawNow,
    LawValues,
    ModelChange,
    ResponsePoint,
)
from frictus.session import declare_latest_publisher
from frictus_hardware.physics.friction import FrictionLaw, frequency_response

IN_FORCE = LawValues(gain_n=0.39, cutoff_20_hz=660.0, cutoff_100_hz=1_770.0)
LEARNED = LawValues(gain_n=0.46, cutoff_20_hz=1_400.0, cutoff_100_hz=2_200.0)
SPEEDS_MM_S = (24.0, 52.0, 96.0)
PERIOD_S = 0.5
"""A tracker publishes twice a second."""


def law_of(values: LawValues) -> FrictionLaw:
    """Return the law of the twin that has these values."""
    slope = (values.cutoff_100_hz - values.cutoff_20_hz) / 80.0
    return FrictionLaw(
        gain_n=values.gain_n,
        cutoff_0_hz=values.cutoff_20_hz - 20.0 * slope,
        slope_hz_per_mm_s=slope,
    )


def points_of(
    values: LawValues, speeds_mm_s: Sequence[float] = SPEEDS_MM_S, scatter_db: float = 0.15
) -> tuple[ResponsePoint, ...]:
    """Return what is measured of a law in bands of a sixth of an octave, with scatter."""
    rng = np.random.default_rng(7)
    found = []
    for speed_mm_s in speeds_mm_s:
        centre_hz = 50.0 * 2.0 ** (np.arange(0, 31, 2) / 6.0)
        response = frequency_response(law_of(values), centre_hz, speed_mm_s)
        for hz, at in zip(centre_hz, response, strict=True):
            half_db = 0.3 + 0.6 * (hz / 1_600.0)
            found.append(
                ResponsePoint(
                    speed_mm_s=speed_mm_s,
                    centre_hz=float(hz),
                    gain_n=float(abs(at) * 10.0 ** (scatter_db * rng.normal() / 20.0)),
                    half_width_db=float(half_db),
                    phase_deg=float(np.degrees(np.angle(at))),
                )
            )
    return tuple(found)


def around(value: float, share: float) -> Interval:
    """Return a value with an interval of a share of it to each side."""
    return Interval(value=value, low=value * (1.0 - share), high=value * (1.0 + share))


def felt(**changes: Any) -> EstimateState:
    """Return the estimate of a finger that the model in force does not fit, yet unalarmed."""
    law = LawNow(
        gain_n=around(LEARNED.gain_n, 0.04),
        cutoff_20_hz=around(LEARNED.cutoff_20_hz, 0.03),
        cutoff_100_hz=around(LEARNED.cutoff_100_hz, 0.025),
        delay_us=Interval(value=52.0, low=50.1, high=53.9),
    )
    state = EstimateState(
        utc_ns=time.time_ns(),
        run=1,
        windows=240,
        refused={"speed outside 10 to 150 mm/s": 31, "the finger turned": 12},
        model_etag="m1",
        law=law,
        in_force=IN_FORCE,
        points=points_of(LEARNED),
        error_db={"in_force": 2.14, "first": 2.14, "newest": 0.02},
        gain_nats={"in_force": 0.0, "newest": 412.5},
        evidence={"gain": 3.1, "cutoff": 4.4, "delay": 0.02, "mains_interference": 0.1},
        alarm_nats=6.4,
        held_back="gain and cutoff are known within 7.1 % where the finger went; 5 % is asked",
    )
    return state.model_copy(update=changes)


def halfway(share: float) -> LawValues:
    """Return a law that lies between that in force and that learned."""
    before, after = IN_FORCE.model_dump(), LEARNED.model_dump()
    return LawValues(
        **{name: before[name] + share * (after[name] - before[name]) for name in after}
    )


def nothing_felt() -> EstimateState:
    """Return what a tracker publishes before anybody slid over anything."""
    return EstimateState(
        utc_ns=time.time_ns(), run=1, windows=0, refused={"nothing plays": 18}, alarm_nats=6.4
    )


def alarmed() -> EstimateState:
    """Return an estimate under which the model in force is wrong."""
    return felt(
        evidence={
            "cutoff": 31.0,
            "speed_dependent_cutoff": 12.0,
            "unknown": 9.2,
            "gain": 2.2,
            "cutoff_drift": 1.4,
            "delay": 0.02,
        },
        alarms=("cutoff", "unknown"),
        advice={
            "cutoff": "1.9 times that of the model so far: recalibrate this person",
            "unknown": "about 400 Hz at 20 to 40 mm/s: run `frictus discover`",
        },
    )


def adapted(count: int = 2) -> EstimateState:
    """Return an estimate of a rig whose model has followed the finger."""
    begun_ns = time.time_ns() - 90 * 10**9
    changes = tuple(
        ModelChange(
            utc_ns=begun_ns + 20 * n * 10**9,
            etag_before=f"m{n}",
            etag_after=f"m{n + 1}",
            before=halfway(n / count),
            after=halfway((n + 1) / count),
            reason="cutoff 31 nats, half width 3 % at 24 to 96 mm/s",
        )
        for n in range(count)
    )
    return felt(
        in_force=LEARNED,
        error_db={"in_force": 0.31, "first": 2.14, "newest": 0.02},
        gain_nats={"in_force": 380.0, "newest": 412.5},
        policy="adapt",
        changes=changes,
        held_back="",
        evidence={"gain": 0.2, "cutoff": 0.1},
    )


class EstimatePublisher:
    """A tracker's publisher: repeats an estimate, as of now, until it is stopped.

    Parameters
    ----------
    rig : Rig
        That it is beside.
    client : Client
        Connected to the rig's router.
    """

    def __init__(self, rig: frictus.Rig, client: frictus.Client) -> None:
        key = rig.keys.of(Topics.ESTIMATE)
        self._publisher = declare_latest_publisher(client.session, key, Topics.ESTIMATE)
        self._state = nothing_felt()
        self._changed = threading.Event()
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def show(self, state: EstimateState) -> None:
        """Publish this from now on."""
        self._state = state
        self._changed.set()

    def _run(self) -> None:
        while not self._over.is_set():
            self._changed.clear()
            state = self._state.model_copy(update={"utc_ns": time.time_ns()})
            self._publisher.put(state.to_json())
            self._changed.wait(PERIOD_S)

    def stop(self) -> None:
        """Publish nothing any more, as a tracker that has ended."""
        self._over.set()
        self._changed.set()
        self._thread.join()
        self._publisher.undeclare()  # type: ignore[no-untyped-call]


@contextmanager
def tracked(
    client: frictus.Client, rig: frictus.Rig, state: EstimateState
) -> Iterator[EstimatePublisher]:
    """Have a rig tracked within the block."""
    publisher = EstimatePublisher(rig, client)
    publisher.show(state)
    try:
        yield publisher
    finally:
        publisher.stop()
