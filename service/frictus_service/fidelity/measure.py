"""Render a texture along a path, feel it with the twin, and compare with the target."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from frictus.textures import BAND_HZ, Map, Region, Scene, Texture
from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.friction import FrictionLaw, cutoff_hz, motion_fade
from frictus_hardware.physics.linear import TransferFunction
from frictus_hardware.physics.screen import Screen
from frictus_hardware.physics.twin import Signals, Twin, simulate
from frictus_service.fidelity.path import BLOCK_SAMPLES, Path, exact_friction
from frictus_service.fidelity.preview import band_power, error_db, rms_db
from frictus_service.synthesis.compensation import Invertible
from frictus_service.synthesis.components import Components, components_of
from frictus_service.synthesis.renderer import Renderer
from frictus_service.synthesis.scene import CompiledScene, compile_scene
from frictus_service.synthesis.tables import BAND_EDGE_HZ

LARGEST_GAIN = 100.0
"""Asked for, so that a texture is scaled to what is feasible."""


def full_gain(
    texture: Texture, law: Invertible, screen: Screen, rate_hz: float
) -> CompiledScene:
    """Return a texture over the whole screen, as strong as the drive allows."""
    scene = Scene(regions=[Region(texture=texture, gain=LARGEST_GAIN)])
    return compile_scene(scene, law, screen, rate_hz)


def target_along(texture: Texture, scene: CompiledScene, path: Path) -> FloatArray:
    """Return the friction asked for at the true positions: applied bias and texture, N.

    Electrostatic friction fades where the finger rests; no rendering can change that, and the
    target fades with it, its bias included.

    Parameters
    ----------
    texture : Texture
        No map: its target has no closed form.
    scene : CompiledScene
        From `full_gain`.
    path : Path
        Of the finger.
    """
    assert not isinstance(texture, Map)
    friction = exact_friction(components_of(texture), path.position_mm, 0, path.sample_rate_hz)
    wanted = scene.applied.bias_n + LARGEST_GAIN * scene.applied.gain * friction
    return wanted * motion_fade(path.speed_mm_s)


def feel(
    path: Path,
    scene: CompiledScene,
    law: Invertible,
    screen: Screen,
    twin: Twin,
    minutes: float = 0.0,
) -> tuple[Signals, int]:
    """Return what the twin's finger feels and its sensors report, and the clipped samples.

    Parameters
    ----------
    path : Path
        Of the finger.
    scene : CompiledScene
        The texture as tables.
    law : FrictionLaw or Inverse
        What is undone.
    screen : Screen
        Its peak voltage, carrier and size.
    twin : Twin
        The stages from drive to sensors.
    minutes : float
        How long the session has lasted when the path begins.
    """
    rate_hz = path.sample_rate_hz
    began = -60.0 * minutes * rate_hz
    renderer = Renderer(law, screen, rate_hz, BLOCK_SAMPLES, scene, began)
    voltage = np.zeros(path.lead_samples + BLOCK_SAMPLES * len(path.courses))
    clipped = 0
    for block, course in enumerate(path.courses):
        at = path.lead_samples + BLOCK_SAMPLES * block
        rendered = renderer.render(at, course, allow=True)
        voltage[at : at + BLOCK_SAMPLES] = rendered.voltage_v
        clipped += rendered.clipped_samples
    signals = Signals.driven(
        rate_hz,
        voltage[: path.position_mm.shape[0]],
        path.position_mm,
        path.velocity_mm_s,
        path.normal_force_n,
        path.in_contact,
    )
    return simulate(twin, signals), clipped


def largest_gain(
    texture: Texture, law: FrictionLaw, speeds_mm_s: FloatArray, rate_hz: float
) -> float:
    """Return the largest gain that fits the drive at given speeds, found without the tables.

    What lies above the tactile band at a speed is left out at that speed.

    Parameters
    ----------
    texture : Texture
        As a client sent it.
    law : FrictionLaw
        Gain, cutoff and its slope with speed.
    speeds_mm_s : ndarray
        Each is tried both ways.
    rate_hz : float
        Samples per second.
    """
    assert not isinstance(texture, Map)
    low = high = 0.0
    for speed in np.concatenate([speeds_mm_s, -speeds_mm_s]):
        decay = np.exp(-2.0 * np.pi * float(cutoff_hz(law, speed)) / rate_hz)
        reach_low = reach_high = 0.0
        for part in components_of(texture):
            felt = part.frequency * (abs(speed) if part.spatial else 1.0) <= BAND_EDGE_HZ
            kept = replace(
                part,
                frequency=part.frequency[felt],
                amplitude_n=part.amplitude_n[felt],
                phase_rad=part.phase_rad[felt],
            )
            here, there = _neighbours(kept, speed, rate_hz)
            drive = (there - decay * here) / ((1.0 - decay) * law.gain_n)
            reach_low += float(drive.min())
            reach_high += float(drive.max())
        low, high = min(low, reach_low), max(high, reach_high)
    return 1.0 / (high - low)


def _neighbours(
    part: Components, speed_mm_s: float, rate_hz: float
) -> tuple[FloatArray, FloatArray]:
    """Return the friction along the whole texture, and one sample later at a speed."""
    length = part.period or 70.0
    at = np.linspace(0.0, length, int(16 * length * float(part.frequency.max())) + 1)
    along = np.column_stack([at, np.zeros_like(at)])
    if part.spatial:
        step = np.array([speed_mm_s / rate_hz, 0.0])
        plain = replace(part, angle_deg=0.0)
        return (
            exact_friction([plain], along, 0, rate_hz),
            exact_friction([plain], along + step, 0, rate_hz),
        )
    friction = exact_friction([part], np.zeros((round(length * rate_hz) + 1, 2)), 0, rate_hz)
    return friction[:-1], friction[1:]


@dataclass(frozen=True, slots=True)
class Error:
    """How far what was felt is from what was asked for.

    Attributes
    ----------
    bands_db : ndarray, shape (16,)
        Level error at the screen in each third octave, NaN where not judged.
    sensor_bands_db : ndarray, shape (16,)
        The same as the force sensor sees it, mount removed.
    waveform : float
        Rms error of the waveform between 20 and 1122 Hz, as a share of the target's rms.
    clipped_samples : int
        Drive samples that were clamped.
    """

    bands_db: FloatArray
    sensor_bands_db: FloatArray
    waveform: float
    clipped_samples: int

    @property
    def rms_db(self) -> float:
        """Over the judged bands."""
        return rms_db(self.bands_db)

    @property
    def sensor_rms_db(self) -> float:
        """The same for the force sensor."""
        return rms_db(self.sensor_bands_db)

    @property
    def worst_db(self) -> float:
        """Largest magnitude over the judged bands."""
        return float(np.nanmax(np.abs(self.bands_db)))


def compare(
    signals: Signals,
    clipped_samples: int,
    target_n: FloatArray,
    mount: TransferFunction,
    segments: Sequence[slice],
) -> Error:
    """Compare what was felt with the target.

    Parameters
    ----------
    signals : Signals
        From `feel`.
    clipped_samples : int
        Drive samples that were clamped.
    target_n : ndarray, shape (n_samples,)
        From `target_along`.
    mount : TransferFunction
        Lateral; taken off what the sensor reports.
    segments : sequence of slice
        What to judge.
    """
    rate = signals.sample_rate_hz
    wanted = band_power(target_n, rate, segments)
    felt = band_power(signals.friction_n, rate, segments)
    reported = signals.force_n[:, 0] * np.sign(signals.velocity_mm_s[:, 0])
    sensed = band_power(reported, rate, segments, mount)
    return Error(
        error_db(felt, wanted),
        error_db(sensed, wanted),
        waveform_error(signals.friction_n, target_n, rate, segments),
        clipped_samples,
    )


def waveform_error(
    felt_n: FloatArray, target_n: FloatArray, sample_rate_hz: float, segments: Sequence[slice]
) -> float:
    """Return the rms difference within the tactile band, as a share of the target's rms."""
    apart = whole = 0.0
    for segment in segments:
        window = np.hanning(segment.stop - segment.start)
        frequency = np.fft.rfftfreq(window.size, 1.0 / sample_rate_hz)
        inside = (frequency >= BAND_HZ[0]) & (frequency <= BAND_EDGE_HZ)
        felt, wanted = (
            np.fft.rfft(window * (part - part.mean()))[inside]
            for part in (felt_n[segment], target_n[segment])
        )
        apart += float(np.sum(np.square(np.abs(felt - wanted))))
        whole += float(np.sum(np.square(np.abs(wanted))))
    return float(np.sqrt(apart / whole))


def steady_segments(path: Path, speed_mm_s: float, settle_s: float = 0.25) -> list[slice]:
    """Return the stretches at a steady speed, each without its first `settle_s`.

    What is predicted still follows the reversal while the estimator has not seen its end.
    """
    steady = np.abs(path.speed_mm_s - speed_mm_s) < 0.01 * speed_mm_s
    steady[: path.lead_samples + round(0.1 * path.sample_rate_hz)] = False
    edges = np.flatnonzero(np.diff(np.concatenate([[False], steady, [False]]).astype(int)))
    settle = round(settle_s * path.sample_rate_hz)
    least = round(0.2 * path.sample_rate_hz)
    return [
        slice(int(begin) + settle, int(end))
        for begin, end in zip(edges[::2], edges[1::2], strict=True)
        if end - begin - settle >= least
    ]
