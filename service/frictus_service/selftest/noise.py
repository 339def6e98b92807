"""The noise floor: what the channels say while nothing is driven and nobody touches."""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_service.selftest.playing import Played
from frictus_service.selftest.report import (
    Measure,
    Outcome,
    SelftestFinding,
    beyond,
    half_width,
    judged,
    lost,
    mean_and_half,
)

TEST: Final = "noise floor"
SECONDS: Final = 4.0
PARTS: Final = 20
MAINS_HZ: Final = (50.0, 60.0)
HARMONICS: Final = 10
DRIFT_HZ: Final = 1.0
"""So far from its nominal frequency a line is looked for."""
AROUND_HZ: Final = 10.0
"""The noise beside a line is taken from so far to either side."""
FINER: Final = 4
"""Padding with zeros: a line between two of the spectrum is then 1 % low at most."""
STANDS_OUT: Final = 5.0
"""A line is this many times the noise beside it."""
OFFSET_V: Final = (0.5, 2.0)
"""Mean of the monitor at zero drive at which to warn, and to fail."""


@dataclass(frozen=True, slots=True)
class Expectation:
    """What a quantity may show at rest; rms and the amplitude of a line alike.

    Attributes
    ----------
    unit : str
        Of the quantity.
    warn, fail : float
        Beyond these.
    cause : str
        What to look at.
    """

    unit: str
    warn: float
    fail: float
    cause: str


EXPECTED: Final = {
    "force": Expectation(
        "N",
        0.01,
        0.1,
        "let nothing touch the screen; check cable and shield of the sensor",
    ),
    "accel": Expectation(
        "m/s²", 0.2, 2.0, "lay the accelerometer down; check its supply and shield"
    ),
    "voltage": Expectation(
        "V", 0.2, 2.0, "check ground and shield of amplifier and monitor, and monitor.gain"
    ),
}


@dataclass(frozen=True, slots=True)
class ChannelNoise:
    """Noise of one channel, in its unit.

    Attributes
    ----------
    rms, rms_half : float
        Without mean and linear drift; half of the 95 % interval.
    mean, mean_half : float
        Mean, and half its 95 % interval.
    line_hz, line, line_half : float
        Frequency and amplitude of the largest line of the mains.
    line_limit : float
        Amplitude from which on a line stands out of the noise beside it.
    """

    rms: float
    rms_half: float
    mean: float
    mean_half: float
    line_hz: float
    line: float
    line_half: float
    line_limit: float

    @property
    def found(self) -> bool:
        """Whether the line stands out."""
        return self.line > self.line_limit


def noise_of(samples: FloatArray, sample_rate_hz: float) -> ChannelNoise:
    """Return the noise of a channel.

    Parameters
    ----------
    samples : ndarray, shape (n_samples,)
        Two seconds or more, so that lines are apart.
    sample_rate_hz : float
        Samples per second of the device's clock.
    """
    time = np.linspace(-1.0, 1.0, samples.size)
    centred = samples - samples.mean()
    swing = centred - time * (time @ centred) / (time @ time)
    parts = samples.size // PARTS
    power = np.square(swing[: parts * PARTS]).reshape(PARTS, parts).mean(axis=1)
    mean_square, half = mean_and_half(power)
    rms = float(np.sqrt(mean_square))
    mean, mean_half = mean_and_half(samples[: parts * PARTS].reshape(PARTS, parts).mean(axis=1))
    line_hz, line, beside = _largest_line(swing, sample_rate_hz)
    return ChannelNoise(
        rms=rms,
        rms_half=half / (2.0 * rms) if rms else 0.0,
        mean=mean,
        mean_half=mean_half,
        line_hz=line_hz,
        line=line,
        # The median of a Rayleigh distribution is 1.18 of its scale.
        line_half=half_width(beside / math.sqrt(math.log(4.0)), 1_000),
        line_limit=STANDS_OUT * beside,
    )


