"""One recording of one finger: a swipe of two seconds, or a free exploration of two minutes.

Driven by noise through the screen, or by the texture that the finger slides over; something of
rig or finger hidden in it, or nothing.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray
from tests.blind.generator.case import Hidden
from tests.blind.generator.motion import Motion
from tests.blind.generator.people import SECOND_MODE, Person, Spread, draw_person
from tests.blind.generator.plan import Planned
from tests.blind.generator.recursion import BLOCK, RATE_HZ, ComplexArray, FloatArray
from tests.blind.generator.study import STEPS, study_info
from tests.blind.generator.transfer import Rational, with_second_mode
from tests.blind.generator.trial import (
    CARRIER_HZ,
    LEAD_SAMPLES,
    PEAK_V,
    Contact,
    Sensors,
    finely,
    friction,
    moment_of,
    noise_drive,
    reports,
)

from frictus_service.study.layout import ConverterStep
from frictus_service.study.trial import Trial, TrialInfo
from frictus_service.study.writer import StudyWriter

IntArray = NDArray[np.int64]
Source = Literal["drive", "texture"]
Slip = Literal["", "force_sign", "skin_sign", "skin_mm_s", "force_mn"]

ALONE: Final = Spread(
    slope=0.0, gain_exponent=0.0, effect=0.0, contact=0.0, condition=0.0, outliers=0.0
)
"""People differ in gain, cutoff, skin and friction: what each recording may have of its own."""
STROKE_GAIN, STROKE_CUTOFF = 0.05, 0.03
"""Standard deviations of the logarithms from stroke to stroke."""
TEXTURE_N: Final = 0.04
SKIN_NOISE_M_S: Final = 1e-4
LEAD_S: Final = LEAD_SAMPLES / RATE_HZ
LEAST_TURN_S: Final = 0.12


@dataclass(frozen=True, slots=True)
class Recording:
    """What a recording is made of.

    Attributes
    ----------
    source : {'drive', 'texture'}
        What shakes the finger.
    seconds : float
    hidden : Hidden or None
    slip : str
        A wrong sign or unit in the file.
    """

    source: Source
    seconds: float
    hidden: Hidden | None = None
    slip: Slip = ""


def make_recording(path: Path, recording: Recording, seed: int) -> None:
    """Write a study of one trial.

    Parameters
    ----------
    path : Path
        Of the file to be written.
    recording : Recording
    seed : int
    """
    rng = np.random.default_rng(seed)
    hidden = recording.hidden
    in_skin = hidden is not None and hidden.name == SECOND_MODE
    person = draw_person(
        "P01", () if hidden is None or in_skin else (hidden,), ALONE, True, rng
    )
    if hidden is not None and in_skin:
        person = replace(person, skin=with_second_mode(person.skin, **hidden.parameters))
    blocks = int(recording.seconds * RATE_HZ) // BLOCK + LEAD_SAMPLES // BLOCK
    motion, stroke = _explore(blocks, rng) if recording.seconds > 5.0 else _swipe(blocks, rng)
    make = _driven if recording.source == "drive" else _textured
    trial = make(recording, person, motion, stroke, rng)
    with StudyWriter(path, study_info()) as writer:
        steps = STEPS | {"skin_velocity_m_s": ConverterStep(0.5 / 32767)}
        writer.add(_slipped(trial, recording.slip), steps)


def _swipe(blocks: int, rng: np.random.Generator) -> tuple[Motion, IntArray]:
    """Return one stroke across the screen, and the number of the stroke at each block."""
    speed = rng.uniform(22.0, 30.0) * (1.0 + 0.04 * _slow(blocks, rng))
    sense = float(rng.choice([-1.0, 1.0]))
    place = 35.0 + sense * (np.cumsum(speed) * BLOCK / RATE_HZ - speed.sum() * 8e-4)
    force = rng.uniform(0.25, 0.6) * (1.0 + 0.06 * _slow(blocks, rng))
    return Motion(place, sense * speed, force), np.zeros(blocks, dtype=np.int64)


def _explore(blocks: int, rng: np.random.Generator) -> tuple[Motion, IntArray]:
    """Return strokes back and forth, each as fast, as far and as hard as it happens."""
    velocity, force, stroke = np.zeros(blocks), np.zeros(blocks), np.zeros(blocks, np.int64)
    at, x_mm, number, press = 0, 10.0, 0, rng.uniform(0.3, 0.5)
    while at < blocks:
        to = rng.uniform(48.0, 64.0) if x_mm < 35.0 else rng.uniform(6.0, 20.0)
        speed = rng.uniform(28.0, 92.0)
        n = max(int(abs(to - x_mm) / speed * RATE_HZ / BLOCK), 1)
        velocity[at : at + n] = np.sign(to - x_mm) * speed
        force[at : at + n] = press * np.exp(0.2 * rng.standard_normal())
        stroke[at : at + n] = number
        at, x_mm, number = at + n, to, number + 1
    turn = np.hanning(int(LEAST_TURN_S * RATE_HZ / BLOCK))
    velocity, force = (
        np.convolve(values, turn / turn.sum(), mode="same") for values in (velocity, force)
    )
    velocity *= 1.0 + 0.03 * _slow(blocks, rng)
    force *= 1.0 + 0.06 * _slow(blocks, rng)
    place = 10.0 + np.cumsum(velocity) * BLOCK / RATE_HZ
    return Motion(place, velocity, np.maximum(force, 0.05)), stroke


def _slow(blocks: int, rng: np.random.Generator) -> FloatArray:
    """Return four slow sinusoids, of an rms of one together."""
    time_s = np.arange(blocks) * BLOCK / RATE_HZ
    hz, phase = rng.uniform(0.2, 3.0, (4, 1)), rng.uniform(0.0, 2.0 * np.pi, (4, 1))
    summed: FloatArray = np.cos(2.0 * np.pi * hz * time_s + phase).sum(axis=0) / np.sqrt(2.0)
    return summed


def _driven(
    recording: Recording,
    person: Person,
    motion: Motion,
    stroke: IntArray,
    rng: np.random.Generator,
) -> Trial:
    """Return a trial in which noise drives the screen."""
    each = rng.standard_normal((2, stroke.max() + 1))
    gain, cutoff = (
        np.exp(STROKE_GAIN * each[0])[stroke],
        np.exp(STROKE_CUTOFF * each[1])[stroke],
    )
    world = person.world.with_gain(lambda m: gain).with_cutoff(lambda m, hz: hz * cutoff)
    n = stroke.size * BLOCK
    fraction = noise_drive(n, rng)
    carrier = np.cos(2.0 * np.pi * CARRIER_HZ / RATE_HZ * np.arange(n))
    planned = Planned(0, 60.0, 0.4, ())
    sensors = Sensors()
    felt = _leaking(fraction, person) * 2.0 * np.square(carrier)
    force_x, accel_x = friction(
        felt,
        replace(person, world=world),
        Contact(1.0, 1.0, 1.0, 1.0),
        moment_of(motion, planned.minutes),
        motion,
        sensors,
        rng,
    )
    return _trial(
        recording,
        motion,
        sensors,
        force_x,
        rng,
        voltage_v=(PEAK_V * np.sqrt(fraction) * carrier)[LEAD_SAMPLES:],
        accel_x=accel_x,
    )


def _leaking(fraction: FloatArray, person: Person) -> FloatArray:
    """Return the drive fraction that acts, where charge leaks."""
    shelf = person.world.shelf
    if shelf is None:
        return fraction
    frequency = np.fft.rfftfreq(fraction.size, 1.0 / RATE_HZ)
    high = 1j * frequency / (1j * frequency + shelf.corner_hz)
    # The hold is in both, drive and response; only the leak is between them.
    acting: FloatArray = np.fft.irfft(np.fft.rfft(fraction) * high, fraction.size)
    return acting


def _textured(
    recording: Recording,
    person: Person,
    motion: Motion,
    stroke: IntArray,
    rng: np.random.Generator,
) -> Trial:
    """Return a trial in which nothing drives: a rough surface shakes the finger."""
    n, sensors, world = stroke.size * BLOCK, Sensors(), person.world
    frequency = np.fft.rfftfreq(n, 1.0 / RATE_HZ)
    white = np.fft.rfft(rng.standard_normal(n))
    rough = np.fft.irfft(white / (1.0 + frequency / rng.uniform(200.0, 500.0)), n)
    faster = np.abs(motion.velocity_mm_s) / 60.0
    each = np.exp(STROKE_GAIN * rng.standard_normal(stroke.max() + 1))[stroke]
    slide = np.tanh(motion.velocity_mm_s / 2.0)
    rough *= TEXTURE_N / rough.std() * finely(faster**0.3 * each * slide)
    spectrum, s = np.fft.rfft(rough), 2j * np.pi * frequency

    def through(response: ComplexArray, late_s: float) -> FloatArray:
        delayed = response * np.exp(-s * late_s)
        filtered: FloatArray = np.fft.irfft(spectrum * delayed, n)
        return filtered

    mobility = _velocity(person.skin).at(s)
    force_x = through(world.mount.at(s), -sensors.force_skew_s)
    at_rest = float(world.mount.at(np.zeros(1))[0].real)
    force_x += at_rest * finely(person.friction_coefficient * motion.normal_force_n * slide)
    skin = -through(mobility, world.delay_s - sensors.accel_skew_s)
    skin += finely(motion.velocity_mm_s) / 1000.0 + SKIN_NOISE_M_S * rng.standard_normal(n)
    return _trial(recording, motion, sensors, force_x, rng, skin_velocity_m_s=skin)


def _velocity(skin: Rational) -> Rational:
    """Return skin velocity per force, of a skin from force to acceleration."""
    return Rational(skin.numerator[:-1], skin.denominator)


def _trial(
    recording: Recording,
    motion: Motion,
    sensors: Sensors,
    force_x: FloatArray,
    rng: np.random.Generator,
    *,
    voltage_v: FloatArray | None = None,
    accel_x: FloatArray | None = None,
    skin_velocity_m_s: FloatArray | None = None,
) -> Trial:
    n = force_x.size - LEAD_SAMPLES
    force = sensors.force_noise_n * rng.standard_normal((n, 3))
    force[:, 0] += force_x[LEAD_SAMPLES:]
    force[:, 2] += finely(motion.normal_force_n)[LEAD_SAMPLES:]
    accel = None
    if accel_x is not None:
        accel = sensors.accel_noise_m_s2 * rng.standard_normal((n, 3))
        accel[:, 0] += accel_x[LEAD_SAMPLES:]
    middle_s = np.arange(0.5, motion.position_mm.size) * (BLOCK / RATE_HZ)
    position, at_s = reports(motion, middle_s, recording.seconds, rng)
    info = TrialInfo(
        id=rng.bytes(6).hex(),
        participant="P01",
        session=1,
        order=0,
        speed_mm_s=round(float(np.abs(motion.velocity_mm_s).mean()), 1),
        force_n=round(float(motion.normal_force_n.mean()), 2),
        tones_hz=(),
        drive_vpp=0.0 if voltage_v is None else 2.0 * PEAK_V,
        sample_rate_hz=RATE_HZ,
        started_utc="2026-01-05T10:00:00+00:00",
    )
    return Trial(
        info=info,
        voltage_v=voltage_v,
        force_n=force,
        accel_m_s2=accel,
        skin_velocity_m_s=None
        if skin_velocity_m_s is None
        else skin_velocity_m_s[LEAD_SAMPLES:],
        position_mm=position,
        position_t_s=at_s,
        force_skew_s=sensors.force_skew_s,
        skin_skew_s=sensors.accel_skew_s,
    )


def _slipped(trial: Trial, slip: Slip) -> Trial:
    """Return a trial with a wrong sign or unit, as a laboratory might write it."""
    force, skin, accel = trial.force_n.copy(), trial.skin_velocity_m_s, trial.accel_m_s2
    if slip == "force_sign":
        force[:, 0] *= -1.0
    if slip == "force_mn":
        force *= 1e3
    factor = {"skin_sign": -1.0, "skin_mm_s": 1e3}.get(slip, 1.0)
    return replace(
        trial,
        force_n=force,
        skin_velocity_m_s=None if skin is None else factor * skin,
        accel_m_s2=None if accel is None else factor * accel,
    )
