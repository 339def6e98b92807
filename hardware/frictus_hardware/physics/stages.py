"""The stages of the standard twin, from volts to sensors."""

from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics import friction, linear
from frictus_hardware.physics.friction import modes
from frictus_hardware.physics.linear import Mobility, Mount
from frictus_hardware.physics.schedule import LawSchedule, SlidingConditions
from frictus_hardware.physics.screen import Screen, drive_fraction_of
from frictus_hardware.physics.twin import Signals, Stage, Twin

REST_SPEED_MM_S = 0.5
"""Friction reverses as tanh(v / this): smooth through rest, 0.9993 of its size at 2 mm/s."""

STEPS_PER_SAMPLE = 4
"""Steps of the twin per device sample. Finger and mount see friction as straight between two
steps: at most 0.1 % off at 1 kHz and 0.2 % at 2 kHz."""


FORCE_NOISE_N: Final = 0.002
"""Of the force sensor, rms per sample at 20 kHz."""


@dataclass(frozen=True, slots=True)
class ZeroOrderHold:
    """From device samples to the twin's steps: the DAC holds its volts, the finger moves on.

    The steps of a block end at its last sample, so that nothing is needed from the next block.
    """

    steps: int = STEPS_PER_SAMPLE

    def initial(self) -> Signals | None:
        """Return None: before its first sample the screen is at 0 V and the finger stands."""
        return None

    def run(self, signals: Signals, state: Signals | None) -> tuple[Signals, Signals]:
        """Return the signals at `steps` times their rate, and their last sample."""
        if state is None:
            state = replace(signals.rows(slice(0, 1)), voltage_v=np.zeros(1))
        held = np.concatenate([state.voltage_v, signals.voltage_v[:-1]])
        fine = Signals.driven(
            signals.sample_rate_hz * self.steps,
            np.repeat(held, self.steps),
            self._between(state.position_mm, signals.position_mm),
            self._between(state.velocity_mm_s, signals.velocity_mm_s),
            self._between(state.normal_force_n, signals.normal_force_n),
            np.repeat(signals.in_contact, self.steps),
        )
        fine = replace(fine, screen_v=fine.voltage_v, voltage_v=signals.voltage_v)
        return fine, signals.rows(slice(-1, None))

    def _between(self, last: FloatArray, now: FloatArray) -> FloatArray:
        before = np.concatenate([last, now[:-1]])[:, np.newaxis]
        share = (np.arange(1, self.steps + 1) / self.steps).reshape(
            1, -1, *[1] * (now.ndim - 1)
        )
        fine: FloatArray = before + share * (now[:, np.newaxis] - before)
        return fine.reshape(-1, *now.shape[1:])


@dataclass(frozen=True, slots=True)
class Drive:
    """Volts to drive fraction, 2 V² / V_pk² (Equation 1). The carrier's line stays in."""

    screen: Screen

    def initial(self) -> None:
        """Return None: there is no memory."""

    def run(self, signals: Signals, state: None) -> tuple[Signals, None]:
        """Set `drive_fraction`."""
        fraction = drive_fraction_of(self.screen, signals.screen_v)
        return replace(signals, drive_fraction=fraction), None


ResponseState = tuple[FloatArray | None, FloatArray]
"""Drive on its way to the finger (None: not begun), and the response's memory."""


@dataclass(frozen=True, slots=True)
class FrictionResponse:
    """Drive fraction to electrostatic friction: Equations 4 and 9, and the fade at rest.

    Attributes
    ----------
    law : FrictionLaw
        Gain, cutoff and its slope with speed.
    schedule : LawSchedule
        What gain and cutoff depend on besides.
    excess_order : float
        By which the response falls faster than with first order.
    delay_s : float
        By which the drive reaches the finger too late; any, also parts of a step.
    minutes : float
        Since the session began.
    """

    law: friction.FrictionLaw
    schedule: LawSchedule = field(default_factory=LawSchedule)
    excess_order: float = 0.0
    delay_s: float = 0.0
    minutes: float = 0.0

    def initial(self) -> ResponseState:
        """Return no drive on its way, and no friction."""
        return None, modes(self.excess_order).at_rest()

    def run(self, signals: Signals, state: ResponseState) -> tuple[Signals, ResponseState]:
        """Set `friction_n`."""
        waiting, memory = state
        rate_hz = signals.sample_rate_hz
        # A held drive that comes later is one whose effect is looked at earlier: whole steps
        # wait, and the rest is where within its step the friction is read.
        whole, early = divmod(self.delay_s * rate_hz, 1.0)
        waiting = np.zeros(int(whole)) if waiting is None else waiting
        drive = signals.drive_fraction
        if waiting.size:
            drive, waiting = np.split(np.concatenate([waiting, drive]), [drive.size])
        around = sliding_conditions_of(signals, self.minutes)
        ended, memory = modes(self.excess_order).respond(
            self.schedule.gain_n(self.law, around) * drive,
            self.schedule.cutoff_hz(self.law, around),
            rate_hz,
            early,
            memory,
        )
        felt = ended * friction.motion_fade(around.speed_mm_s) * signals.in_contact
        return replace(signals, friction_n=felt), (waiting, memory)


