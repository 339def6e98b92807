"""A finger's skin beyond one mass, spring and damper."""

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics import linear
from frictus_hardware.physics.friction import FrictionLaw
from frictus_hardware.physics.linear import Mobility, TransferFunction
from frictus_hardware.physics.schedule import SlidingConditions, Term, product
from frictus_hardware.physics.stages import sliding_conditions_of
from frictus_hardware.physics.twin import Signals

REFERENCE_HZ: Final = 200.0
"""Where damping of another order is as strong as that of the base."""
FITTED_HZ: Final = (5.0, 3000.0)
POLES_HZ: Final = (1.0, 8000.0)
POLES: Final = 14
FREQUENCIES: Final = 200
LARGEST_STEP: Final = 2.0
"""Of the fastest motion's rate times a step: beyond 2.6 Runge and Kutta's method grows."""
PARTS: Final = 16
"""Implicit steps per sample."""


@dataclass(frozen=True, slots=True)
class SecondMode:
    """A further resonance beside the first: ``share / b`` at its frequency.

    Attributes
    ----------
    share : float
        Of the first mode's peak, 1 / b.
    frequency_hz, quality : float
        Of the resonance.
    """

    share: float
    frequency_hz: float
    quality: float

    def velocity(self, mobility: Mobility) -> TransferFunction:
        """Return the skin velocity that it adds, m/s/N."""
        natural = 2.0 * np.pi * self.frequency_hz
        band = natural / self.quality
        return TransferFunction(
            (self.share / mobility.damping_n_s_m * band, 0.0), (1.0, band, natural**2)
        )


@dataclass(frozen=True, slots=True)
class SkinLaw:
    """``v / F = s / (m s^2 + b s (s / w_r)^a + k)`` and further modes.

    Attributes
    ----------
    mass_factors, stiffness_factors : tuple of Term
        m and k are multiplied with them.
    damping_excess_order : float
        a.
    further_modes : tuple of SecondMode
        Beside the first.
    """

    mass_factors: tuple[Term, ...] = ()
    stiffness_factors: tuple[Term, ...] = ()
    damping_excess_order: float = 0.0
    further_modes: tuple[SecondMode, ...] = ()

    def frequency_response(
        self, mobility: Mobility, frequency_hz: FloatArray, within: SlidingConditions
    ) -> NDArray[np.complex128]:
        """Return the skin velocity per newton of friction, m/s/N.

        Parameters
        ----------
        mobility : Mobility
            The base.
        frequency_hz : ndarray, shape (n_rows,)
        within : SlidingConditions
            Where the effects follow them.
        """
        s = 2j * np.pi * np.asarray(frequency_hz)
        mass = mobility.mass_kg * product(self.mass_factors, within)
        stiffness = mobility.stiffness_n_m * product(self.stiffness_factors, within)
        order = self.damping_excess_order
        damping = mobility.damping_n_s_m * (s / (2.0 * np.pi * REFERENCE_HZ)) ** order
        response: NDArray[np.complex128] = s / (s * (mass * s + damping) + stiffness)
        for mode in self.further_modes:
            response = response + mode.velocity(mobility).frequency_response(frequency_hz)
        return response


class Damping(NamedTuple):
    """``(s / w_r)^a ~ direct + sum weight pole / (s + pole) + s mass + spring / s``.

    Attributes
    ----------
    direct, mass, spring : float
        Coefficients of the rational approximation.
    pole_rad_s, weight : ndarray, shape (n_poles,)
    """

    direct: float
    mass: float
    spring: float
    pole_rad_s: FloatArray
    weight: FloatArray


