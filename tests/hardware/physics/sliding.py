"""A finger sliding steadily over a driven screen, and ideal estimation of what it says."""

from dataclasses import dataclass

import numpy as np

from frictus_hardware.arrays import ComplexArray, FloatArray
from frictus_hardware.physics.linear import Mount
from frictus_hardware.physics.schedule import SlidingConditions
from frictus_hardware.physics.screen import Screen, drive_fraction_of, screen_voltage
from frictus_hardware.physics.simulator import Prediction, Probe, Simulator
from frictus_hardware.physics.stages import Decimate
from frictus_hardware.physics.twin import Signals, Twin, simulate

RATE_HZ = 20_000.0
SETTLE = 4_000
SECONDS = 0.5
MEAN = 0.5
LINE_HZ = 50.0
CARRIER_LINE_HZ = 6_000.0
NOMINAL = Mount().lateral


@dataclass(frozen=True)
class Slide:
    """A steady slide, which is at `position_mm` in the middle of what is measured."""

    speed_mm_s: float = 60.0
    force_n: float = 0.4
    direction: float = 1.0
    position_mm: float = 35.0
    minutes: float = 0.0
    first_sample: int = 0
    seed: int = 0

    def signals(self, drive: FloatArray) -> Signals:
        """Return what a twin is driven with."""
        time_s = np.arange(drive.size) / RATE_HZ
        velocity = np.zeros((drive.size, 2))
        velocity[:, 0] = self.direction * self.speed_mm_s
        position = np.zeros((drive.size, 2))
        middle_s = (SETTLE + drive.size) / 2.0 / RATE_HZ
        position[:, 0] = self.position_mm + velocity[:, 0] * (time_s - middle_s)
        return Signals.driven(
            RATE_HZ,
            screen_voltage(Screen(), drive, self.first_sample, RATE_HZ),
            position,
            velocity,
            np.full(drive.size, self.force_n),
            np.ones(drive.size, dtype=np.bool_),
        )

    def twin(self, simulator: Simulator) -> Twin:
        """Return the twin of a simulator at this time."""
        return simulator.twin(
            Screen(), 0.5, minutes=self.minutes, seed=self.seed, first_sample=self.first_sample
        )

    def probe(self, tones_hz: FloatArray, message: ComplexArray) -> Probe:
        """Return where an estimator measured."""
        ones = np.ones(tones_hz.size)
        return Probe(
            tones_hz,
            message,
            MEAN * ones,
            np.sum(np.square(np.abs(message))) / 2.0 * ones,
            SlidingConditions(
                self.speed_mm_s * ones,
                self.force_n * ones,
                self.position_mm * ones,
                self.direction * ones,
                self.minutes * ones,
            ),
        )


def tones(tones_hz: FloatArray, rng: np.random.Generator, reach: float = 0.499) -> FloatArray:
    """Return a drive of tones of equal size and any phase."""
    time_s = np.arange(SETTLE + round(SECONDS * RATE_HZ)) / RATE_HZ
    phase = rng.uniform(0.0, 2.0 * np.pi, tones_hz.size)
    drive: FloatArray = MEAN + reach * np.cos(
        2.0 * np.pi * np.multiply.outer(time_s, tones_hz) + phase
    ).mean(axis=1)
    return drive


def amplitudes(signal: FloatArray, frequency_hz: FloatArray, rate_hz: float) -> ComplexArray:
    """Fit lines beside a trend once all has settled; the phase counts from the first sample."""
    first = round(SETTLE * rate_hz / RATE_HZ)
    # A sample of the twin's steps stands for the end of its step, four for each of the rig's.
    offset = rate_hz / RATE_HZ - 1.0
    time_s = (np.arange(first, signal.size) - offset) / rate_hz
    turned = 2.0 * np.pi * np.multiply.outer(time_s, frequency_hz)
    trend = np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, time_s.size), 3)
    design = np.column_stack([np.cos(turned), np.sin(turned), trend])
    found = np.linalg.solve(design.T @ design, design.T @ signal[first:])
    count = frequency_hz.size
    return np.asarray(found[:count] - 1j * found[count : 2 * count])


def estimated(
    simulator: Simulator, slide: Slide, tones_hz: FloatArray, drive: FloatArray
) -> tuple[Prediction, Probe]:
    """Simulate a slide; return what it says at the tones, and where it was measured.

    Mobility is not estimated.
    """
    signals = slide.signals(drive)
    out = simulate(slide.twin(simulator), signals)
    count = tones_hz.size
    lines = np.concatenate([tones_hz, 2.0 * tones_hz, 3.0 * tones_hz, [LINE_HZ]])
    given = drive_fraction_of(Screen(), signals.voltage_v)
    message = amplitudes(given, np.append(tones_hz, CARRIER_LINE_HZ), RATE_HZ)[:-1]
    held = message * np.exp(-1j * np.pi * tones_hz / RATE_HZ)
    turn = held / np.abs(held)
    force = slide.direction * amplitudes(out.force_n[:, 0], lines, RATE_HZ)
    line_n = abs(force[-1])
    force = force / NOMINAL.frequency_response(lines)
    first, second, third = force[:count], force[count : 2 * count], force[2 * count : -1]
    found = Prediction(
        friction=first / held / np.sinc(tones_hz / RATE_HZ),
        second=second / (first * turn),
        third=third / (first * turn**2),
        mobility=np.full(count, complex(np.nan)),
        line_n=np.full(count, line_n),
        low_n2=np.full(count, np.nan),
    )
    return found, slide.probe(tones_hz, message)


def estimated_mobility(
    simulator: Simulator, slide: Slide, tones_hz: FloatArray, drive: FloatArray
) -> tuple[ComplexArray, Probe]:
    """Return skin over friction at the twin's own rate, where no image folds in."""
    stages = slide.twin(simulator).stages
    kinds = [type(stage) for stage in stages]
    twin = Twin(stages[: kinds.index(Decimate)])
    out, _ = twin.run(slide.signals(drive), twin.initial())
    accel = amplitudes(out.accel_m_s2[:, 0], tones_hz, out.sample_rate_hz)
    force = amplitudes(out.force_n[:, 0], tones_hz, out.sample_rate_hz)
    velocity = -accel / (2j * np.pi * tones_hz)
    found: ComplexArray = velocity / force * NOMINAL.frequency_response(tones_hz)
    return found, slide.probe(tones_hz, np.full(tones_hz.size, 0.1 + 0.0j))
