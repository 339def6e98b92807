"""From a design to trials in order."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from tests.blind.generator.case import Design

FloatArray = NDArray[np.float64]

SPEEDS_MM_S = (20.0, 100.0)
FORCES_N = (0.2, 0.6)
HIGHEST_HZ = 1500.0
"""One tone lies above this, where the design reaches so far."""
EVERY_S = 20.0
MISSING = 0.2
"""Share of the trials that a lifelike study lacks."""


@dataclass(frozen=True, slots=True)
class Planned:
    """One trial, as asked for."""

    order: int
    speed_mm_s: float
    force_n: float
    tones_hz: tuple[float, ...]

    @property
    def minutes(self) -> float:
        """Since the person's first trial."""
        return self.order * EVERY_S / 60.0


def draw_tones(design: Design, rng: np.random.Generator) -> tuple[float, ...]:
    """Return tones in rising order, evenly spread over log frequency but for some jitter.

    No second or third harmonic lies within 60 Hz of the lines that a sampled, squared carrier
    puts at 6 kHz less a tone.
    """
    if not design.n_tones:
        return ()
    low, high = design.tones_hz
    edges = np.geomspace(low, min(high, HIGHEST_HZ), design.n_tones)
    if high > HIGHEST_HZ:
        edges = np.append(edges, high)
    else:
        edges = np.geomspace(low, high, design.n_tones + 1)
    while True:
        inside = rng.uniform(0.1, 0.9, design.n_tones)
        tones = np.exp(np.log(edges[:-1]) + inside * np.diff(np.log(edges)))
        if design.near_hz > 0.0:
            nearest = int(np.argmin(np.abs(np.log(tones / design.near_hz))))
            tones[nearest] = design.near_hz * rng.uniform(0.95, 1.05)
        rounded: FloatArray = np.sort(np.round(tones, 1))
        if _are_free(rounded):
            return tuple(rounded.tolist())


def _own_tones(tones_hz: tuple[float, ...], rng: np.random.Generator) -> tuple[float, ...]:
    """Return those of one person, each beside the study's."""
    while True:
        own = np.round(tones_hz * np.exp(0.04 * rng.standard_normal(len(tones_hz))), 1)
        if _are_free(own):
            return tuple(own.tolist())


def _are_free(tones_hz: FloatArray) -> bool:
    apart = np.min(np.diff(tones_hz), initial=np.inf) > 8.0
    folded = np.abs(np.multiply.outer((3.0, 4.0), tones_hz) - 6000.0)
    return bool(apart and np.min(folded, initial=np.inf) > 60.0)


def draw_speeds(design: Design, rng: np.random.Generator) -> tuple[float, ...]:
    """Return speeds, the lowest and the highest near the ends of what the law holds for."""
    return _levels(SPEEDS_MM_S, design.n_speeds, 0.04, rng)


def draw_forces(design: Design, rng: np.random.Generator) -> tuple[float, ...]:
    """Return normal forces."""
    return _levels(FORCES_N, design.n_forces, 0.04, rng)


def _levels(
    limits: tuple[float, float], count: int, jitter: float, rng: np.random.Generator
) -> tuple[float, ...]:
    low, high = limits
    steps = np.linspace(0.0, 1.0, count) if count > 1 else np.array([0.5])
    moved = np.clip(steps + jitter * rng.uniform(-1.0, 1.0, count), 0.02, 0.98)
    return tuple(np.round(low + (high - low) * moved, 3).tolist())


def plan(
    design: Design,
    tones_hz: tuple[float, ...],
    speeds_mm_s: tuple[float, ...],
    forces_n: tuple[float, ...],
    rng: np.random.Generator,
) -> list[Planned]:
    """Return one person's trials in their order, all conditions once at most."""
    if design.lifelike:
        tones_hz = _own_tones(tones_hz, rng)
    conditions = [
        (speed, force, tones)
        for speed in speeds_mm_s
        for force in forces_n
        for tones in _together(design, tones_hz, rng)
    ]
    shuffled = [conditions[index] for index in rng.permutation(len(conditions))]
    if design.order == "speed_blocks":
        shuffled.sort(key=lambda condition: condition[0])
    return [
        Planned(order, speed, force, tones)
        for order, (speed, force, tones) in enumerate(shuffled)
        if not design.lifelike or rng.uniform() >= MISSING
    ]


def _together(
    design: Design, tones_hz: tuple[float, ...], rng: np.random.Generator
) -> list[tuple[float, ...]]:
    """Return the tones of as many trials as there are tones, each tone equally often."""
    if not tones_hz:
        return [()]
    count = len(tones_hz)
    start = int(rng.integers(count))
    return [
        tuple(sorted(tones_hz[(start + first + 2 * n) % count] for n in range(tones)))
        for tones in (design.tones_per_trial,)
        for first in range(count)
    ]
