"""How an accelerometer is mounted and how late a touch sensor is, from strokes of a finger.

A finger that strokes accelerates, and both sensors see it: the touch sensor as the second
derivative of a position that is late, the accelerometer along axes that are turned against
the rig's. In a band that holds the turns of strokes (1 to 8 Hz)

``a = R (s x''(t + d) - c (F'' - r F''') + g x)``

with the rotation R, the scale s (1 where units are right), the delay d by which touch reports
are older than declared, the compliance c of the skin, which the friction F drags along with a
time constant r, and the gravity g that enters as the nail leans over a stroke. Steady strokes
alone cannot tell d from c: where the finger turns, F'' is as x'''. So the skin has a prior,
and what it leaves unknown is part of the interval of d.

R is the rotation that takes the directions of x and y, as far as the finger went along them,
and that of gravity to what was sensed, each by its variance (Wahba's problem; covariance by
Shuster and Oh 1981).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from scipy.ndimage import gaussian_filter1d

from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.linear import Mobility
from frictus_hardware.sensors.rotation import nearest_rotation
from frictus_service.errors import AlignmentError
from frictus_service.identification.observation.stroke_pieces import (
    LARGEST_DELAY_S,
    MARGIN_S,
    NARROW_S,
    RATE_HZ,
    SensedStrokes,
    StrokePiece,
    pieces_of,
)

LEAST_S: Final = 4.0
"""What is left of the strokes must be as long."""
TOUCH_STEP_MM: Final = 0.1
SEEN: Final = 8.0
"""Acceleration along an axis over the noise of the touch sensor, from which on it counts."""
LEAST_SCALE: Final = 0.01
EXPLAINED: Final = 0.5
"""Share of the acceleration that the strokes must explain."""
SKIN: Final = 0.6
"""Standard deviation of the skin's compliance and damping over persons, as a share."""
LEAN_M_S2_PER_M: Final = 10.0
"""Standard deviation of the gravity that enters over a stroke: 4 degrees over 70 mm."""
GRAVITY_M_S2: Final = 9.80665
GRAVITY_SEEN: Final = 0.5, 1.5
"""Of a g; an accelerometer that is coupled through a capacitor sees none."""
LEVEL_RAD: Final = np.deg2rad(10.0)
"""Standard deviation of how level a screen stands."""
SLIDES_MM_S: Final = 10.0
_STILL: Final = (
    "the accelerometer does not move with the finger: see whether it is connected, and pressed "
    "onto the nail"
)


@dataclass(frozen=True, slots=True, eq=False)
class SensorAlignment:
    """How the sensors of a rig lie to one another in space and time.

    Attributes
    ----------
    rotation : ndarray, shape (3, 3)
        From the accelerometer's frame, as configured, to the rig's: the identity where the
        configuration is right.
    rotation_sd_deg : tuple of float
        Standard deviation about x, y and z of the rig.
    scale : float
        Acceleration as sensed over that of the strokes.
    scale_sd : float
        Its standard deviation.
    touch_late_s : float
        By which touch reports are older than declared.
    touch_late_sd_s : float
        Its standard deviation.
    friction_off_deg : float or None
        By which the lateral force is turned against the motion, about z; None where nothing
        slid.
    off_level_deg : float or None
        Of gravity, turned into the rig's frame; None where the sensor does not see it.
    along : tuple of bool
        Whether the finger went along x, and along y, enough to tell.
    explained : float
        Share of the acceleration that the strokes explain.
    seconds : float
        Of strokes that were used.
    """

    rotation: FloatArray
    rotation_sd_deg: tuple[float, float, float]
    scale: float
    scale_sd: float
    touch_late_s: float
    touch_late_sd_s: float
    friction_off_deg: float | None
    off_level_deg: float | None
    along: tuple[bool, bool]
    explained: float
    seconds: float

    @property
    def mirrored(self) -> bool:
        """Whether gravity points up: a channel has the wrong sign, or two are swapped."""
        return self.off_level_deg is not None and self.off_level_deg > 90.0


