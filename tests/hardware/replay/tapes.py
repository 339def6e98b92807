"""Tapes whose samples are functions of their device index."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from frictus_hardware.replay.tape import Tape

RATE_HZ = 20_000.0
LATENCY_S = 0.03
STEP_N = 0.0005
PERIOD = 333
"""Samples from one touch report to the next."""


def force_counts(index: NDArray[np.int64]) -> NDArray[np.int16]:
    """What the converter gave at device samples."""
    channel = np.array([1, 3, 5])
    counts: NDArray[np.int64] = index[:, np.newaxis] * 7_919 * channel % 4_001 - 2_000
    return counts.astype(np.int16)


def accel_of(index: NDArray[np.int64]) -> NDArray[np.float32]:
    phase: NDArray[np.float64] = 0.01 * index[:, np.newaxis] * np.array([1.0, 2.0, 3.0])
    return np.sin(phase).astype(np.float32)


def volts_of(index: NDArray[np.int64]) -> NDArray[np.float32]:
    return np.sin(0.3 * index.astype(np.float64)).astype(np.float32) * np.float32(40.0)


def sine_tape(spans: Sequence[tuple[int, int]] = ((0, 30_000),), **changes: object) -> Tape:
    """Return a tape that has these spans of device samples, first and one past the last."""
    index = np.concatenate([np.arange(first, end) for first, end in spans])
    lengths = [end - first for first, end in spans]
    first, end = spans[0][0], spans[-1][1]
    arrival = np.arange(first + 50, end, PERIOD)
    place = arrival.astype(np.float64)
    tape = Tape(
        name="sines",
        finger_source="touch",
        sample_rate_hz=RATE_HZ,
        lead_samples=400,
        screen_mm=(70.0, 35.0),
        screen_peak_v=60.0,
        touch_latency_s=LATENCY_S,
        force=force_counts(index),
        force_step_n=STEP_N,
        accel=accel_of(index),
        accel_step_m_s2=1.0,
        voltage_v=volts_of(index),
        stretch_row=np.cumsum([0, *lengths[:-1]]),
        stretch_first_sample=np.array([begin for begin, _ in spans]),
        touch_arrival_sample=arrival,
        touch_measured_sample=place + 0.25 - LATENCY_S * RATE_HZ,
        touch_x_mm=10.0 + 0.001 * (place % 50_000.0),
        touch_y_mm=np.full(arrival.size, 20.0),
        touch_in_contact=arrival % 2 == 0,
    )
    return replace(tape, **changes)  # type: ignore[arg-type]
