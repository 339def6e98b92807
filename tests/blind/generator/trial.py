"""One trial: what the finger does, and what the sensors sample."""

from dataclasses import dataclass

import numpy as np
from scipy import signal
from tests.blind.generator.case import Design
from tests.blind.generator.motion import Motion, move, move_lifelike
from tests.blind.generator.people import Person
from tests.blind.generator.plan import Planned
from tests.blind.generator.recursion import (
    BLOCK,
    RATE_HZ,
    ComplexArray,
    FloatArray,
    Poles,
    Residues,
    respond,
)
from tests.blind.generator.transfer import Rational
from tests.blind.generator.world import Moment, Relaxation, Section, World

PEAK_V = 75.0
CARRIER_HZ = 7000.0
LEAD_SAMPLES = 50 * BLOCK
"""Simulated before the first sample, so that no mode rings from the start."""
REPORT_HZ = 60.0
REPORT_MM = 0.1
LATE_S = 0.04
"""By which the reports of a lifelike study are late, and the file does not say so."""
FADE_MM_S = 2.0
Y_MM = 20.0
NOISE_HZ = 2400.0


@dataclass(frozen=True, slots=True)
class Sensors:
    """Noise of a sample, and when it is taken after the drive changes.

    Attributes
    ----------
    force_noise_n, accel_noise_m_s2 : float
    force_skew_s, accel_skew_s : float
        Declared in the file.
    """

    force_noise_n: float = 0.002
    accel_noise_m_s2: float = 0.05
    force_skew_s: float = 3e-6
    accel_skew_s: float = 11e-6


@dataclass(frozen=True, slots=True)
class Contact:
    """How this trial is unlike the person's others: factors."""

    gain: float
    cutoff: float
    speed: float
    force: float


@dataclass(frozen=True, slots=True)
class Samples:
    """What a trial holds."""

    voltage_v: FloatArray
    force_n: FloatArray
    accel_m_s2: FloatArray
    position_mm: FloatArray
    position_t_s: FloatArray


def run(
    planned: Planned,
    person: Person,
    contact: Contact,
    design: Design,
    sensors: Sensors,
    rng: np.random.Generator,
) -> Samples:
    """Return the samples of a trial.

    Parameters
    ----------
    planned : Planned
    person : Person
    contact : Contact
    design : Design
        Its seconds are used, and whether it is lifelike.
    sensors : Sensors
    rng : numpy.random.Generator
    """
    blocks = int(design.seconds * RATE_HZ) // BLOCK + LEAD_SAMPLES // BLOCK
    middle_s: FloatArray = np.arange(0.5, blocks, dtype=np.float64) * (BLOCK / RATE_HZ)
    speed = planned.speed_mm_s * contact.speed
    way = move_lifelike if design.lifelike else move
    motion = way(speed, planned.force_n * contact.force, middle_s, rng)
    fraction = _message(planned.tones_hz, blocks * BLOCK, rng)
    carrier = np.cos(2.0 * np.pi * CARRIER_HZ / RATE_HZ * np.arange(blocks * BLOCK))
    moment = moment_of(motion, planned.minutes)
    felt = _felt(fraction, planned, person.world) * 2.0 * np.square(carrier)
    force_x, accel_x = friction(felt, person, contact, moment, motion, sensors, rng)
    if person.world.mains_n > 0.0:
        turns = person.world.mains_hz * np.arange(force_x.size) / RATE_HZ + rng.uniform()
        force_x = force_x + person.world.mains_n * np.cos(2.0 * np.pi * turns)
    kept = slice(LEAD_SAMPLES, None)
    voltage = PEAK_V * np.sqrt(fraction) * carrier
    force = _noise(sensors.force_noise_n, force_x.size - LEAD_SAMPLES, rng)
    force[:, 0] += force_x[kept]
    force[:, 2] += finely(motion.normal_force_n)[kept]
    accel = _noise(sensors.accel_noise_m_s2, force_x.size - LEAD_SAMPLES, rng)
    accel[:, 0] += accel_x[kept]
    position, at_s = reports(
        motion, middle_s, design.seconds, rng, LATE_S if design.lifelike else 0.0
    )
    return Samples(voltage[kept], force, accel, position, at_s)


def moment_of(motion: Motion, minutes: float) -> Moment:
    """Return when and how friction acts in a motion."""
    return Moment(
        np.clip(np.abs(motion.velocity_mm_s), 20.0, 100.0),
        motion.normal_force_n,
        motion.position_mm,
        np.tanh(motion.velocity_mm_s / FADE_MM_S),
        minutes,
    )


