"""One block as the loop hands it over, and what a rig publishes of it."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Final, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from frictus.block import Block, FingerSensor, Flag
from frictus.keys import ACCEL, AUX, FORCE, RENDER, STREAMS, TRUTH, VOLTAGE
from frictus.messages import FingerState, Message, TouchState
from frictus_hardware.base import Exchange, RigInfo, TouchReport
from frictus_service.daemon.block_loop.timebase import Stamp, UtcReading
from frictus_service.synthesis.kernel import BlockMotion

M = TypeVar("M", bound=Message)


@dataclass(frozen=True, slots=True)
class BlockRecord:
    """One block, for the publisher.

    Attributes
    ----------
    run : int
        Changes when the device was opened anew; sample and block counts begin again with it.
    number : int
        Counts the blocks of a run from 0; a jump is a block that the queue could not take.
    exchange : Exchange
        What the device took and sensed.
    in_contact, stale : bool
        Whether a finger was felt, and whether its reports had stopped coming.
    normal_force_n : float
        Mean over the block.
    armed : bool
        Whether the device was armed.
    output : Flag
        What became of the output that played during the block.
    planned : Flag
        The same for what was handed over, from `exchange.play_sample` on.
    motion : BlockMotion
        Of the finger, as predicted for what was handed over.
    target_n, drive : ndarray, shape (n_samples,)
        Friction that it aims at, NaN where there is no target, and drive fraction.
    sensors : FingerSensor
        What the motion was estimated from.
    finger : tuple of float
        Estimate at the end of the sensed samples: x, y in mm and vx, vy in mm/s.
    report_age_s : float
        Of the touch report behind it.
    returned_ns : int
        Monotonic time at which the block was there.
    reading : UtcReading
        Of the clocks when the block was there.
    """

    run: int
    number: int
    exchange: Exchange
    in_contact: bool
    stale: bool
    normal_force_n: float
    armed: bool
    output: Flag
    planned: Flag
    motion: BlockMotion
    target_n: NDArray[np.float64]
    drive: NDArray[np.float64]
    sensors: FingerSensor
    finger: tuple[float, float, float, float]
    report_age_s: float
    returned_ns: int
    reading: UtcReading


OF_OUTPUT: Final = (
    Flag.UNDERRUN
    | Flag.CLIPPED
    | Flag.EXTRAPOLATED
    | Flag.SCALED
    | Flag.OVERRUN
    | Flag.SATURATED
).value
"""What is said of samples that have been played or sensed."""


def flags_of(turn: BlockRecord, info: RigInfo, placeholder: bool) -> Flag:
    """Return what a reader must know of a block's own samples."""
    exchange = turn.exchange
    said = (
        (Flag.ARMED, turn.armed),
        (Flag.OVERRUN, exchange.overrun_samples > 0),
        (Flag.SIMULATED, info.simulated),
        (Flag.STALE_SENSOR, turn.stale),
        (Flag.PLACEHOLDER_MODEL, placeholder),
        (Flag.SUBSTITUTE_SENSOR, info.finger_source == "pointer"),
        (Flag.SATURATED, exchange.saturated_samples > 0),
    )
    # Each flag has a bit of its own; joining enumerations one by one takes 20 times as long.
    return Flag(turn.output.value | sum(flag.value for flag, holds in said if holds))


def blocks_of(
    turn: BlockRecord,
    stamp: Stamp,
    flags: Flag,
    sample_rate_hz: float,
    streams: Iterable[int] = tuple(STREAMS),
) -> Iterator[Block]:
    """Yield a turn's blocks, each made when it is asked for, so that the first one goes first.

    Parameters
    ----------
    turn : BlockRecord
        One block as the loop handed it over.
    stamp : Stamp
        Of the first sample.
    flags : Flag
        Hold for every sample of the block.
    sample_rate_hz : float
        Samples per second of the device's clock.
    streams : iterable of int
        The streams that are wanted; those that the rig does not have yield nothing.
    """
    exchange = turn.exchange
    for stream in streams:
        data = _channels(turn, stream, sample_rate_hz)
        if data is None:
            continue
        first_sample, utc_ns, said = exchange.first_sample, stamp.utc_ns, flags
        if stream == RENDER:  # it has not been played yet
            first_sample = exchange.play_sample
            later = first_sample - exchange.first_sample
            utc_ns += round(1e9 * later / sample_rate_hz)
            said = Flag(flags.value & ~OF_OUTPUT | turn.planned.value)
        yield Block(
            stream,
            turn.run,
            turn.number,
            first_sample,
            utc_ns,
            stamp.uncertainty_ns,
            sample_rate_hz,
            said,
            data,
        )


