"""The standard stages in one compiled pass, for rigs that run in real time.

Stage by stage, a 5 ms block costs many small array operations, each of which takes longer to
call than to compute. The pass does the same arithmetic sample by sample; the stages themselves
remain the reference, and what analysis uses.
"""

from dataclasses import dataclass, field
from typing import Final, Self, TypeAlias

import numpy as np
from numba import njit

from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics import linear
from frictus_hardware.physics.friction import FADE_SPEED_MM_S
from frictus_hardware.physics.linear import Mobility
from frictus_hardware.physics.stages import (
    REST_SPEED_MM_S,
    Contact,
    Decimate,
    Drive,
    FrictionResponse,
    MountResponse,
    Quantisation,
    SensorNoise,
    Skin,
    ZeroOrderHold,
)
from frictus_hardware.physics.twin import Signals, Stage, Twin

Generators: TypeAlias = tuple[np.random.Generator, np.random.Generator]

N_STANDARD: Final = 7
"""From `ZeroOrderHold` to `Decimate`."""
SPENT_N: Final = 1e-200
"""Friction below this is set to zero once nothing is driven: without end it would decay into
numbers that processors handle slowly."""


def compiled(twin: Twin) -> Twin:
    """Return the same twin with its standard stages done in one pass, where it has just them.

    Parameters
    ----------
    twin : Twin
        Returned as it is where an effect acts between the standard stages or in the response.
    """
    fused = OnePass.of(twin.stages[:N_STANDARD])
    if fused is None:
        return twin
    match twin.stages[N_STANDARD:]:
        case (*others, SensorNoise() as noise, Quantisation() as steps):
            return Twin((fused, *others, Converter(noise, steps)))
        case others:
            return Twin((fused, *others))


@dataclass(frozen=True, slots=True)
class _PassState:
    """Copied, not changed, by a run."""

    last: FloatArray
    """Volts, velocity (x, y) and normal force of the last sample; see `_started`."""
    friction_n: float
    memory: FloatArray
    """Of the filters, shape (highest order + 1, 5); the last row stays zero."""


@dataclass(frozen=True, slots=True)
class OnePass:
    """The standard stages, from `ZeroOrderHold` to `Decimate`, as one. Made by `compiled`."""

    hold: ZeroOrderHold
    drive: Drive
    response: FrictionResponse
    contact: Contact
    mount: MountResponse
    mobility: Mobility
    _filters: dict[float, FloatArray] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    @classmethod
    def of(cls, stages: tuple[Stage, ...]) -> Self | None:
        """Return the pass that does what these stages do; None where they do more."""
        match stages:
            case (
                ZeroOrderHold() as hold,
                Drive() as drive,
                FrictionResponse() as response,
                Contact() as contact,
                MountResponse() as mount,
                Skin() as skin,
                Decimate() as decimate,
            ) if hold.steps == decimate.steps and response == FrictionResponse(
                response.law, minutes=response.minutes
            ):
                return cls(hold, drive, response, contact, mount, skin.mobility)
        return None

    def initial(self) -> None:
        """Return None: at rest, at 0 V, unloaded."""

    def run(self, signals: Signals, state: _PassState | None) -> tuple[Signals, _PassState]:
        """Set every output at the device's rate."""
        fine_hz = signals.sample_rate_hz * self.hold.steps
        filters = self._filters_at(fine_hz)
        if state is None:
            state = _PassState(_started(signals), 0.0, np.zeros_like(filters[0]))
        last, memory = state.last.copy(), state.memory.copy()
        count = signals.voltage_v.size
        scalars = np.empty((3, count))
        vectors = np.zeros((3, count, 3))
        law = self.response.law
        friction_n = _pass(
            np.ascontiguousarray(signals.voltage_v),
            np.ascontiguousarray(signals.velocity_mm_s),
            np.ascontiguousarray(signals.normal_force_n),
            np.ascontiguousarray(signals.in_contact),
            self.hold.steps,
            self.drive.screen.peak_v,
            law.gain_n,
            law.cutoff_0_hz,
            law.slope_hz_per_mm_s,
            law.speed_range_mm_s[0],
            law.speed_range_mm_s[1],
            fine_hz,
            self.contact.friction_coefficient,
            filters,
            state.friction_n,
            last,
            memory,
            scalars,
            vectors,
        )
        out = Signals(
            signals.sample_rate_hz,
            signals.voltage_v,
            scalars[0],
            signals.position_mm,
            signals.velocity_mm_s,
            signals.normal_force_n,
            signals.in_contact,
            drive_fraction=scalars[1],
            friction_n=scalars[2],
            finger_force_n=vectors[0],
            force_n=vectors[1],
            accel_m_s2=vectors[2],
        )
        return out, _PassState(last, friction_n, memory)

    def _filters_at(self, rate_hz: float) -> FloatArray:
        """Return numerators and denominators in 1/z of force (x, y, z) and skin (x, y).

        Shape (2, highest order + 1, 5), filled up with zeros: so all five take the same steps,
        side by side.
        """
        kept = self._filters.get(rate_hz)
        if kept is None:
            transfers = self.mount.lateral, self.mount.normal, self.mobility.acceleration
            sampled = [_sampled(each, rate_hz) for each in transfers]
            kept = np.zeros((2, max(each.shape[1] for each in sampled), 5))
            for channel, which in enumerate((0, 0, 1, 2, 2)):
                kept[:, : sampled[which].shape[1], channel] = sampled[which]
            self._filters[rate_hz] = kept
        return kept