@dataclass(frozen=True, slots=True)
class Contact:
    """Friction and normal force to the force on the finger.

    Along the screen ``F = -direction (mu F_n + friction)``, the direction passing smoothly
    through rest.

    Attributes
    ----------
    friction_coefficient : float
        mu, of finger and glass without drive.
    """

    friction_coefficient: float

    def initial(self) -> None:
        """Return None: there is no memory."""

    def run(self, signals: Signals, state: None) -> tuple[Signals, None]:
        """Set `finger_force_n`."""
        speed = np.maximum(_speed(signals), 1e-12)
        towards = np.tanh(speed / REST_SPEED_MM_S) / speed
        pressed = signals.normal_force_n * signals.in_contact
        size = (self.friction_coefficient * pressed + signals.friction_n) * towards
        force = np.empty((speed.size, 3))
        force[:, :2] = -size[:, np.newaxis] * signals.velocity_mm_s
        force[:, 2] = -pressed
        return replace(signals, finger_force_n=force), None


@dataclass(frozen=True, slots=True)
class MountResponse:
    """Force on the finger to what the sensor under the screen feels, through the mount.

    Attributes
    ----------
    lateral, normal : TransferFunction or None
        Force to force, along and into the screen; None: the sensor feels what the screen does.
    """

    lateral: linear.TransferFunction | None
    normal: linear.TransferFunction | None

    def initial(self) -> tuple[None, None]:
        """Return None for both: at rest and unloaded."""
        return None, None

    def run(self, signals: Signals, state: Any) -> tuple[Signals, Any]:
        """Set `force_n`."""
        on_screen = -signals.finger_force_n
        along, into = state
        force = np.empty_like(on_screen)
        rate_hz = signals.sample_rate_hz
        force[:, :2], along = _pass_on(self.lateral, on_screen[:, :2], rate_hz, along)
        force[:, 2:], into = _pass_on(self.normal, on_screen[:, 2:], rate_hz, into)
        return replace(signals, force_n=force), (along, into)


def _pass_on(
    mount: linear.TransferFunction | None,
    force_n: FloatArray,
    rate_hz: float,
    state: FloatArray | None,
) -> tuple[FloatArray, FloatArray | None]:
    if mount is None:
        return force_n, None
    sampled = linear.sample(mount, rate_hz)
    return sampled.run(force_n, sampled.at_rest(force_n.shape[1]) if state is None else state)


@dataclass(frozen=True, slots=True)
class Skin:
    """Force on the finger to the acceleration of its skin along the screen."""

    mobility: Mobility

    def initial(self) -> None:
        """Return None: at rest and unloaded."""

    def run(self, signals: Signals, state: FloatArray | None) -> tuple[Signals, FloatArray]:
        """Set `accel_m_s2`."""
        response = linear.sample(self.mobility.acceleration, signals.sample_rate_hz)
        accel = np.zeros_like(signals.finger_force_n)
        accel[:, :2], state = response.run(
            signals.finger_force_n[:, :2], response.at_rest(2) if state is None else state
        )
        return replace(signals, accel_m_s2=accel), state


@dataclass(frozen=True, slots=True)
class Decimate:
    """From the twin's steps back to device samples, each at n / fs, without a filter.

    The rig has none either: what lies above half the sample rate folds down. Friction itself,
    held at the DAC and sampled here, differs by its folded images from hold times response: at
    60 mm/s by 1.3 % at 1 kHz and 3.9 % at 2 kHz, mostly in phase. The mount filters them out
    of `force_n` (0.1 % at 2 kHz).
    """

    steps: int = STEPS_PER_SAMPLE

    def initial(self) -> None:
        """Return None: there is no memory."""

    def run(self, signals: Signals, state: None) -> tuple[Signals, None]:
        """Return every `steps`-th sample."""
        kept = signals.rows(slice(self.steps - 1, None, self.steps))
        return replace(
            kept,
            sample_rate_hz=signals.sample_rate_hz / self.steps,
            voltage_v=signals.voltage_v,
        ), None