def _message(tones_hz: tuple[float, ...], samples: int, rng: np.random.Generator) -> FloatArray:
    """Return the drive fraction that is asked for, from 0 to 1; noise where no tone is."""
    if not tones_hz:
        return noise_drive(samples, rng)
    phases = rng.uniform(0.0, 2.0 * np.pi, len(tones_hz))
    time_s = np.arange(samples) / RATE_HZ
    fraction = np.full(samples, 0.5)
    for tone, phase in zip(tones_hz, phases, strict=True):
        fraction += 0.5 / len(tones_hz) * np.cos(2.0 * np.pi * tone * time_s + phase)
    kept: FloatArray = np.clip(fraction, 0.0, 1.0)
    return kept


def noise_drive(samples: int, rng: np.random.Generator) -> FloatArray:
    """Return noise up to 2.4 kHz; what lies higher the squared carrier would fold down."""
    frequency = np.fft.rfftfreq(samples, 1.0 / RATE_HZ)
    white = np.fft.rfft(rng.standard_normal(samples))
    noise = np.fft.irfft(white * (frequency < NOISE_HZ), samples)
    kept: FloatArray = np.clip(0.5 + 0.16 * noise / noise.std(), 0.02, 0.98)
    return kept


def _felt(fraction: FloatArray, planned: Planned, world: World) -> FloatArray:
    """Return what becomes of the drive fraction before it acts."""
    for change in world.maps:
        fraction = change(fraction, planned.minutes, planned.tones_hz[0])
    if world.shelf is not None:
        keep = np.exp(-2.0 * np.pi * world.shelf.corner_hz / RATE_HZ)
        slow, _ = signal.lfilter(
            [(1.0 - keep) / 2.0, (1.0 - keep) / 2.0],
            [1.0, -keep],
            fraction,
            zi=np.array([keep * fraction.mean() + (1.0 - keep) / 2.0 * fraction.mean()]),
        )
        fraction = fraction - world.shelf.share * slow
    if world.echo is not None:
        later = round(world.echo.delay_s * RATE_HZ)
        again = np.concatenate([np.full(later, fraction[0]), fraction[:-later]])
        fraction = fraction + world.echo.share * again
    return fraction


def friction(
    felt: FloatArray,
    person: Person,
    contact: Contact,
    moment: Moment,
    motion: Motion,
    sensors: Sensors,
    rng: np.random.Generator,
) -> tuple[FloatArray, FloatArray]:
    """Return force under the screen and acceleration of the nail, both along x."""
    world = person.world
    at_rest = float(world.mount.at(np.zeros(1))[0].real)
    poles, force, skin = modes(2.0 * np.pi * cutoff_hz(person, contact, moment), person, moment)
    driven, shaken = respond(
        felt,
        poles,
        (
            (force, sensors.force_skew_s - world.delay_s),
            (skin, sensors.accel_skew_s - world.delay_s),
        ),
    )
    gain = np.full(moment.speed_mm_s.shape, person.gain_n * contact.gain)
    for factor in world.gains:
        gain = gain * factor(moment)
    along = finely(gain * moment.direction)
    rubbed = finely(person.friction_coefficient * motion.normal_force_n * moment.direction)
    hand = finely(np.gradient(motion.velocity_mm_s, BLOCK / RATE_HZ)) / 1000.0
    force_x, accel_x = along * driven + at_rest * rubbed, hand - along * shaken
    saws = []
    if world.stick_slip is not None:
        saws.append(_saw_tooth(world, motion, moment, rng))
    if world.relaxation is not None:
        saws.append(finely(moment.direction) * _relaxing(world.relaxation, motion, rng))
    for saw in saws:
        force_x = force_x + _filtered(world.mount, saw)
        accel_x = accel_x - _filtered(person.skin, saw)
    return force_x, accel_x


def cutoff_hz(person: Person, contact: Contact, moment: Moment) -> FloatArray:
    """Return the cutoff at each moment; at least 30 Hz."""
    law = person.cutoff_hz + person.slope_hz_per_mm_s * (moment.speed_mm_s - 60.0)
    for change in person.world.cutoffs:
        law = change(moment, law)
    return np.maximum(contact.cutoff * law, 30.0)


def modes(
    omega: FloatArray, person: Person, moment: Moment
) -> tuple[Poles, Residues, Residues]:
    """Return poles and residues of friction, mount and skin in series, per unit of gain.

    Parameters
    ----------
    omega : ndarray, shape (n_blocks,)
        Cutoff, rad/s.
    person : Person
    moment : Moment

    Returns
    -------
    tuple of Poles, Residues, Residues
        The residues of the force under the screen, and of the skin's acceleration.
    """
    world = person.world
    moving = -omega[:, np.newaxis] * world.rolloff.poles
    weights = omega[:, np.newaxis] * world.rolloff.weights
    depth, section = _section(world.section, moment)
    if section is not None:
        weights = weights * (1.0 + depth[:, np.newaxis] * section.at(moving).real)
    fixed: list[ComplexArray] = []
    of_force: list[ComplexArray] = []
    of_skin: list[ComplexArray] = []

    def add(at: ComplexArray, force: ComplexArray, skin: ComplexArray) -> None:
        before = world.rolloff.at(at / omega[:, np.newaxis])
        fixed.append(at)
        of_force.append(before * force)
        of_skin.append(before * skin)

    def through(at: ComplexArray) -> ComplexArray:
        if section is None:
            return np.ones((omega.size, at.size), dtype=np.complex128)
        return 1.0 + depth[:, np.newaxis] * section.at(at)

    for rational, is_force in ((world.mount, True), (person.skin, False)):
        at = rational.upper_poles()
        found = through(at) * rational.residues(at)
        add(at, found * is_force, found * (not is_force))
    if section is not None:
        at = section.upper_poles()
        found = depth[:, np.newaxis] * section.residues(at)
        add(at, found * world.mount.at(at), found * person.skin.at(at))
    return (
        Poles(moving, np.concatenate(fixed)),
        Residues(weights * world.mount.at(moving).real, np.concatenate(of_force, axis=1)),
        Residues(weights * person.skin.at(moving).real, np.concatenate(of_skin, axis=1)),
    )