def align_sensors(strokes: Sequence[SensedStrokes]) -> SensorAlignment:
    """Return how the accelerometer is mounted and how late the touch sensor is.

    Parameters
    ----------
    strokes : sequence of SensedStrokes
        At changing speeds, with many turns, in both directions; 20 s of free strokes along x
        tell the delay within 2 ms.

    Raises
    ------
    AlignmentError
        If the finger was not followed for long enough, did not move, or the accelerometer does
        not move with it.
    """
    pieces = [piece for each in strokes for piece in pieces_of(each)]
    seconds = sum(piece.time_s.size / piece.rate_hz for piece in pieces)
    if seconds < LEAST_S:
        raise AlignmentError(
            f"the finger was followed for {seconds:.1f} s without a gap of touch or samples; "
            f"at least {LEAST_S:g} s are needed: stroke on without lifting"
        )
    delay_s, columns, along = _roughly(pieces)
    if not np.linalg.norm(columns.directions) > LEAST_SCALE:
        raise AlignmentError(_STILL)
    sensed = np.concatenate([piece.accel_m_s2 for piece in pieces])
    gravity = np.mean([piece.mean_m_s2 for piece in pieces], axis=0)
    for _ in range(20):
        rotation, covariance = _rotation(columns, along, gravity)
        terms = _Terms(pieces, delay_s)
        fit = _fit(sensed @ rotation, terms, along)
        step_s = fit.values[1] / fit.values[0]
        delay_s += step_s
        if not abs(delay_s) < LARGEST_DELAY_S:
            raise AlignmentError(
                "the touch reports fit the acceleration nowhere within "
                f"{1e3 * LARGEST_DELAY_S:g} ms of the declared latency; correct it, then "
                "stroke again"
            )
        columns = _columns(sensed, terms, fit, rotation, along)
        if abs(step_s) < 1e-6:
            break
    if not fit.explained > EXPLAINED:
        raise AlignmentError(_STILL)
    sd = np.sqrt(np.diag(fit.covariance))
    return SensorAlignment(
        rotation=rotation.T,
        rotation_sd_deg=tuple(np.rad2deg(np.sqrt(np.diag(covariance))).tolist()),
        scale=float(fit.values[0]),
        scale_sd=float(sd[0]),
        touch_late_s=float(delay_s),
        touch_late_sd_s=float(sd[1] / fit.values[0]),
        friction_off_deg=_friction_off_deg(pieces, delay_s),
        off_level_deg=_off_level_deg(rotation.T @ gravity),
        along=along,
        explained=fit.explained,
        seconds=seconds,
    )


class _Terms:
    """What the acceleration is made of, rows of all pieces, if touch is late by a delay."""

    def __init__(self, pieces: Sequence[StrokePiece], delay_s: float) -> None:
        def joined(order: int) -> FloatArray:
            return np.concatenate([piece.motion(delay_s, order) for piece in pieces])

        self.position, self.acceleration = joined(0), joined(2)
        force = np.concatenate([piece.force_n_s2 for piece in pieces])
        later = np.concatenate([piece.force_n_s3 for piece in pieces])
        self.all = self.acceleration, joined(3), force, later, self.position


class _Fit(NamedTuple):
    """Coefficients of the terms, and how sure they are."""

    values: FloatArray
    covariance: FloatArray
    explained: float


class _Columns(NamedTuple):
    """Where motion along x and y was sensed, and the variance of each component."""

    directions: FloatArray
    variances: FloatArray