@dataclass(frozen=True, slots=True)
class SensorNoise:
    """White noise of the sensors.

    Attributes
    ----------
    force_n, accel_m_s2 : float
        Standard deviation per sample and axis.
    seed : int
        Of everything random; the same seed gives the same result.
    """

    force_n: float
    accel_m_s2: float
    seed: int

    def initial(self) -> tuple[np.random.Generator, np.random.Generator]:
        """Return one generator per sensor; they are the state and move on with each run."""
        force, accel = np.random.default_rng(self.seed).spawn(2)
        return force, accel

    def run(
        self, signals: Signals, state: tuple[np.random.Generator, np.random.Generator]
    ) -> tuple[Signals, tuple[np.random.Generator, np.random.Generator]]:
        """Add noise to `force_n` and `accel_m_s2`."""
        force, accel = self.drawn(signals.force_n.shape, state)
        noisy = replace(
            signals,
            force_n=signals.force_n + self.force_n * force,
            accel_m_s2=signals.accel_m_s2 + self.accel_m_s2 * accel,
        )
        return noisy, state

    def drawn(
        self, shape: tuple[int, ...], state: tuple[np.random.Generator, np.random.Generator]
    ) -> tuple[FloatArray, FloatArray]:
        """Return noise of 1 for force and acceleration; zeros for a sensor without noise.

        Parameters
        ----------
        shape : tuple of int
            Of what is sensed.
        state : tuple of Generator
            Each moves on where its sensor has noise.
        """
        force, accel = (
            generator.standard_normal(shape) if size else np.zeros(shape)
            for generator, size in zip(state, (self.force_n, self.accel_m_s2), strict=True)
        )
        return force, accel


@dataclass(frozen=True, slots=True)
class Quantisation:
    """The converter's steps. The defaults are 16 bit over the ranges of the paper's rig."""

    force_step_n: float = 0.0005
    accel_step_m_s2: float = 0.04

    def initial(self) -> None:
        """Return None: there is no memory."""

    def run(self, signals: Signals, state: None) -> tuple[Signals, None]:
        """Round `force_n` and `accel_m_s2`."""
        rounded = replace(
            signals,
            force_n=np.rint(signals.force_n / self.force_step_n) * self.force_step_n,
            accel_m_s2=np.rint(signals.accel_m_s2 / self.accel_step_m_s2)
            * self.accel_step_m_s2,
        )
        return rounded, None


def standard_twin(
    screen: Screen = Screen(),  # noqa: B008 - frozen
    law: friction.FrictionLaw = friction.FrictionLaw(),  # noqa: B008
    mobility: Mobility = Mobility(),  # noqa: B008
    mount: Mount = Mount(),  # noqa: B008
    friction_coefficient: float = 0.5,
    sensors: tuple[Stage, ...] = (),
) -> Twin:
    """Return hold, drive, response, contact, mount, skin, decimation, then the sensors' faults.

    Parameters
    ----------
    screen : Screen
        Its peak voltage, carrier and size.
    law : FrictionLaw
        Gain, cutoff and its slope with speed.
    mobility : Mobility
        Mass, damping and stiffness of the skin.
    mount : Mount
        Under the screen.
    friction_coefficient : float
        Of skin on glass, friction over normal force without drive.
    sensors : tuple of Stage
        `SensorNoise`, `Quantisation` or others, at the device's rate. Without them the sensors
        are perfect.
    """
    return Twin(
        (
            ZeroOrderHold(),
            Drive(screen),
            FrictionResponse(law),
            Contact(friction_coefficient),
            MountResponse(mount.lateral, mount.normal),
            Skin(mobility),
            Decimate(),
            *sensors,
        )
    )


def sliding_conditions_of(signals: Signals, minutes: float) -> SlidingConditions:
    """Return the circumstances of a finger at each step.

    Parameters
    ----------
    signals : Signals
        Motion, force and drive at each step.
    minutes : float
        Since the session began.
    """
    return SlidingConditions(
        speed_mm_s=_speed(signals),
        normal_force_n=signals.normal_force_n,
        position_mm=signals.position_mm[:, 0],
        direction=np.sign(signals.velocity_mm_s[:, 0]),
        minutes=np.array(minutes),
    )


def _speed(signals: Signals) -> FloatArray:
    speed: FloatArray = np.hypot(signals.velocity_mm_s[:, 0], signals.velocity_mm_s[:, 1])
    return speed
