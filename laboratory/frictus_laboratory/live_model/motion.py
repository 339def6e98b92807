"""A finger's motion piece by piece, and what the rig takes it to be."""

from bisect import bisect_left
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from frictus_hardware.arrays import BoolArray, FloatArray
from frictus_hardware.base import TouchReport
from frictus_hardware.simulated.config import SimulatedConfig
from frictus_service.fidelity.path import BLOCK_SAMPLES, walk
from frictus_service.synthesis.estimator import PredictedMotion
from frictus_service.synthesis.kernel import BlockMotion


@dataclass(frozen=True, slots=True)
class MotionPiece:
    """Some samples of a motion; time along axis 0.

    Attributes
    ----------
    position_mm, velocity_mm_s : ndarray, shape (n_samples, 2)
        True.
    normal_force_n : ndarray, shape (n_samples,)
        True.
    in_contact : ndarray of bool, shape (n_samples,)
        True.
    courses : tuple of PredictedMotion or None
        What is rendered in each block; None before the first prediction plays.
    touches : tuple of TouchReport or None
        That came meanwhile; None where the rig knows the motion.
    """

    position_mm: FloatArray
    velocity_mm_s: FloatArray
    normal_force_n: FloatArray
    in_contact: BoolArray
    courses: tuple[PredictedMotion | None, ...]
    touches: tuple[TouchReport, ...] | None = None


class Motion(Protocol):
    """A motion of any length."""

    def piece(self, first_sample: int, n_samples: int) -> MotionPiece:
        """Return whole blocks of it, in order."""
        ...


class PredictedPath:
    """As the rig's finger estimator predicts the motion from touch, force and acceleration.

    What is rendered does not move the finger, so that the path is walked once, beforehand.

    Parameters
    ----------
    config : SimulatedConfig
        Finger, sensors and seed.
    seconds : float
        How long.
    """

    def __init__(self, config: SimulatedConfig, seconds: float) -> None:
        self._path = walk(config, seconds)
        late = config.touch.declared_s * config.sample_rate_hz
        self._touches = sorted(self._path.touches, key=lambda report: report.measured_sample)
        self._arrivals = [report.measured_sample + late for report in self._touches]

    def piece(self, first_sample: int, n_samples: int) -> MotionPiece:
        """Return whole blocks of it.

        Parameters
        ----------
        first_sample, n_samples : int
            Multiples of `BLOCK_SAMPLES`.
        """
        path, cut = self._path, slice(first_sample, first_sample + n_samples)
        arrived = (bisect_left(self._arrivals, at) for at in (cut.start, cut.stop))
        blocks = range(first_sample - path.lead_samples, cut.stop - path.lead_samples, 100)
        return MotionPiece(
            path.position_mm[cut],
            path.velocity_mm_s[cut],
            path.normal_force_n[cut],
            path.in_contact[cut],
            tuple(path.courses[at // BLOCK_SAMPLES] if at >= 0 else None for at in blocks),
            tuple(self._touches[slice(*arrived)]),
        )


class KnownMotion:
    """The motion as it truly is: a fifth of the cost, for sessions of many minutes.

    Parameters
    ----------
    config : SimulatedConfig
        Finger and seed.
    """

    def __init__(self, config: SimulatedConfig) -> None:
        self._finger = config.finger.start(config.screen_mm, np.random.default_rng(config.seed))
        self._rate_hz = config.sample_rate_hz

    def piece(self, first_sample: int, n_samples: int) -> MotionPiece:
        """Return whole blocks of it.

        Parameters
        ----------
        first_sample, n_samples : int
            Multiples of `BLOCK_SAMPLES`.
        """
        sample = first_sample + np.arange(n_samples + 1)
        motion = self._finger.at(sample / self._rate_hz)
        ends = slice(None, None, BLOCK_SAMPLES)
        at, velocity = motion.position_mm[ends].tolist(), motion.velocity_mm_s[ends].tolist()
        force = motion.normal_force_n[ends].tolist()
        speed = np.hypot(*motion.velocity_mm_s[ends].T).tolist()
        courses = tuple(
            PredictedMotion(
                BlockMotion(
                    x_mm=at[n][0],
                    y_mm=at[n][1],
                    vx_0=velocity[n][0],
                    vy_0=velocity[n][1],
                    vx_1=velocity[n + 1][0],
                    vy_1=velocity[n + 1][1],
                    speed_0=speed[n],
                    speed_1=speed[n + 1],
                ),
                normal_force_n=(force[n], force[n + 1]),
            )
            for n in range(n_samples // BLOCK_SAMPLES)
        )
        return MotionPiece(
            motion.position_mm[:-1],
            motion.velocity_mm_s[:-1],
            motion.normal_force_n[:-1],
            motion.in_contact[:-1],
            courses,
        )


def rendered_rows(
    courses: tuple[PredictedMotion | None, ...], sample_rate_hz: float
) -> FloatArray:
    """Return position and speed at every sample, as the rig's stream ``render`` carries them.

    Parameters
    ----------
    courses : tuple of PredictedMotion or None
        Of each block; zeros where there is none.
    sample_rate_hz : float
        Samples per second of the device's clock.

    Returns
    -------
    ndarray, shape (3, n_samples)
        x and y in mm, speed in mm/s.
    """
    nothing = (0.0,) * 8
    ends = np.array([nothing if each is None else tuple(each.motion) for each in courses])
    x, y, vx_0, vy_0, vx_1, vy_1, speed_0, speed_1 = ends.T[:, :, np.newaxis]
    share = np.arange(BLOCK_SAMPLES) / BLOCK_SAMPLES
    time_s = np.arange(BLOCK_SAMPLES) / sample_rate_hz
    half = 0.5 * share * time_s
    rows = np.stack(
        [
            x + vx_0 * time_s + (vx_1 - vx_0) * half,
            y + vy_0 * time_s + (vy_1 - vy_0) * half,
            speed_0 + (speed_1 - speed_0) * share,
        ]
    )
    return rows.reshape(3, -1)
