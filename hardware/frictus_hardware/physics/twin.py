"""The twin: screen, finger and sensors as an ordered list of stages.

A stage is a frozen model with a pure `run`: signals and a state in, signals and the next state
out, so that the result does not depend on how the samples are split into blocks. An effect is
one more stage, put where it acts.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from frictus_hardware.arrays import FloatArray

States = tuple[Any, ...]


@dataclass(frozen=True, slots=True)
class Signals:
    """What the stages read and write; time along axis 0 of every array.

    Between `stages.ZeroOrderHold` and `stages.Decimate` the sample rate is a multiple of the
    device's, and sample j stands for the instant at the *end* of its step: `screen_v[j]` and
    `drive_fraction[j]` are what was held during the step that ends there.

    Attributes
    ----------
    sample_rate_hz : float
        Of these arrays.
    voltage_v : ndarray, shape (n_samples,)
        Volts at the screen as monitored, each held until the next; at the device's rate
        throughout.
    screen_v : ndarray, shape (n_samples,)
        Volts at the screen during each step.
    position_mm, velocity_mm_s : ndarray, shape (n_samples, 2)
        Of the finger on the screen.
    normal_force_n : ndarray, shape (n_samples,)
        Into the screen, 0 where there is no contact.
    in_contact : ndarray of bool, shape (n_samples,)
    drive_fraction : ndarray, shape (n_samples,)
        2 V² / V_pk², the carrier's line included.
    friction_n : ndarray, shape (n_samples,)
        Electrostatic part of the friction.
    finger_force_n : ndarray, shape (n_samples, 3)
        Force of the screen on the finger; x and y oppose the motion.
    force_n : ndarray, shape (n_samples, 3)
        Force of the finger on the screen as the sensor under it reports: the opposite sign.
    accel_m_s2 : ndarray, shape (n_samples, 3)
        Skin acceleration at the nail.
    """

    sample_rate_hz: float
    voltage_v: FloatArray
    screen_v: FloatArray
    position_mm: FloatArray
    velocity_mm_s: FloatArray
    normal_force_n: FloatArray
    in_contact: NDArray[np.bool_]
    drive_fraction: FloatArray
    friction_n: FloatArray
    finger_force_n: FloatArray
    force_n: FloatArray
    accel_m_s2: FloatArray

    @classmethod
    def driven(
        cls,
        sample_rate_hz: float,
        voltage_v: FloatArray,
        position_mm: FloatArray,
        velocity_mm_s: FloatArray,
        normal_force_n: FloatArray,
        in_contact: NDArray[np.bool_],
    ) -> Self:
        """Return signals of which only the causes are known; the rest is zero.

        Parameters
        ----------
        sample_rate_hz : float
            Of the device.
        voltage_v : ndarray, shape (n_samples,)
            Held from n / fs to (n + 1) / fs.
        position_mm, velocity_mm_s : ndarray, shape (n_samples, 2)
        normal_force_n : ndarray, shape (n_samples,)
        in_contact : ndarray of bool, shape (n_samples,)
        """
        scalar = np.zeros(voltage_v.size)
        vector = np.zeros((voltage_v.size, 3))
        return cls(
            sample_rate_hz,
            voltage_v,
            scalar,
            position_mm,
            velocity_mm_s,
            normal_force_n,
            in_contact,
            drive_fraction=scalar,
            friction_n=scalar,
            finger_force_n=vector,
            force_n=vector,
            accel_m_s2=vector,
        )

    def sensed(self, force_n: FloatArray, accel_m_s2: FloatArray) -> Self:
        """Return the same with other readings of the sensors, each of shape (n_samples, 3)."""
        return type(self)(
            self.sample_rate_hz,
            self.voltage_v,
            self.screen_v,
            self.position_mm,
            self.velocity_mm_s,
            self.normal_force_n,
            self.in_contact,
            self.drive_fraction,
            self.friction_n,
            self.finger_force_n,
            force_n,
            accel_m_s2,
        )

    def arrays(self) -> dict[str, Any]:
        """Return every array by name."""
        return {name: getattr(self, name) for name in _ARRAYS}

    def rows(self, cut: slice) -> Self:
        """Return the samples of a slice."""
        return replace(self, **{name: array[cut] for name, array in self.arrays().items()})


_ARRAYS = tuple(field.name for field in fields(Signals) if field.name != "sample_rate_hz")


class Stage(Protocol):
    """One step from cause to effect."""

    def initial(self) -> Any:
        """Return the state before the first sample."""
        ...

    def run(self, signals: Signals, state: Any) -> tuple[Signals, Any]:
        """Return the signals with this stage's outputs set, and the state to go on with."""
        ...


@dataclass(frozen=True, slots=True)
class Twin:
    """Stages in the order of their causes. `stages.standard_twin` builds the usual one."""

    stages: tuple[Stage, ...]

    def initial(self) -> States:
        """Return the states before the first sample."""
        return tuple(stage.initial() for stage in self.stages)

    def run(self, signals: Signals, states: States) -> tuple[Signals, States]:
        """Run every stage over a block of any length.

        Parameters
        ----------
        signals : Signals
            From `Signals.driven`.
        states : tuple
            From `initial`, or from the block before.
        """
        after = []
        for stage, state in zip(self.stages, states, strict=True):
            signals, state = stage.run(signals, state)
            after.append(state)
        return signals, tuple(after)

    def with_stage(self, stage: Stage, *, after: type) -> "Twin":
        """Return a twin with one more stage, behind the (last) stage of a kind.

        Raises
        ------
        ValueError
            If the twin has no stage of that kind.
        """
        kinds = [type(present) for present in self.stages]
        if after not in kinds:
            names = ", ".join(kind.__name__ for kind in kinds)
            raise ValueError(f"no stage {after.__name__} to stand behind; there are: {names}")
        place = len(kinds) - kinds[::-1].index(after)
        return Twin((*self.stages[:place], stage, *self.stages[place:]))


def simulate(twin: Twin, signals: Signals, block_samples: int = 20_000) -> Signals:
    """Run a whole recording from rest, in blocks, so that memory stays small.

    Parameters
    ----------
    twin : Twin
        The stages from drive to sensors.
    signals : Signals
        From `Signals.driven`.
    block_samples : int
        Does not change the result.
    """
    states = twin.initial()
    parts: list[Signals] = []
    for first in range(0, signals.voltage_v.size, block_samples):
        block = signals.rows(slice(first, first + block_samples))
        block, states = twin.run(block, states)
        parts.append(block)
    return join(parts)


def join(parts: Sequence[Signals]) -> Signals:
    """Return consecutive blocks as one.

    Parameters
    ----------
    parts : sequence of Signals
        At least one, of the same sample rate.
    """
    joined: dict[str, Any] = {
        name: np.concatenate([getattr(part, name) for part in parts]) for name in _ARRAYS
    }
    return replace(parts[0], **joined)