@lru_cache(maxsize=64)
def damping_of(excess_order: float) -> Damping:
    """Return a damping of another order as one that can be simulated.

    Fitted from 5 Hz to 3 kHz with weights that dissipate: it cannot become unstable.

    Parameters
    ----------
    excess_order : float
        a, between -1 and 1.
    """
    if excess_order == 0.0:
        return Damping(1.0, 0.0, 0.0, np.zeros(0), np.zeros(0))
    from scipy.optimize import nnls  # late, as in `linear`

    s = 2j * np.pi * np.geomspace(*FITTED_HZ, FREQUENCIES)
    pole = 2.0 * np.pi * np.geomspace(*POLES_HZ, POLES)
    rises = excess_order > 0.0
    along = s[:, np.newaxis]
    parts = (along if rises else pole) / (along + pole)
    last = s if rises else 1.0 / s
    scale = np.abs(last).max()
    target = (s / (2.0 * np.pi * REFERENCE_HZ)) ** excess_order
    columns = np.column_stack([np.ones_like(s), last / scale, parts]) / target[:, np.newaxis]
    found, _ = nnls(
        np.concatenate([columns.real, columns.imag]),
        np.concatenate([np.ones(s.size), np.zeros(s.size)]),
    )
    direct, beyond, share = found[0], found[1] / scale, found[2:]
    if not rises:
        return Damping(direct, 0.0, beyond, pole, share)
    # s / (s + p) = 1 - p / (s + p)
    return Damping(direct + share.sum(), beyond, 0.0, pole, -share)


