"""A trial from blocks: in any order, whatever is missing is NaN, too much is refused."""

import numpy as np
import pytest
from numpy.typing import NDArray

from frictus.block import Block, Flag
from frictus.messages import TouchState
from frictus_service.calibration.trial_capture import CHANNELS, Stream, TrialCapture
from frictus_service.errors import CaptureError
from frictus_service.study.trial import TrialInfo

RATE_HZ = 20_000.0
FIRST, N = 1_037, 2_000
IDS: dict[Stream, int] = {"force": 1, "accel": 2, "voltage": 3}
UTC_NS = 1_795_000_000_000_000_000
INFO = TrialInfo(
    id="t",
    participant="P01",
    session=1,
    order=0,
    speed_mm_s=40.0,
    force_n=0.4,
    tones_hz=(100.0,),
    drive_vpp=150.0,
    sample_rate_hz=RATE_HZ,
    started_utc="2026-01-31T12:00:00+00:00",
)


def told(stream: Stream, sample: NDArray[np.int64]) -> NDArray[np.float32]:
    """Return what a stream says at a device sample: each channel something else."""
    channel = np.arange(CHANNELS[stream])[:, np.newaxis]
    return (IDS[stream] + 10.0 * channel + 1e-3 * sample).astype(np.float32)


def block(stream: Stream, first: int, n: int = 100) -> Block:
    at = np.arange(first, first + n)
    utc_ns = UTC_NS + round(1e9 * first / RATE_HZ)
    return Block(
        IDS[stream], 1, first // n, first, utc_ns, 1, RATE_HZ, Flag(0), told(stream, at)
    )


def touch(sample: float, in_contact: bool = True) -> TouchState:
    return TouchState(
        run=1,
        sample=sample,
        x_mm=1e-3 * sample,
        y_mm=17.0,
        in_contact=in_contact,
        source="touch",
    )


def filled(rng: np.random.Generator, lost: dict[Stream, int] | None = None) -> TrialCapture:
    """Return a capture that was given everything, shuffled, but for some blocks within."""
    capture = TrialCapture(FIRST, N, RATE_HZ)
    arrivals = [
        (stream, first)
        for stream in CHANNELS
        for first in range(500, 4_000, 100)
        if first not in range(2_000, 2_000 + 100 * (lost or {}).get(stream, 0))
    ]
    for place in rng.permutation(len(arrivals)):
        stream, first = arrivals[place]
        capture.add_block(stream, block(stream, first))
    for sample in rng.permutation(np.arange(0.0, 6_000.0, 333.3)):
        capture.add_touch(touch(float(sample)))
    return capture


def test_what_arrives_in_any_order_is_put_in_its_place(rng: np.random.Generator) -> None:
    capture = filled(rng)
    trial = capture.trial(INFO)
    at = np.arange(FIRST, FIRST + N)
    np.testing.assert_array_equal(trial.force_n, told("force", at).T)
    np.testing.assert_array_equal(trial.accel_m_s2, told("accel", at).T)
    np.testing.assert_array_equal(trial.voltage_v, told("voltage", at)[0])
    assert trial.voltage_source == "monitor"
    assert capture.utc_ns == pytest.approx(UTC_NS + 1e9 * FIRST / RATE_HZ, abs=2)


def test_touches_have_the_times_of_their_samples(rng: np.random.Generator) -> None:
    capture = filled(rng)
    capture.add_touch(touch(FIRST + 10.0, in_contact=False))
    trial = capture.trial(INFO)
    assert np.all(np.diff(trial.position_t_s) > 0.0)
    sample = FIRST + RATE_HZ * trial.position_t_s
    np.testing.assert_allclose(trial.position_mm[:, 0], 1e-3 * sample)
    assert trial.position_t_s[0] >= -0.15
    assert trial.position_t_s[-1] <= N / RATE_HZ + 0.15
    assert trial.position_t_s[0] < 0.0 < N / RATE_HZ < trial.position_t_s[-1]


def test_what_is_missing_is_nan_and_counted(rng: np.random.Generator) -> None:
    capture = filled(rng, {"accel": 1})
    assert capture.missing() == {"force": 0, "accel": 100, "voltage": 0}
    trial = capture.trial(INFO)
    assert trial.accel_m_s2 is not None
    (gap,) = np.nonzero(np.isnan(trial.accel_m_s2[:, 0]))
    np.testing.assert_array_equal(gap, np.arange(2_000 - FIRST, 2_100 - FIRST))


@pytest.mark.parametrize("stream", CHANNELS)
def test_too_much_missing_is_refused(rng: np.random.Generator, stream: Stream) -> None:
    with pytest.raises(CaptureError, match=f"of 2000 samples of {stream}"):
        filled(rng, {stream: 2}).trial(INFO)


def test_a_finger_that_was_not_seen_is_refused(rng: np.random.Generator) -> None:
    capture = TrialCapture(FIRST, N, RATE_HZ)
    for stream in CHANNELS:
        capture.add_block(stream, block(stream, 1_000, 3_000))
    with pytest.raises(CaptureError, match="not on the screen"):
        capture.trial(INFO)
