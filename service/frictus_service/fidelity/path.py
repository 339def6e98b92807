"""A finger's way over the screen, and the target there, computed without rendering's tables.

What is rendered does not move the finger, so one way serves to compare many renderings.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from frictus_hardware.arrays import FloatArray
from frictus_hardware.base import TouchReport
from frictus_hardware.physics.friction import FrictionLaw
from frictus_hardware.simulated.config import SimulatedConfig
from frictus_hardware.simulated.motion import Finger
from frictus_hardware.simulated.rig import SimulatedRig
from frictus_service.synthesis.chain import Chain, Follower
from frictus_service.synthesis.compensation import Invertible
from frictus_service.synthesis.components import Components
from frictus_service.synthesis.estimator import FingerEstimator, PredictedMotion
from frictus_service.synthesis.kernel import BlockMotion
from frictus_service.synthesis.renderer import Renderer
from frictus_service.synthesis.scene import CompiledScene


def exact_friction(
    sums: list[Components], position_mm: FloatArray, first_sample: int, sample_rate_hz: float
) -> FloatArray:
    """Return the friction that a texture asks for along a path, N.

    Parameters
    ----------
    sums : list of Components
        Sums of sinusoids.
    position_mm : ndarray, shape (n_samples, 2)
        Where the finger truly is.
    first_sample : int
        Device index of the first sample; temporal textures hang on it.
    sample_rate_hz : float
        Samples per second of the device's clock.
    """
    total = np.zeros(position_mm.shape[0])
    for components in sums:
        if components.spatial:
            angle = np.deg2rad(components.angle_deg)
            at = position_mm @ np.array([np.cos(angle), np.sin(angle)])
        else:
            at = (first_sample + np.arange(total.size)) / sample_rate_hz
        _add(2.0 * np.pi * components.frequency, components, at, total)
    return total


def _add(rate: FloatArray, components: Components, at: FloatArray, total: FloatArray) -> None:
    harmonics = components.frequency.max() * (components.period or np.inf)
    if harmonics > 10.0 * rate.size:  # few lines far apart: a cosine costs as much as ten terms
        _sum_cosines(rate, components.amplitude_n, components.phase_rad, at, total)
        return
    assert components.period is not None  # or there would be no end of harmonics
    harmonic = np.round(components.frequency * components.period).astype(np.int64)
    series = np.zeros(harmonic.max() + 1, dtype=complex)
    np.add.at(series, harmonic, components.amplitude_n * np.exp(1j * components.phase_rad))
    _sum_series(series, 2.0 * np.pi * at / components.period, total)


@njit(cache=True, nogil=True)
def _sum_cosines(rate, amplitude, phase, at, total):  # type: ignore[no-untyped-def]
    for n in range(at.size):
        for c in range(rate.size):
            total[n] += amplitude[c] * np.cos(rate[c] * at[n] + phase[c])


@njit(cache=True, nogil=True)
def _sum_series(series, angle, total):  # type: ignore[no-untyped-def]
    """Horner's scheme in ``exp(i angle)``, eight samples at a time."""
    width = 8
    turn = np.empty(width, dtype=np.complex128)
    value = np.empty(width, dtype=np.complex128)
    for start in range(0, angle.size, width):
        n = min(width, angle.size - start)
        for i in range(width):
            a = angle[start + min(i, n - 1)]
            turn[i] = complex(np.cos(a), np.sin(a))
            value[i] = 0.0
        for c in range(series.size - 1, -1, -1):
            for i in range(width):
                value[i] = value[i] * turn[i] + series[c]
        for i in range(n):
            total[start + i] += value[i].real


BLOCK_SAMPLES = 100