@dataclass(frozen=True, slots=True)
class NonlinearSkin:
    """Force on the finger to the acceleration of a skin that follows a law.

    Attributes
    ----------
    mobility : Mobility
        Mass, damping and stiffness of the skin.
    skin : SkinLaw
        Mass, damping and stiffness with speed.
    friction_law : FrictionLaw
        Says within which speeds effects follow the speed.
    minutes : float
        Since the session began.
    """

    mobility: Mobility
    skin: SkinLaw
    friction_law: FrictionLaw
    minutes: float

    def initial(self) -> tuple[Any, ...]:
        """Return the memory of the first mode, and of the others: at rest and unloaded."""
        parts = damping_of(self.skin.damping_excess_order).weight.size
        return np.zeros((2, 3 + parts)), *(None for _ in self.skin.further_modes)

    def run(self, signals: Signals, state: tuple[Any, ...]) -> tuple[Signals, tuple[Any, ...]]:
        """Set `accel_m_s2`."""
        first, *others = state
        accel = np.zeros_like(signals.finger_force_n)
        force = signals.finger_force_n[:, :2]
        accel[:, :2], first = self._first_mode(signals, force, first)
        after = []
        for mode, memory in zip(self.skin.further_modes, others, strict=True):
            further = mode.velocity(self.mobility) * TransferFunction((1.0, 0.0), (1.0,))
            sampled = linear.sample(further, signals.sample_rate_hz)
            added, memory = sampled.run(force, sampled.at_rest(2) if memory is None else memory)
            accel[:, :2] += added
            after.append(memory)
        return replace(signals, accel_m_s2=accel), (first, *after)

    def _first_mode(
        self, signals: Signals, force: FloatArray, state: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        within = sliding_conditions_of(signals, self.minutes).within(self.friction_law)
        damping, size = damping_of(self.skin.damping_excess_order), self.mobility.damping_n_s_m
        mass = self.mobility.mass_kg * product(self.skin.mass_factors, within)
        stiffness = self.mobility.stiffness_n_m * product(self.skin.stiffness_factors, within)
        accel = np.empty_like(force)
        after = state.copy()
        for axis in range(2):
            _swing(
                np.broadcast_to(mass + size * damping.mass, signals.friction_n.shape),
                np.broadcast_to(stiffness + size * damping.spring, signals.friction_n.shape),
                size * damping.direct,
                size * damping.weight,
                damping.pole_rad_s,
                1.0 / signals.sample_rate_hz,
                np.ascontiguousarray(force[:, axis]),
                after[axis],
                accel[:, axis],
            )
        return accel, after


@dataclass(frozen=True, slots=True)
class DelayedSkin:
    """The skin's channel too late: a cubic through four steps.

    Attributes
    ----------
    delay_s : float
        Whole steps and a fraction of one.
    """

    delay_s: float

    def initial(self) -> FloatArray | None:
        """Return None: at rest."""
        return None

    def run(self, signals: Signals, state: FloatArray | None) -> tuple[Signals, FloatArray]:
        """Delay `accel_m_s2`."""
        steps = self.delay_s * signals.sample_rate_hz
        first = max(int(steps) - 1, 0)
        kept = first + 3
        before = np.zeros((kept, 3)) if state is None else state
        both = np.concatenate([before, signals.accel_m_s2])
        count = signals.accel_m_s2.shape[0]
        late = np.zeros_like(signals.accel_m_s2)
        for lag, weight in enumerate(_cubic(steps - first)):
            begin = kept - first - lag
            late += weight * both[begin : begin + count]
        return replace(signals, accel_m_s2=late), both[count:]


def _cubic(at: float) -> FloatArray:
    """Return Lagrange's weights of the values at 0, 1, 2, 3."""
    nodes = np.arange(4.0)
    return np.array(
        [np.prod((at - np.delete(nodes, k)) / (k - np.delete(nodes, k))) for k in range(4)]
    )


@njit(cache=True, nogil=True)
def _slope(state, force, mass, stiffness, direct, weight, pole, out):  # type: ignore[no-untyped-def]
    position, velocity = state[0], state[1]
    resisting = direct * velocity + stiffness * position
    for k in range(pole.size):
        resisting += weight[k] * state[2 + k]
        out[2 + k] = pole[k] * (velocity - state[2 + k])
    out[0] = velocity
    out[1] = (force - resisting) / mass


@njit(cache=True, nogil=True)
def _creep(mass, stiffness, direct, weight, pole, step_s, before, now, state):  # type: ignore[no-untyped-def]
    """Follow a force by implicit Euler steps, which cannot grow.

    Return the mean acceleration: at the end of a sample it would be that of a straight force.
    """
    began, part_s = state[1], step_s / PARTS
    holding = mass / part_s + direct + stiffness * part_s
    for k in range(pole.size):
        turn = part_s * pole[k]
        holding += weight[k] * turn / (1.0 + turn)
    for part in range(1, PARTS + 1):
        pushing = before + (now - before) * part / PARTS - stiffness * state[0]
        for k in range(pole.size):
            pushing -= weight[k] * state[2 + k] / (1.0 + part_s * pole[k])
        state[1] = (mass / part_s * state[1] + pushing) / holding
        state[0] += part_s * state[1]
        for k in range(pole.size):
            turn = part_s * pole[k]
            state[2 + k] = (state[2 + k] + turn * state[1]) / (1.0 + turn)
    return (state[1] - began) / step_s


@njit(cache=True, nogil=True)
def _swing(mass, stiffness, direct, weight, pole, step_s, force, memory, out):  # type: ignore[no-untyped-def]
    """Integrate by Runge and Kutta, the force running straight through each step.

    Where the skin moves too fast for that (a light finger, strongly damped), it would grow
    without bound; implicit steps follow it there.
    `memory` holds position, velocity and the damper's parts, and last the force.
    """
    size = 2 + pole.size
    state, slope, total = memory[:size].copy(), np.empty(size), np.empty(size)
    trial = np.empty(size)
    damping = direct + np.sum(np.abs(weight))
    for n in range(force.size):
        before, now = memory[size], force[n]
        memory[size] = now
        fastest = damping / mass[n] + np.sqrt(stiffness[n] / mass[n])
        if fastest * step_s > LARGEST_STEP:
            out[n] = _creep(
                mass[n], stiffness[n], direct, weight, pole, step_s, before, now, state
            )
            continue
        trial[:] = state
        total[:] = 0.0
        for stage in range(4):
            at = before if stage == 0 else (now if stage == 3 else 0.5 * (before + now))
            _slope(trial, at, mass[n], stiffness[n], direct, weight, pole, slope)
            share = step_s / 6.0 if stage == 0 or stage == 3 else step_s / 3.0
            reach = step_s if stage == 2 else 0.5 * step_s
            for k in range(size):
                total[k] += share * slope[k]
                trial[k] = state[k] + reach * slope[k]
        state += total
        _slope(state, now, mass[n], stiffness[n], direct, weight, pole, slope)
        out[n] = slope[1]
    memory[:size] = state