@dataclass(frozen=True, slots=True)
class Converter:
    """The sensors' noise and the converter's steps, as one. Made by `compiled`."""

    noise: SensorNoise
    steps: Quantisation

    def initial(self) -> Generators:
        """Return the generators of the noise, which move on with each run."""
        return self.noise.initial()

    def run(self, signals: Signals, state: Generators) -> tuple[Signals, Generators]:
        """Set `force_n` and `accel_m_s2`."""
        noise, steps = self.noise, self.steps
        force_n, accel_m_s2 = noise.drawn(signals.force_n.shape, state)
        _convert(
            (signals.force_n, signals.accel_m_s2),
            (noise.force_n, noise.accel_m_s2),
            (steps.force_step_n, steps.accel_step_m_s2),
            (force_n, accel_m_s2),
        )
        return signals.sensed(force_n, accel_m_s2), state


def _started(signals: Signals) -> FloatArray:
    """Return the sample before the first: the finger as at the first, the screen at 0 V."""
    return np.concatenate([[0.0], signals.velocity_mm_s[0], signals.normal_force_n[:1]])


@njit(cache=True, nogil=True)
def _convert(clean, noise, step, out):  # type: ignore[no-untyped-def]
    """Turn what each of `out` holds, white noise of 1, into the noisy signal, in steps."""
    for which in range(2):
        for n in range(clean[which].shape[0]):
            for axis in range(3):
                noisy = clean[which][n, axis] + noise[which] * out[which][n, axis]
                out[which][n, axis] = np.rint(noisy / step[which]) * step[which]


def _sampled(transfer: linear.TransferFunction | None, rate_hz: float) -> FloatArray:
    """Return numerator and denominator in 1/z, shape (2, order + 1); None passes on."""
    if transfer is None:
        return np.ones((2, 1))
    sampled = linear.sample(transfer, rate_hz)
    both: FloatArray = np.array([sampled.numerator, sampled.denominator])
    both /= both[1, 0]
    return both


@njit(cache=True, nogil=True, inline="always")
def _filter(filters, memory, sample, out):  # type: ignore[no-untyped-def]
    """Write five filtered samples as `scipy.signal.lfilter` (transposed direct form II)."""
    for c in range(5):
        out[c] = filters[0, 0, c] * sample[c] + memory[0, c]
    for k in range(1, memory.shape[0]):
        for c in range(5):
            memory[k - 1, c] = (
                memory[k, c] + filters[0, k, c] * sample[c] - filters[1, k, c] * out[c]
            )


@njit(cache=True, nogil=True)
def _pass(  # type: ignore[no-untyped-def]
    voltage_v,
    velocity_mm_s,
    normal_n,
    in_contact,
    steps,
    peak_v,
    gain_n,
    cutoff_0_hz,
    slope_hz,
    slowest_mm_s,
    fastest_mm_s,
    fine_hz,
    friction_coefficient,
    filters,
    friction_n,
    last,
    memory,
    scalars,
    vectors,
):
    """Fill scalars (screen volts, drive fraction, friction) and vectors (finger, force, skin).

    The memory and `last` are changed; what is returned is the friction to go on with.
    """
    sample, out = np.empty(5), np.empty(5)
    for n in range(voltage_v.size):
        volts = last[0]
        fraction = 2.0 * (volts / peak_v) ** 2
        target_n = gain_n * fraction
        if target_n == 0.0 and friction_n < SPENT_N:
            friction_n = 0.0
        touching = 1.0 if in_contact[n] else 0.0
        for step in range(steps):
            share = (step + 1) / steps
            vx = last[1] + share * (velocity_mm_s[n, 0] - last[1])
            vy = last[2] + share * (velocity_mm_s[n, 1] - last[2])
            pressed_n = (last[3] + share * (normal_n[n] - last[3])) * touching
            speed = np.hypot(vx, vy)
            if target_n != 0.0 or friction_n != 0.0:
                clamped = min(max(speed, slowest_mm_s), fastest_mm_s)
                cutoff_hz = cutoff_0_hz + slope_hz * clamped
                decay = np.exp(-2.0 * np.pi * cutoff_hz / fine_hz)
                friction_n = decay * friction_n + (1.0 - decay) * target_n
            rendered_n = friction_n * min(speed / FADE_SPEED_MM_S, 1.0) * touching
            moving = max(speed, 1e-12)
            # Beyond 20 the tangent is 1 to the last digit.
            turned = moving / REST_SPEED_MM_S
            towards = (np.tanh(turned) if turned < 20.0 else 1.0) / moving
            size = (friction_coefficient * pressed_n + rendered_n) * towards
            fx, fy = -size * vx, -size * vy
            sample[0], sample[1], sample[2] = -fx, -fy, pressed_n
            sample[3], sample[4] = fx, fy
            _filter(filters, memory, sample, out)
        scalars[0, n], scalars[1, n], scalars[2, n] = volts, fraction, rendered_n
        vectors[0, n, 0], vectors[0, n, 1], vectors[0, n, 2] = fx, fy, -pressed_n
        vectors[1, n, 0], vectors[1, n, 1], vectors[1, n, 2] = out[0], out[1], out[2]
        vectors[2, n, 0], vectors[2, n, 1] = out[3], out[4]
        last[0] = voltage_v[n]
        last[1], last[2] = velocity_mm_s[n, 0], velocity_mm_s[n, 1]
        last[3] = normal_n[n]
    return friction_n
