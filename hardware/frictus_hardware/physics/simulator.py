"""What a rig and one finger are, declared: simulated, and predicted in the steady state.

Effects (`frictus_hardware.physics.effects`) extend a simulator; nothing here knows one of them.
"""

from dataclasses import dataclass, field, replace
from typing import Final, Literal

import numpy as np

from frictus_hardware.arrays import ComplexArray, FloatArray
from frictus_hardware.errors import EffectParameterError
from frictus_hardware.physics.disturbances import AddHum, AddStickSlip, Hum, StickSlip
from frictus_hardware.physics.friction import FrictionLaw
from frictus_hardware.physics.linear import Mobility, Mount, TransferFunction
from frictus_hardware.physics.paths import FollowPath, ParallelPath, factor_of
from frictus_hardware.physics.schedule import LawSchedule, SlidingConditions
from frictus_hardware.physics.screen import DriveMap, FilterDrive, MapDrive, Screen
from frictus_hardware.physics.skin import DelayedSkin, NonlinearSkin, SkinLaw
from frictus_hardware.physics.stages import (
    Contact,
    Decimate,
    Drive,
    FrictionResponse,
    MountResponse,
    Skin,
    ZeroOrderHold,
)
from frictus_hardware.physics.twin import Stage, Twin


@dataclass(frozen=True, slots=True)
class Simulator:
    """A rig and one finger.

    Attributes
    ----------
    law : FrictionLaw
        Gain, cutoff and its slope with speed.
    mobility : Mobility
        Mass, damping and stiffness of the skin.
    mount, normal_mount : TransferFunction or None
        The true ones, along and into the screen.
    response : {'friction', 'mobility'}
        Which response the model describes: its channel is the one that a delay makes late.
    hold_s : float
        How long the converter holds a sample.
    schedule : LawSchedule
        What gain and cutoff depend on besides.
    excess_order : float
        By which the friction response falls faster than with first order.
    drive_map : DriveMap
        Static, before `drive_filter`.
    drive_filter : TransferFunction or None
        From drive fraction to drive fraction.
    paths : tuple of ParallelPath
        Along which the drive reaches the finger besides; none by default.
    delay_s, skin_delay_s : float
        By which drive and skin channel are late, and nobody said so; below 0: early.
    stick_slip : tuple of StickSlip
        Oscillations of the friction; none by default.
    hum : tuple of Hum
        Lines of the mains in the force channel; none by default.
    skin : SkinLaw
        What the skin does beyond `mobility`.
    """

    law: FrictionLaw = field(default_factory=FrictionLaw)
    mobility: Mobility = field(default_factory=Mobility)
    mount: TransferFunction | None = Mount().lateral
    normal_mount: TransferFunction | None = Mount().normal
    response: Literal["friction", "mobility"] = "friction"
    hold_s: float = 5e-5
    schedule: LawSchedule = field(default_factory=LawSchedule)
    excess_order: float = 0.0
    drive_map: DriveMap = field(default_factory=DriveMap)
    drive_filter: TransferFunction | None = None
    paths: tuple[ParallelPath, ...] = ()
    delay_s: float = 0.0
    skin_delay_s: float = 0.0
    stick_slip: tuple[StickSlip, ...] = ()
    hum: tuple[Hum, ...] = ()
    skin: SkinLaw = field(default_factory=SkinLaw)

    def twin(
        self,
        screen: Screen,
        friction_coefficient: float,
        sensors: tuple[Stage, ...] = (),
        minutes: float = 0.0,
        seed: int = 0,
        first_sample: int = 0,
    ) -> Twin:
        """Return the twin: the standard one, with stages for what is declared besides.

        Parameters
        ----------
        screen : Screen
            Its peak voltage, carrier and size.
        friction_coefficient : float
            Of finger and glass without drive.
        sensors : tuple of Stage
            At the device's rate.
        minutes : float
            Since the session began, throughout.
        seed : int
            Of the phases of what is locked to nothing.
        first_sample : int
            Device index of the first sample that the twin will see.

        Raises
        ------
        EffectParameterError
            If a channel is early: what is played step by step cannot foretell.
        """
        early_s = min(self.delay_s, self.skin_delay_s)
        if early_s < 0.0:
            raise EffectParameterError(
                f"a channel that is early by {-early_s:g} s cannot be played: no twin knows "
                "what comes; accepted: delays of 0 s and more. Write skew_s into the study."
            )
        starts = np.random.default_rng(seed).random(len(self.hum) + len(self.stick_slip))
        hum_starts, slip_starts = np.split(starts, [len(self.hum)])
        stages: list[Stage] = [
            ZeroOrderHold(),
            Drive(screen),
            *self._drive_path(screen, first_sample),
            *(FollowPath(path, minutes) for path in self.paths),
            FrictionResponse(self.law, self.schedule, self.excess_order, self.delay_s, minutes),
            *map(AddStickSlip, self.stick_slip, slip_starts.tolist()),
            Contact(friction_coefficient),
            MountResponse(self.mount, self.normal_mount),
            *self._skin(minutes),
            Decimate(),
            *map(AddHum, self.hum, (2.0 * np.pi * hum_starts).tolist()),
            *sensors,
        ]
        return Twin(tuple(stages))

    def _drive_path(self, screen: Screen, first_sample: int) -> list[Stage]:
        path: list[Stage] = []
        if self.drive_map != DriveMap():
            path.append(MapDrive(self.drive_map, screen.carrier_hz, first_sample))
        if self.drive_filter is not None:
            path.append(FilterDrive(self.drive_filter))
        return path

    def _skin(self, minutes: float) -> list[Stage]:
        swings: list[Stage] = [Skin(self.mobility)]
        if self.skin != SkinLaw():
            swings = [NonlinearSkin(self.mobility, self.skin, self.law, minutes)]
        return [*swings, DelayedSkin(self.skin_delay_s)] if self.skin_delay_s else swings