def _roughly(pieces: Sequence[StrokePiece]) -> tuple[float, _Columns, tuple[bool, bool]]:
    """Return the delay, of a coarse grid, at which least is left, and what holds there.

    Raises
    ------
    AlignmentError
        If the finger moved along no axis.
    """
    sensed = np.concatenate([piece.accel_m_s2 for piece in pieces])
    # White noise of rounding, by the reports' rate, through the second derivative.
    impulse = np.zeros(2 * round(MARGIN_S * RATE_HZ) + 1)
    impulse[impulse.size // 2] = 1.0
    gain = gaussian_filter1d(impulse, NARROW_S * RATE_HZ, order=2) * RATE_HZ**2
    spacing_s = float(np.median(np.diff(pieces[0].path.x)))
    noise = 1e-3 * TOUCH_STEP_MM / np.sqrt(12.0) * np.linalg.norm(gain)
    noise *= np.sqrt(max(spacing_s * RATE_HZ, 1.0))
    moved = np.std(_Terms(pieces, 0.0).acceleration, axis=0) > SEEN * noise
    along = bool(moved[0]), bool(moved[1])
    if not any(along):
        raise AlignmentError(
            "the finger hardly accelerated: stroke to and fro, 60 mm/s and faster"
        )
    best = np.inf, 0.0
    for delay_s in np.arange(-LARGEST_DELAY_S, LARGEST_DELAY_S + 1e-9, 0.004):
        terms = _Terms(pieces, float(delay_s))
        free = np.hstack([terms.acceleration[:, along], terms.position[:, along]])
        coefficients = np.linalg.lstsq(free, sensed, rcond=None)[0]
        left = float(np.sum((sensed - free @ coefficients) ** 2))
        if left < best[0]:
            best = left, float(delay_s)
            directions = np.zeros((2, 3))
            directions[np.array(along)] = coefficients[: sum(along)]
    return best[1], _Columns(directions, np.full((2, 3), 1e-4)), along


def _sees_gravity(mean_m_s2: FloatArray) -> bool:
    low, high = GRAVITY_SEEN
    return bool(low < np.linalg.norm(mean_m_s2) / GRAVITY_M_S2 < high)


def _rotation(
    columns: _Columns, along: tuple[bool, bool], gravity: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the rotation from the rig's frame to the sensor's, and its covariance, rad²."""
    seen = [axis for axis in range(2) if along[axis]]
    lengths = np.linalg.norm(columns.directions, axis=1)
    sensed = [columns.directions[axis] / lengths[axis] for axis in seen]
    known = [np.eye(3)[axis] for axis in seen]
    weights = [lengths[axis] ** 2 / columns.variances[axis].max() for axis in seen]
    if _sees_gravity(gravity):
        sensed.append(gravity / np.linalg.norm(gravity))
        known.append(np.array([0.0, 0.0, -1.0]))
        weights.append(LEVEL_RAD**-2)
    profile = sum(
        weight * np.outer(there, here)
        for weight, there, here in zip(weights, sensed, known, strict=True)
    )
    # About an axis that nothing was seen across, any angle may be: half a turn.
    information = np.eye(3) / np.pi**2 + sum(
        weight * (np.eye(3) - np.outer(here, here))
        for weight, here in zip(weights, known, strict=True)
    )
    return nearest_rotation(np.asarray(profile)), np.linalg.inv(information)


def _fit(sensed: FloatArray, terms: _Terms, along: tuple[bool, bool]) -> _Fit:
    """Return what the acceleration along the screen is made of, by ridge regression."""
    seen = np.array(along)
    skin = Mobility()
    compliance = 1.0 / skin.stiffness_n_m
    damped = compliance**2 * skin.damping_n_s_m
    middle = np.array([0.0, 0.0, -compliance, damped, 0.0])
    spread = np.array([np.inf, np.inf, SKIN * compliance, SKIN * damped, LEAN_M_S2_PER_M])
    prior = np.diag(spread**-2)
    rows = np.column_stack([term[:, seen].T.ravel() for term in terms.all])
    wanted = sensed[:, :2][:, seen].T.ravel()
    left = wanted - rows @ np.linalg.lstsq(rows, wanted, rcond=None)[0]
    variance = float(np.var(left)) * _correlated_rows(left)
    information = rows.T @ rows / max(variance, 1e-12) + prior
    covariance = np.linalg.inv(information)
    values = covariance @ (rows.T @ wanted / max(variance, 1e-12) + prior @ middle)
    explained = 1.0 - float(np.var(wanted - rows @ values) / max(np.var(wanted), 1e-12))
    return _Fit(values, covariance, explained)


def _correlated_rows(left: FloatArray) -> float:
    """Return the rows that count as one: integrated autocorrelation up to its first zero."""
    size = left.size
    power = np.abs(np.fft.rfft(left, 2 * size)) ** 2
    correlation = np.fft.irfft(power)[:size] / max(float(np.sum(left**2)), 1e-12)
    positive = np.cumprod(correlation > 0.0)
    return max(1.0, 2.0 * float(np.sum(correlation * positive)) - 1.0)


def _columns(
    sensed: FloatArray, terms: _Terms, fit: _Fit, rotation: FloatArray, along: tuple[bool, bool]
) -> _Columns:
    """Return in which directions motion along x and y was sensed, less what else there is."""
    seen = np.array(along)
    besides = sum(
        value * term for value, term in zip(fit.values[2:], terms.all[2:], strict=True)
    )
    rows = terms.acceleration[:, seen]
    wanted = sensed - np.asarray(besides) @ rotation[:, :2].T
    coefficients = np.linalg.lstsq(rows, wanted, rcond=None)[0]
    left = wanted - rows @ coefficients
    per_row = np.array([np.var(left[:, k]) * _correlated_rows(left[:, k]) for k in range(3)])
    directions, variances = np.zeros((2, 3)), np.ones((2, 3))
    directions[seen] = coefficients
    variances[seen] = np.diag(np.linalg.inv(rows.T @ rows))[:, np.newaxis] * per_row
    return _Columns(directions, variances)


def _off_level_deg(gravity_m_s2: FloatArray) -> float | None:
    """Return the angle between gravity, in the rig's frame, and the screen's depth."""
    if not _sees_gravity(gravity_m_s2):
        return None
    cosine = -gravity_m_s2[2] / np.linalg.norm(gravity_m_s2)
    return float(np.rad2deg(np.arccos(np.clip(cosine, -1.0, 1.0))))


def _friction_off_deg(pieces: Sequence[StrokePiece], delay_s: float) -> float | None:
    """Return by how much the force on the screen is turned against the motion."""
    turned = 0.0j
    for piece in pieces:
        velocity = piece.path(piece.time_s + delay_s, 1)
        speed = np.linalg.norm(velocity, axis=1)
        slides = speed > SLIDES_MM_S
        along = velocity[slides] / speed[slides, np.newaxis]
        force = piece.mean_force_n[slides]
        turned += np.sum((force @ [1.0, 1.0j]) * (along @ [1.0, -1.0j]))
    return float(np.rad2deg(np.angle(turned))) if turned else None
