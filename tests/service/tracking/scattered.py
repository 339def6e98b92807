"""Batches of a finger whose gain differs by contact and whose cutoff differs by stroke.

Drawn band by band and not line by line, so that hundreds of sessions take seconds.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from tests.service.tracking.slides import BANDS, MOUNT, PAPER, RATE_HZ, STEP, known

from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.schedule import SlidingConditions
from frictus_hardware.simulated.config import WithinPersonScatter
from frictus_service.calibration import coordinates
from frictus_service.calibration.coordinates import Prior
from frictus_service.tracking.estimation.batch import Batch
from frictus_service.tracking.estimation.law_estimate import LawEstimate
from frictus_service.tracking.evidence.watch import ModelWatch

BATCH: Final = 10
LIFTS: Final = 0.2
"""How often the finger leaves the screen between two strokes."""
TURN: Final = 4
"""Windows that are lost at a turn."""
NOISE_N: Final = 2e-3
DRIVE: Final = 2.0
"""Per frequency."""


@dataclass(frozen=True)
class Felt:
    """A batch, and whether the finger was lifted before it."""

    batch: Batch
    new_contact: bool


@dataclass(frozen=True)
class Session:
    """The watch after some batches, and the batch of the first alarm."""

    watch: ModelWatch
    first: int | None


def explored(
    rng: np.random.Generator,
    off: FloatArray,
    asymmetry: float = 0.0,
    lifts: float = LIFTS,
    scatter: WithinPersonScatter | None = None,
) -> Iterator[Felt]:
    """Yield batches of strokes back and forth.

    By `off` the law is off PAPER's in `coordinates`; the gain of strokes to the right is more
    by `asymmetry`, that of the others less.
    """
    scatter = scatter or WithinPersonScatter()
    at_window, direction, again, lifted = 0, 1.0, True, True
    gain = 0.0
    rows: list[FloatArray] = []
    while True:
        if again:
            gain = scatter.gain_per_trial * rng.standard_normal()
        cutoff = scatter.cutoff_per_condition * rng.standard_normal()
        count = int(rng.integers(8, 18))
        share = np.sin(np.pi * (np.arange(count) + 0.5) / count)
        peak, force = rng.uniform(40.0, 130.0), rng.uniform(0.2, 0.8)
        for number in range(count):
            speed = float(np.clip(20.0 + (peak - 20.0) * share[number], 20.0, 100.0))
            position = 35.0 + direction * 20.0 * (2.0 * number / count - 1.0)
            ln_gain = gain + np.log1p(asymmetry * direction)
            rows.append(
                np.array(
                    [at_window + number, speed, force, position, direction, cutoff, ln_gain]
                )
            )
            if len(rows) == BATCH:
                yield Felt(_batch(rng, np.array(rows), off), lifted)
                rows, lifted = [], False
        at_window, direction = at_window + count + TURN, -direction
        again = bool(rng.random() < lifts)
        if again and rows:
            yield Felt(_batch(rng, np.array(rows), off), lifted)
            rows = []
        lifted |= again


def _batch(rng: np.random.Generator, rows: FloatArray, off: FloatArray) -> Batch:
    window, speed, force, position, direction, cutoff, gain = rows.T
    shape = (window.size, BANDS.centre_hz.size)
    every = np.broadcast_to
    frequency = every(BANDS.centre_hz, shape)
    speeds = every(speed[:, np.newaxis], shape)
    factor = np.exp(cutoff)[:, np.newaxis]
    at = PAPER + off
    law = np.exp(gain)[:, np.newaxis] * coordinates.response(at, speeds, frequency / factor)
    # The delay goes by the frequency itself.
    law = law * np.exp(-2j * np.pi * at[3] * frequency * (1.0 - 1.0 / factor))
    power = every(DRIVE**2 * BANDS.lines, shape)
    noise = (
        NOISE_N
        * np.sqrt(power / 2.0)
        * (rng.standard_normal(shape) + 1j * rng.standard_normal(shape))
    )
    felt = np.square(np.abs(law)) * power + 2.0 * (law.conj() * noise).real
    felt = felt + NOISE_N**2 * BANDS.lines
    mains = np.zeros((window.size, 2), dtype=complex)
    return Batch(
        speed,
        speeds.astype(complex),
        power,
        law * power + noise,
        felt,
        np.ones(shape, dtype=bool),
        BANDS,
        frequency.astype(complex),
        np.zeros(shape, dtype=complex),
        SlidingConditions(speed, force, position, direction, window * STEP / RATE_HZ / 60.0),
        np.full(window.size, 0.5),
        np.full(window.size, 0.05),
        mains,
        mains,
    )


def watched(
    rng: np.random.Generator,
    batches: int,
    off: FloatArray,
    asymmetry: float = 0.0,
    lifts: float = LIFTS,
) -> Session:
    """Return a session in which PAPER's law is in force."""
    noise = np.full(BANDS.centre_hz.size, NOISE_N**2)
    estimate = LawEstimate(
        Prior.weak(), known(PAPER + off, np.zeros((4, 4))), noise, 1e-3, 1, 10
    )
    watch, first, last_s = ModelWatch.begin(MOUNT), None, 0.0
    path = explored(rng, off, asymmetry, lifts)
    for number in range(batches):
        felt = next(path)
        now_s = 60.0 * float(felt.batch.conditions.minutes[-1])
        watch = watch.seen(felt.batch, PAPER, estimate, now_s - last_s, felt.new_contact)
        last_s = now_s
        estimate = replace(
            estimate,
            last_direction=float(felt.batch.conditions.direction[-1]),
            last_minutes=float(felt.batch.conditions.minutes[-1]),
        )
        if first is None and watch.raised:
            first = number
    return Session(watch, first)