@dataclass(frozen=True, slots=True)
class Probe:
    """Where something was measured, and with which message; arrays of shape (n_rows,).

    Attributes
    ----------
    tone_hz : ndarray
        Of each row.
    message : ndarray of complex
        Amplitude of the drive fraction at the tone.
    message_mean : ndarray
        Of the drive fraction.
    message_power : ndarray
        Sum over all tones of ``|amplitude|^2 / 2``.
    circumstances : SlidingConditions
        Speed, force, position, direction and time.
    spread_hz : ndarray, shape (n_rows,), or 0
        Standard deviation of the power over frequency about the tone: of a band; 0 of a tone.
    skewness : ndarray, shape (n_rows,), or 0
        Of the power over frequency, in a band.
    speed_spread_mm_s : ndarray, shape (n_rows,), or 0
        Standard deviation of the speed while a band was measured.
    """

    tone_hz: FloatArray
    message: ComplexArray
    message_mean: FloatArray
    message_power: FloatArray
    circumstances: SlidingConditions
    spread_hz: FloatArray | float = 0.0
    skewness: FloatArray | float = 0.0
    speed_spread_mm_s: FloatArray | float = 0.0


@dataclass(frozen=True, slots=True)
class Prediction:
    """What ideal estimation gives; arrays of shape (n_rows,).

    Attributes
    ----------
    friction : ndarray of complex
        N per unit of drive fraction at the tone.
    second, third : ndarray of complex
        Friction amplitude at two and three times the tone over that at the tone, the phase of
        the (held) message taken out once and twice: ``Y(2f) / (Y(f) exp(i phi))`` and
        ``Y(3f) / (Y(f) exp(2 i phi))``. NaN where there is no message.
    mobility : ndarray of complex
        Skin velocity per newton of friction, m/s/N.
    line_n : ndarray
        Amplitude of the mains' line in the measured force.
    low_n2 : ndarray
        Power of the measured friction from 4 to 30 Hz beyond the base's, N², mount included.
    """

    friction: ComplexArray
    second: ComplexArray
    third: ComplexArray
    mobility: ComplexArray
    line_n: FloatArray
    low_n2: FloatArray


FLAT: Final = 0.8
"""Kurtosis less one of power that is even over a band."""


def predict(
    simulator: Simulator, probe: Probe, nominal_mount: TransferFunction | None
) -> Prediction:
    """Return what an estimator reports that knows nominal mount, hold and declared skews only.

    Of a band it reports the mean over the band's power: that of three frequencies which have
    its centroid, variance and skewness (Gauss; Legendre's, exact to the fifth order, where the
    power is even over the band), each at two speeds that have mean and variance of the speed.
    With two frequencies, the quality of a mode came out 0.5 % too large; without the skewness
    a band on the flank of the mount's second mode was 0.6 % off; at the mean speed alone a
    delay in free strokes was 0.3 % too small.

    Parameters
    ----------
    simulator : Simulator
        A rig and one finger.
    probe : Probe
        Where, and with which message.
    nominal_mount : TransferFunction or None
        What the estimator divides the measured force by.
    """
    if np.any(probe.spread_hz):
        points = _points(probe)
        seen = [predict(simulator, point, nominal_mount) for _, point in points]

        def mean(name: str) -> ComplexArray:
            within: ComplexArray = sum(
                share * getattr(each, name)
                for (share, _), each in zip(points, seen, strict=True)
            )
            return within

        return replace(seen[0], friction=mean("friction"), mobility=mean("mobility"))
    around, tone = probe.circumstances, probe.tone_hz
    gain = simulator.schedule.gain_n(simulator.law, around)
    pole = simulator.schedule.cutoff_hz(simulator.law, around)

    def along(times: int) -> ComplexArray:
        reached = gain * _from_drive(simulator, times * tone, pole)
        reached = reached * factor_of(simulator.paths, times * tone, around)
        return reached * _misjudged(simulator.mount, nominal_mount, times * tone)

    here = along(1)
    friction, second, third = here, np.zeros_like(here), np.zeros_like(here)
    if simulator.drive_map != DriveMap():
        amplitude = np.abs(probe.message)
        made = simulator.drive_map.harmonics(probe.message_mean, amplitude, probe.message_power)
        friction = made.gain * here
        with np.errstate(divide="ignore", invalid="ignore"):  # NaN where there is no message
            below = friction * amplitude * np.sinc(tone * simulator.hold_s)
            second = made.second * along(2) * np.sinc(2.0 * tone * simulator.hold_s) / below
            third = made.third * along(3) * np.sinc(3.0 * tone * simulator.hold_s) / below
    return Prediction(
        friction=friction,
        second=second,
        third=third,
        mobility=_mobility(simulator, tone, around, nominal_mount),
        line_n=np.full(tone.shape, np.hypot.reduce([h.amplitude_n for h in simulator.hum])),
        low_n2=sum(
            (
                oscillation.low_power_n2(around.speed_mm_s, simulator.mount)
                for oscillation in simulator.stick_slip
            ),
            start=np.zeros(tone.shape),
        ),
    )