def _channels(
    turn: BlockRecord, stream: int, sample_rate_hz: float
) -> NDArray[np.float32] | None:
    """Return what a stream carries, shape (n_channels, n_samples); None where there is none."""
    exchange = turn.exchange
    rows: NDArray[np.float64] | None = None
    if stream == FORCE:
        rows = exchange.force_n.T
    elif stream == ACCEL:
        rows = exchange.accel_m_s2.T
    elif stream == VOLTAGE:
        rows = exchange.voltage_v[np.newaxis]
    elif stream == TRUTH and (truth := exchange.truth) is not None:
        rows = np.concatenate(
            (truth.position_mm.T, truth.velocity_mm_s.T, truth.friction_n[np.newaxis])
        )
    elif stream == AUX and exchange.aux is not None:
        rows = exchange.aux.T
    elif stream == RENDER:
        rows = _rendered(turn, sample_rate_hz)
    return None if rows is None else rows.astype(np.float32, order="C")


def _rendered(turn: BlockRecord, sample_rate_hz: float) -> NDArray[np.float64]:
    """Return position, speed, target, drive and sensors at every sample of what is rendered."""
    motion, n_samples = turn.motion, turn.drive.size
    weights = (
        (motion.x_mm, 0.0, motion.vx_0, motion.vx_1 - motion.vx_0),
        (motion.y_mm, 0.0, motion.vy_0, motion.vy_1 - motion.vy_0),
        (motion.speed_0, motion.speed_1 - motion.speed_0, 0.0, 0.0),
    )
    rows = np.empty((6, n_samples))
    np.matmul(weights, _course(n_samples, sample_rate_hz), out=rows[:3])
    rows[3], rows[4], rows[5] = turn.target_n, turn.drive, turn.sensors.value
    return rows


@lru_cache(maxsize=8)
def _course(n_samples: int, sample_rate_hz: float) -> NDArray[np.float64]:
    """Return 1, the share of a block that has passed, time in s, and half their product."""
    time_s = np.arange(n_samples) / sample_rate_hz
    share = np.arange(n_samples) / n_samples
    return np.stack((np.ones(n_samples), share, time_s, 0.5 * share * time_s))


def finger_of(turn: BlockRecord, stamp: Stamp, info: RigInfo) -> FingerState | None:
    """Return the finger's state at the end of a turn's sensed samples.

    None where no finger can be so, as with a force sensor that failed: nobody can use it.
    """
    exchange = turn.exchange
    x_mm, y_mm, vx_mm_s, vy_mm_s = turn.finger
    # Before the first report there is no age; the longest that a message holds says so.
    age_ms = min(1e3 * turn.report_age_s, 1e9)
    return _if_possible(
        FingerState,
        sequence=turn.number,
        sample=exchange.first_sample + exchange.voltage_v.size,
        utc_ns=stamp.utc_ns,
        uncertainty_ns=stamp.uncertainty_ns,
        x_mm=x_mm,
        y_mm=y_mm,
        vx_mm_s=vx_mm_s,
        vy_mm_s=vy_mm_s,
        normal_force_n=turn.normal_force_n,
        in_contact=turn.in_contact,
        source=info.finger_source,
        age_ms=age_ms,
        stale=turn.stale,
        extrapolated=Flag.EXTRAPOLATED in turn.output,
    )


def touch_of(report: TouchReport, run: int, info: RigInfo) -> TouchState | None:
    """Return a touch report as it came; None for one of a place or time that none can have."""
    return _if_possible(
        TouchState,
        run=run,
        sample=report.measured_sample,
        x_mm=report.x_mm,
        y_mm=report.y_mm,
        in_contact=report.in_contact,
        source=info.finger_source,
    )


def _if_possible(kind: type[M], **fields: object) -> M | None:
    """Return a message; None where a number is out of its range."""
    try:
        return kind(**fields)
    except ValidationError:
        return None