def _largest_line(swing: FloatArray, sample_rate_hz: float) -> tuple[float, float, float]:
    """Return frequency and amplitude of the largest line, and the noise beside it."""
    window = np.hanning(swing.size)
    size = FINER * swing.size
    amplitude = np.abs(np.fft.rfft(window * swing, size)) * 2.0 / window.sum()
    hz = np.fft.rfftfreq(size, 1.0 / sample_rate_hz)
    lines = []
    for mains_hz in MAINS_HZ:
        for nominal_hz in mains_hz * np.arange(1, HARMONICS + 1):
            away = np.abs(hz - nominal_hz)
            near = np.flatnonzero(away <= DRIFT_HZ)
            beside = (away > 2.0 * DRIFT_HZ) & (away <= AROUND_HZ)
            if near.size and nominal_hz + AROUND_HZ < hz[-1]:
                top = near[np.argmax(amplitude[near])]
                level = float(np.median(amplitude[beside]))
                lines.append((float(hz[top]), float(amplitude[top]), level))
    return max(lines, key=lambda line: line[1])


def judge_noise(played: Played, simulated: bool) -> Outcome:
    """Say whether a rig is as quiet as it should be.

    Parameters
    ----------
    played : Played
        At zero drive, nobody touching.
    simulated : bool
        A simulated channel may be without any noise.
    """
    if played.touched:
        return Outcome(
            TEST,
            "fail",
            "the touch sensor tells of a finger, so that noise cannot be told from touch",
            "take finger and objects off the screen; clean the frame of the touch sensor",
        )
    if played.lost_samples:
        return lost(TEST, played.lost_samples)
    rate_hz = played.sample_rate_hz
    found = {
        **{f"force {axis}": noise_of(played.force_n[:, n], rate_hz) for n, axis in _AXES},
        **{f"accel {axis}": noise_of(played.accel_m_s2[:, n], rate_hz) for n, axis in _AXES},
        "voltage": noise_of(played.monitor_v, rate_hz),
    }
    figures = [figure for name, noise in found.items() for figure in _figures(name, noise)]
    remarks = [
        remark for name, noise in found.items() for remark in _remarks(name, noise, simulated)
    ]
    if played.saturated_samples:
        what = f"an acceleration was at its range's end for {played.saturated_samples} samples"
        remarks.append(
            SelftestFinding("fail", what, "check zero_g_v, output_range_v and its supply")
        )
    return judged(TEST, figures, remarks, "every channel is as quiet as it should be")


_AXES: Final = tuple(enumerate("xyz"))


def _expected(name: str) -> Expectation:
    return EXPECTED[name.partition(" ")[0]]


def _figures(name: str, noise: ChannelNoise) -> list[Measure]:
    unit = _expected(name).unit
    return [
        Measure(f"{name} rms", noise.rms, unit, noise.rms_half),
        Measure(f"{name} mean", noise.mean, unit, noise.mean_half),
        Measure(f"{name} line at {noise.line_hz:.1f} Hz", noise.line, unit, noise.line_half)
        if noise.found
        else Measure(f"{name} mains lines, none above", noise.line_limit, unit),
    ]


def _remarks(name: str, noise: ChannelNoise, simulated: bool) -> list[SelftestFinding]:
    expected = _expected(name)
    remarks = []
    at_rms = beyond(noise.rms, expected.warn, expected.fail)
    if at_rms != "ok":
        found = (
            f"{name} has {noise.rms:.3g} ± {noise.rms_half:.1g} {expected.unit} rms, "
            f"{expected.warn:g} is expected at most"
        )
        remarks.append(SelftestFinding(at_rms, found, expected.cause))
    at_line = beyond(noise.line, expected.warn, expected.fail)
    if at_line != "ok" and noise.found:
        found = (
            f"{name} has a mains line of {noise.line:.3g} ± {noise.line_half:.1g} "
            f"{expected.unit} at {noise.line_hz:.1f} Hz, {expected.warn:g} is expected at most"
        )
        remarks.append(SelftestFinding(at_line, found, expected.cause))
    if noise.rms == 0.0 and not simulated:
        found = f"{name} does not move at all"
        remarks.append(SelftestFinding("warn", found, f"see whether {name} is connected"))
    at_rest = beyond(abs(noise.mean), *OFFSET_V)
    if name == "voltage" and at_rest != "ok":
        found = f"at zero drive the monitor reads {noise.mean:.3g} ± {noise.mean_half:.1g} V"
        remarks.append(
            SelftestFinding(at_rest, found, "adjust the offset of amplifier or monitor")
        )
    return remarks