def _points(probe: Probe) -> list[tuple[FloatArray, Probe]]:
    """Return the frequencies and speeds at which bands are evaluated, and their weights."""
    around, mean_mm_s = probe.circumstances, probe.circumstances.speed_mm_s
    off, weight = _nodes(np.broadcast_to(probe.skewness, probe.tone_hz.shape))
    sides = (-1.0, 1.0) if np.any(probe.speed_spread_mm_s) else (0.0,)
    return [
        (
            share / len(sides),
            Probe(
                probe.tone_hz + each * probe.spread_hz,
                probe.message,
                probe.message_mean,
                probe.message_power,
                replace(around, speed_mm_s=mean_mm_s + side * probe.speed_spread_mm_s),
            ),
        )
        for each, share in zip(off, weight, strict=True)
        for side in sides
    ]


def _nodes(skewness: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return where in a band, in standard deviations, it is evaluated, and the weights.

    Gauss's nodes are the eigenvalues of Jacobi's matrix, here of a density of mean zero,
    variance one and that skewness (Golub and Welsch 1969); the roots of its cubic in closed
    form.

    Parameters
    ----------
    skewness : ndarray, shape (n_rows,)

    Returns
    -------
    ndarray, shape (3, n_rows)
        Falling.
    ndarray, shape (3, n_rows)
        Their sum is one.
    """
    # (x - s/2) (x² - s x - 1) - FLAT x = 0, moved by its mean root s/2: t³ - p t + q = 0.
    half = skewness / 2.0
    p = np.square(half) + 1.0 + FLAT
    q = -FLAT * half
    radius = np.sqrt(p / 3.0)
    angle = np.arccos(-q / (2.0 * radius**3)) / 3.0
    x = half + 2.0 * radius * np.cos(angle - 2.0 * np.pi / 3.0 * np.arange(3)[:, np.newaxis])
    one, other = np.roll(x, -1, axis=0), np.roll(x, 1, axis=0)
    weight: FloatArray = (1.0 + one * other) / ((x - one) * (x - other))
    return x, weight


def _from_drive(
    simulator: Simulator, frequency_hz: FloatArray, cutoff_hz: FloatArray
) -> ComplexArray:
    """Return friction over drive fraction, as a share of the gain."""
    reached: ComplexArray = np.reciprocal(1.0 + 1j * (frequency_hz / cutoff_hz))
    if simulator.excess_order:
        reached **= 1.0 + simulator.excess_order
    if simulator.drive_filter is not None:
        reached *= simulator.drive_filter.frequency_response(frequency_hz)
    if simulator.delay_s:
        reached *= np.exp(-2j * np.pi * simulator.delay_s * frequency_hz)
    return reached


def _misjudged(
    mount: TransferFunction | None, nominal: TransferFunction | None, frequency_hz: FloatArray
) -> ComplexArray | float:
    """Return the estimated force over the true one."""
    if mount == nominal:
        return 1.0
    felt = 1.0 if mount is None else mount.frequency_response(frequency_hz)
    return felt if nominal is None else felt / nominal.frequency_response(frequency_hz)


def _mobility(
    simulator: Simulator,
    tone_hz: FloatArray,
    around: SlidingConditions,
    nominal_mount: TransferFunction | None,
) -> ComplexArray:
    within = around.within(simulator.law)
    true = simulator.skin.frequency_response(simulator.mobility, tone_hz, within)
    if simulator.skin_delay_s:
        true = true * np.exp(-2j * np.pi * simulator.skin_delay_s * tone_hz)
    return true / _misjudged(simulator.mount, nominal_mount, tone_hz)