class KnownFinger:
    """Stands in for the finger estimator where the true motion shall be known.

    Parameters
    ----------
    finger : Finger
        Whose true motion it is.
    sample_rate_hz : float
        Samples per second of the device's clock.
    """

    def __init__(self, finger: Finger, sample_rate_hz: float) -> None:
        self._finger = finger
        self._rate_hz = sample_rate_hz
        self.in_contact = True

    def sense(
        self,
        first_sample: int,
        force_n: FloatArray,
        accel_m_s2: FloatArray,
        saturated: bool = False,
    ) -> None:
        """Ignore what is sensed."""

    def observe(self, report: TouchReport) -> None:
        """Ignore a report."""

    def stale(self, sample: float) -> bool:
        """Return False: what is known does not age."""
        return False

    def predict(self, first_sample: int, n_samples: int) -> PredictedMotion:
        """Return the true motion; its velocity is taken as linear over the block."""
        ends = np.array([first_sample, first_sample + n_samples]) / self._rate_hz
        true = self._finger.at(ends)
        (x, y), _ = true.position_mm
        (vx_0, vy_0), (vx_1, vy_1) = true.velocity_mm_s
        speeds = np.hypot(vx_0, vy_0), np.hypot(vx_1, vy_1)
        pressed = float(true.normal_force_n[0]), float(true.normal_force_n[1])
        return PredictedMotion(
            BlockMotion(x, y, vx_0, vy_0, vx_1, vy_1, *speeds), normal_force_n=pressed
        )


@dataclass(frozen=True, slots=True)
class Path:
    """A way over the screen; time along axis 0, sample 0 is the device's.

    Attributes
    ----------
    position_mm, velocity_mm_s : ndarray, shape (n_samples, 2)
        True.
    normal_force_n : ndarray, shape (n_samples,)
    in_contact : ndarray of bool, shape (n_samples,)
    courses : tuple of PredictedMotion
        As predicted for each block from sample `lead_samples` on.
    lead_samples : int
        Samples between handing over and playing.
    sample_rate_hz : float
        Samples per second of the device's clock.
    touches : tuple of TouchReport
        As they came.
    """

    position_mm: FloatArray
    velocity_mm_s: FloatArray
    normal_force_n: FloatArray
    in_contact: NDArray[np.bool_]
    courses: tuple[PredictedMotion, ...]
    lead_samples: int
    sample_rate_hz: float
    touches: tuple[TouchReport, ...] = ()

    @property
    def speed_mm_s(self) -> FloatArray:
        """True speed, shape (n_samples,)."""
        speed: FloatArray = np.hypot(self.velocity_mm_s[:, 0], self.velocity_mm_s[:, 1])
        return speed


def walk(
    config: SimulatedConfig,
    duration_s: float,
    known: bool = False,
    fuses: bool = True,
    scene: CompiledScene | None = None,
    law: Invertible = FrictionLaw(),  # noqa: B008 - frozen
) -> Path:
    """Let the configured finger move for a while, and predict it as the daemon would.

    Parameters
    ----------
    config : SimulatedConfig
        Its clock is taken as virtual.
    duration_s : float
        How long.
    known : bool
        Whether the true motion is known, or comes from the sensors.
    fuses : bool
        Whether force and acceleration are used, or touch alone.
    scene : CompiledScene, optional
        Played meanwhile: the nail shakes with it. None: nothing is.
    law : FrictionLaw or Inverse
        What is undone in the scene.
    """
    virtual = config.model_copy(update={"clock": "virtual"})
    rate_hz = config.sample_rate_hz
    with SimulatedRig(virtual) as rig:
        estimator: Follower = (
            KnownFinger(rig.finger, rate_hz) if known else FingerEstimator(rate_hz, fuses=fuses)
        )
        renderer = Renderer(law, virtual.screen, rate_hz, BLOCK_SAMPLES, scene)
        chain = Chain(rig, estimator, renderer, BLOCK_SAMPLES)
        if scene is not None:
            rig.arm()
        steps = [
            chain.step(allow=scene is not None)
            for _ in range(round(duration_s * rate_hz / BLOCK_SAMPLES))
        ]
    truths = [step.exchange.truth for step in steps if step.exchange.truth is not None]
    return Path(
        np.concatenate([truth.position_mm for truth in truths]),
        np.concatenate([truth.velocity_mm_s for truth in truths]),
        np.concatenate([truth.normal_force_n for truth in truths]),
        np.concatenate([truth.in_contact for truth in truths]),
        tuple(step.course for step in steps),
        virtual.lead_samples,
        rate_hz,
        tuple(report for step in steps for report in step.exchange.touches),
    )
