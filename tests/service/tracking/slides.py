"""Windows of a finger whose law is known, drawn line by line without a twin."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from frictus_hardware.arrays import ComplexArray, FloatArray
from frictus_hardware.physics.effects import extended
from frictus_hardware.physics.friction import FrictionLaw
from frictus_hardware.physics.linear import Mount
from frictus_hardware.physics.schedule import SlidingConditions
from frictus_hardware.physics.simulator import Probe, Simulator, predict
from frictus_service.calibration import coordinates
from frictus_service.calibration.coordinates import Prior
from frictus_service.discovery.evidence.bands import Bands
from frictus_service.tracking.estimation.finger_filters import LAW, FingerFilters
from frictus_service.tracking.windows import MAINS_HZ, LawWindow

MOUNT: Final = Mount().lateral
BANDS: Final = Bands.of(2000, 20_000.0, MOUNT)
PAPER: Final = coordinates.from_law(0.39, 385.68, 13.811, 0.0)
STEP: Final = 1000
"""Samples from one window to the next."""
RATE_HZ: Final = 20_000.0
_MAINS: Final = np.searchsorted(BANDS.frequency_hz, MAINS_HZ)
_BAND_WINDOW_S: Final = 0.1

Effects = Sequence[tuple[str, Mapping[str, float]]]
Deviation = Callable[[SlidingConditions, FloatArray], ComplexArray]
"""From one window's conditions and frequencies to a factor of the response."""


@dataclass(frozen=True)
class Place:
    """Where a window lies; a window whose place does not matter lies in the middle."""

    normal_force_n: float = 0.4
    position_mm: float = 35.0
    direction: float = 1.0


def slide(
    rng: np.random.Generator,
    at: FloatArray,
    speeds_mm_s: Sequence[float],
    contact: int = 0,
    first_sample: int = 0,
    noise_n: float = 2e-3,
    places: Sequence[Place] | None = None,
    effects: Effects = (),
    deviation: Deviation | None = None,
    drives: Sequence[float] | None = None,
) -> list[LawWindow]:
    """Return windows at given speeds of a law in `coordinates`, with white noise of the force.

    They follow as half overlapping ones do, but are drawn independently.
    """
    windows = []
    frequency = BANDS.frequency_hz
    gain, cutoff_0, slope, delay = coordinates.to_law(at)
    bare = Simulator(law=FrictionLaw(gain, cutoff_0, slope), mount=MOUNT, delay_s=delay)
    simulator = extended(bare, effects)
    felt_by = MOUNT.frequency_response(np.array(MAINS_HZ))
    for number, speed in enumerate(speeds_mm_s):
        place = Place() if places is None else places[number]
        first = first_sample + number * STEP
        drive = 2.0 * _normal(rng, frequency.size)
        every = np.ones(frequency.size)
        around = SlidingConditions(
            speed * every,
            place.normal_force_n * every,
            place.position_mm * every,
            place.direction * every,
            first / RATE_HZ / 60.0 * every,
        )
        variance = 2.0 * float(np.sum(np.abs(drive) ** 2)) / 2000.0
        mean = 0.5 if drives is None else drives[number]
        amplitude = np.sqrt(2.0 * variance / frequency.size) * every
        probe = Probe(
            frequency, amplitude.astype(complex), mean * every, variance * every, around
        )
        law = predict(simulator, probe, MOUNT).friction
        if deviation is not None:
            law = law * deviation(around, frequency)
        felt = law * drive + noise_n * _normal(rng, frequency.size)
        power, cross, friction = (
            BANDS.total(spectrum[np.newaxis])
            for spectrum in (np.abs(drive) ** 2, drive.conj() * felt, np.abs(felt) ** 2)
        )
        time_s = first / RATE_HZ
        hum = sum(
            (
                each.amplitude_n
                * np.exp(2j * np.pi * each.frequency_hz * time_s)
                * np.sqrt(RATE_HZ * _BAND_WINDOW_S / 6.0)
                * (np.array(MAINS_HZ) == each.frequency_hz)
                for each in simulator.hum
            ),
            start=np.zeros(2, dtype=complex),
        )
        windows.append(
            LawWindow(
                first,
                contact,
                speed,
                place.normal_force_n,
                power.real,
                cross,
                friction.real,
                place.position_mm,
                place.direction,
                mean,
                variance,
                time_s / 60.0,
                BANDS.total((np.abs(drive) ** 2 * frequency)[np.newaxis]) / power.real,
                felt[_MAINS] * felt_by * place.direction + hum,
                drive[_MAINS] * felt_by * place.direction,
            )
        )
    return windows


def known(at: FloatArray, covariance: FloatArray) -> FingerFilters:
    """Return what is known of a person who never differs from the own law."""
    filters = FingerFilters.begin(Prior(at, covariance, 0, "known"))
    filters.covariances[:, LAW:] = filters.covariances[:, :, LAW:] = 0.0
    return filters


def speeds(rng: np.random.Generator) -> list[float]:
    """Return the speeds of the windows of a batch, 20 to 100 mm/s."""
    drawn: list[float] = rng.uniform(20.0, 100.0, 10).tolist()
    return drawn


def strokes(rng: np.random.Generator) -> Iterator[tuple[list[float], list[Place]]]:
    """Yield speeds and places of batches, as strokes back and forth have them."""
    force, phase = 0.4, rng.uniform(0.0, 2.0 * np.pi)
    while True:
        span, middle = rng.uniform(15.0, 28.0), rng.uniform(30.0, 40.0)
        rate = rng.uniform(2.0, 3.5)
        found, places = [], list[Place]()
        for _ in range(10):
            phase += 0.05 * rate
            speed = abs(span * rate * np.cos(phase))
            force += 0.2 * (0.4 - force) + 0.03 * rng.standard_normal()
            found.append(float(np.clip(speed, 20.0, 100.0)))
            places.append(
                Place(
                    float(np.clip(force, 0.1, 1.5)),
                    middle + span * float(np.sin(phase)),
                    float(np.sign(np.cos(phase))),
                )
            )
        yield found, places


def _normal(rng: np.random.Generator, size: int) -> ComplexArray:
    both = rng.standard_normal((2, size)) / np.sqrt(2.0)
    normal: ComplexArray = both[0] + 1j * both[1]
    return normal