def _section(section: Section | None, moment: Moment) -> tuple[FloatArray, Rational | None]:
    """Return how deep a section is, and its band pass."""
    if section is None:
        return np.zeros(0), None
    omega = 2.0 * np.pi * section.frequency_hz
    width = omega / section.quality
    return section.depth(moment), Rational((width, 0.0), (1.0, width, omega**2))


def _saw_tooth(
    world: World, motion: Motion, moment: Moment, rng: np.random.Generator
) -> FloatArray:
    """Return what stick and slip add to friction."""
    assert world.stick_slip is not None
    slip = world.stick_slip
    speed = np.abs(motion.velocity_mm_s)
    path_mm = np.cumsum(speed) * (BLOCK / RATE_HZ)
    periods = finely(path_mm) / slip.period_mm + rng.uniform()
    saw: FloatArray = 2.0 * np.mod(periods, 1.0) - 1.0
    fading = np.exp(-speed / slip.fading_mm_s)
    return slip.amplitude_n * finely(fading * moment.direction) * saw


def _relaxing(skin: Relaxation, motion: Motion, rng: np.random.Generator) -> FloatArray:
    """Return what a skin that is loaded and breaks loose adds to friction, cycle by cycle."""
    speed = finely(np.abs(motion.velocity_mm_s))
    time_s = np.arange(speed.size) / RATE_HZ
    at, begin_s = 0, -float(rng.uniform(0.0, 0.1))
    corners = [(begin_s, -1.0)]
    while begin_s < time_s[-1]:
        breaking_n = 2.0 * skin.amplitude_n * float(np.exp(-speed[at] / skin.fading_mm_s))
        breaking_n *= float(np.exp(skin.scatter * rng.standard_normal()))
        going = max(float(speed[at]), FADE_MM_S)
        stick_s = breaking_n / skin.stiffness_n_per_mm / going
        corners += [(begin_s + stick_s, 1.0), (begin_s + stick_s + skin.slip_s, -1.0)]
        begin_s = corners[-1][0]
        at = min(int(max(begin_s, 0.0) * RATE_HZ), speed.size - 1)
    times, loads = zip(*corners, strict=True)
    fading = skin.amplitude_n * np.exp(-speed / skin.fading_mm_s)
    felt: FloatArray = fading * np.interp(time_s, times, loads)
    return felt


def _filtered(rational: Rational, values: FloatArray) -> FloatArray:
    digital = signal.bilinear(rational.numerator, rational.denominator, RATE_HZ)
    filtered: FloatArray = signal.lfilter(*digital, values)
    return filtered


def finely(of_blocks: FloatArray) -> FloatArray:
    """Return values at every sample, from those at the middle of blocks."""
    grid = (np.arange(of_blocks.size * BLOCK) + 0.5) / BLOCK - 0.5
    fine: FloatArray = np.interp(grid, np.arange(of_blocks.size), of_blocks)
    return fine


def _noise(size: float, samples: int, rng: np.random.Generator) -> FloatArray:
    drawn = rng.standard_normal((samples, 3), dtype=np.float32)
    return np.multiply(drawn, size, dtype=np.float64)


def reports(
    motion: Motion,
    time_s: FloatArray,
    seconds: float,
    rng: np.random.Generator,
    late_s: float = 0.0,
) -> tuple[FloatArray, FloatArray]:
    """Return what the touch sensor says, and when it says that it was so."""
    lead_s = LEAD_SAMPLES / RATE_HZ
    count = int(seconds * REPORT_HZ)
    exact_s = (np.arange(count) + rng.uniform(0.2, 0.8)) / REPORT_HZ
    at_s: FloatArray = np.round(exact_s + rng.uniform(-1e-3, 1e-3, count), 6)
    x_mm = np.interp(at_s - late_s + lead_s, time_s, motion.position_mm)
    place = np.column_stack([x_mm, np.full(count, Y_MM)])
    return REPORT_MM * np.round(place / REPORT_MM), at_s
