"""Playing a drive on a rig and taking down what it senses, closed whole also on Ctrl-C."""

import math
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Final

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_hardware.base import Backend, Exchange
from frictus_service.daemon.block_loop.lead import RetryingBackend
from frictus_service.errors import ServiceError
from frictus_service.processes import garbage_collection_off


@contextmanager
def interrupt_put_off() -> Iterator[Callable[[], bool]]:
    """Yield a function that says whether Ctrl-C was pressed; nothing is torn by it meanwhile.

    Outside of the main thread, which alone hears Ctrl-C, it changes nothing.

    Raises
    ------
    KeyboardInterrupt
        At the end, if it was pressed and nothing else is raised.
    """
    pressed = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield pressed.is_set
        return
    former = signal.signal(signal.SIGINT, lambda _number, _frame: pressed.set())
    try:
        yield pressed.is_set
    finally:
        signal.signal(signal.SIGINT, former)
    if pressed.is_set():
        raise KeyboardInterrupt


PEAK_V: Final = 5.0
"""No test drives the screen beyond this; the rig itself would allow up to 75 V."""
SETTLE_S: Final = 0.2
"""Zeros before what counts."""


LEAST_LEAD_MS: Final = 2.0
"""Below this a backend has no block to hand over ahead."""


def least_lead_ms(lead_ms: float, margin_ms: float) -> float:
    """Return the lead that a machine needs, with as much to spare as it used, and 1 ms.

    Parameters
    ----------
    lead_ms : float
        From handing a block over to its playing.
    margin_ms : float
        The least output that was still queued when a block was handed over.
    """
    return max(LEAST_LEAD_MS, float(math.ceil(2.0 * (lead_ms - margin_ms) + 1.0)))


class TooStrongError(ServiceError, ValueError):
    """A drive beyond what a test may output; nothing was output."""


@dataclass(frozen=True, slots=True, eq=False)
class Played:
    """A drive and what was sensed meanwhile, on one sample clock.

    Attributes
    ----------
    applied_v : ndarray, shape (n_samples,)
        What the output was told to play at each sample.
    monitor_v : ndarray, shape (n_samples,)
        Screen volts; like all that is sensed, NaN where samples were lost.
    force_n, accel_m_s2 : ndarray, shape (n_samples, 3)
    start : int
        Index at which the drive began to play.
    sample_rate_hz : float
        Samples per second of the device's clock.
    touches : ndarray, shape (n_reports, 3)
        Of a finger on the screen: the sample at which it was there, counted as those of the
        drive are, and x and y in mm; in the order of their samples.
    leads : tuple of int
        Least and most samples from handing a block over to its playing.
    margin_samples : int
        The least.
    underrun_samples, overrun_samples, saturated_samples : int
        Sums.
    retries : int
        Transient faults after which a block was offered again.
    """

    applied_v: FloatArray
    monitor_v: FloatArray
    force_n: FloatArray
    accel_m_s2: FloatArray
    start: int
    sample_rate_hz: float
    touches: FloatArray
    leads: tuple[int, int]
    margin_samples: int
    underrun_samples: int
    overrun_samples: int
    saturated_samples: int
    retries: int

    @property
    def touched(self) -> bool:
        """Whether the touch sensor told of a finger."""
        return self.touches.size > 0

    @property
    def lost_samples(self) -> int:
        """What did not get out or in."""
        return self.underrun_samples + self.overrun_samples


def play(backend: Backend, drive_v: FloatArray, block_samples: int) -> Played:
    """Open a rig, play a drive, and close the rig again, whatever happens.

    Parameters
    ----------
    backend : Backend
        Not open.
    drive_v : ndarray, shape (n_samples,)
        Screen volts, within +/-5 V.
    block_samples : int

    Raises
    ------
    TooStrongError
        If the drive is stronger than that.
    HardwareError
        What the backend raises.
    KeyboardInterrupt
        After Ctrl-C; the output is at zero then.
    """
    if not np.all(np.abs(drive_v) <= PEAK_V):
        raise TooStrongError(f"a test drives the screen with at most {PEAK_V:g} V")
    info = backend.info
    settle = -(-round(SETTLE_S * info.sample_rate_hz) // block_samples)
    wanted = drive_v.size + info.lead_samples
    padded = np.zeros(-(-wanted // block_samples) * block_samples)
    padded[: drive_v.size] = drive_v
    patient = RetryingBackend(backend, time.monotonic_ns)
    # Before the clock starts: what the collector would take, no lead holds out.
    with interrupt_put_off() as interrupted, garbage_collection_off(), patient:
        if np.any(drive_v):
            patient.arm()
        exchanges = []
        for block_v in (*np.zeros((settle, block_samples)), *padded.reshape(-1, block_samples)):
            if interrupted():
                raise KeyboardInterrupt
            exchanges.append(patient.exchange(block_v))
        patient.stop(0.0)
    return joined(exchanges[settle:], info.sample_rate_hz, patient.retries)


def joined(exchanges: list[Exchange], sample_rate_hz: float, retries: int) -> Played:
    """Put consecutive exchanges together, each sample at its place.

    Parameters
    ----------
    exchanges : list of Exchange
        One or more.
    sample_rate_hz : float
        Samples per second of the device's clock.
    retries : int
        Blocks that were offered again.
    """
    first, last = exchanges[0].first_sample, exchanges[-1]
    n_samples = last.first_sample + last.applied_v.size - first
    applied = np.zeros(n_samples)
    monitor = np.full(n_samples, np.nan)
    force, accel = np.full((n_samples, 3), np.nan), np.full((n_samples, 3), np.nan)
    for each in exchanges:
        begin = each.first_sample - first
        sensed = slice(begin, begin + each.applied_v.size)
        monitor[sensed] = each.voltage_v
        force[sensed], accel[sensed] = each.force_n, each.accel_m_s2
        at = each.play_sample - first
        room = applied[at : at + each.applied_v.size]
        room[:] = each.applied_v[: room.size]
    reports = {
        touch.measured_sample - first: (touch.x_mm, touch.y_mm)
        for each in exchanges
        for touch in each.touches
        if touch.in_contact
    }
    leads = [each.play_sample - each.first_sample for each in exchanges]
    return Played(
        applied_v=applied,
        monitor_v=monitor,
        force_n=force,
        accel_m_s2=accel,
        start=exchanges[0].play_sample - first,
        sample_rate_hz=sample_rate_hz,
        touches=np.array([(at, *reports[at]) for at in sorted(reports)]).reshape(-1, 3),
        leads=(min(leads), max(leads)),
        margin_samples=min(each.margin_samples for each in exchanges),
        underrun_samples=sum(each.underrun_samples for each in exchanges),
        overrun_samples=sum(each.overrun_samples for each in exchanges),
        saturated_samples=sum(each.saturated_samples for each in exchanges),
        retries=retries,
    )
