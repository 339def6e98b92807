"""How far off friction is rendered: by what is known of the finger, and by what is undone."""

import secrets
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from frictus.textures import Texture
from frictus_hardware.physics.effects import extended
from frictus_hardware.physics.friction import FrictionLaw
from frictus_hardware.physics.linear import Mount
from frictus_hardware.physics.screen import Screen
from frictus_hardware.physics.simulator import Simulator
from frictus_hardware.physics.stages import Quantisation, SensorNoise, standard_twin
from frictus_hardware.simulated.config import SimulatedConfig
from frictus_hardware.simulated.faults import SensorFault
from frictus_hardware.simulated.human import HumanStrokes
from frictus_hardware.simulated.motion import Press
from frictus_hardware.simulated.sensors import NailConfig, TouchConfig
from frictus_hardware.simulated.strokes import SteadyStrokes
from frictus_service.fidelity.measure import (
    Error,
    compare,
    feel,
    full_gain,
    steady_segments,
    target_along,
    waveform_error,
)
from frictus_service.fidelity.path import BLOCK_SAMPLES, Path, walk
from frictus_service.fidelity.preview import band_power, error_db, rms_db, windows
from frictus_service.synthesis.compensability import inverse_of
from frictus_service.synthesis.compensation import Inverse, Invertible, fixed_at, uncompensated
from frictus_service.synthesis.scene import CompiledScene

RATE_HZ = 20_000.0
SCREEN = Screen()
LAW = FrictionLaw()
KINDS = (20.0, 60.0, 100.0)
Table = tuple[list[str], list[dict[str, object]]]


@dataclass(frozen=True)
class Way:
    """What is known of the finger, and how far ahead the output is queued."""

    name: str
    lead_ms: float = 20.0
    known: bool = False
    fuses: bool = True

    def walk(
        self, config: SimulatedConfig, duration_s: float, scene: CompiledScene | None = None
    ) -> Path:
        """Return a path as it is predicted this way while a texture plays."""
        config = config.model_copy(update={"lead_ms": self.lead_ms})
        played = None if self.known or not self.fuses else scene
        return walk(config, duration_s, self.known, self.fuses, played, LAW)


TOUCH = Way("touch, 20 ms", fuses=False)
FUSED = Way("fused, 20 ms")
SHORT = Way("fused, 5 ms", lead_ms=5.0)
TRUE = Way("true state", known=True)
WAYS = (TOUCH, FUSED, SHORT, TRUE)


def strokes_at(speed: float, wander: bool = True) -> SimulatedConfig:
    """Return steady strokes with a fresh seed."""
    press = Press() if wander else Press(wander_n=0.0)
    finger = SteadyStrokes(speed_mm_s=speed, press=press)
    return SimulatedConfig(finger=finger, touch=TouchConfig(), seed=secrets.randbits(32))


def kinematics(texture: Texture, n_seeds: int) -> Table:
    """Measure where and how fast the finger is rendered, beside the truth."""
    lines = [
        "| strokes | way | position, rms | 99.9 % within | within 1 mm | speed, rms "
        "| within 0.1 s of a turn | elsewhere |",
        "|---|---|---|---|---|---|---|---|",
    ]
    figures: list[dict[str, object]] = []
    scene = full_gain(texture, LAW, SCREEN, RATE_HZ)
    kinds = {f"{speed:g} mm/s": [strokes_at(speed) for _ in range(n_seeds)] for speed in KINDS}
    kinds["free"] = [
        SimulatedConfig(finger=HumanStrokes(), seed=secrets.randbits(32))
        for _ in range(n_seeds)
    ]
    for title, configs in kinds.items():
        for way in (TOUCH, FUSED, SHORT):
            errors = [rendered_errors(way.walk(config, 11.0, scene)) for config in configs]
            position, velocity, near = (
                np.concatenate([error[part] for error in errors]) for part in range(3)
            )
            turning = near > 0.0
            values = {
                "position_rms_mm": rms(position),
                "position_999_mm": float(np.quantile(position, 0.999)),
                "within_1_mm": float(np.mean(position <= 1.0)),
                "speed_rms_mm_s": rms(velocity),
                "near_turn_rms_mm_s": rms(velocity[turning]),
                "elsewhere_rms_mm_s": rms(velocity[~turning]),
            }
            lines.append(
                f"| {title} | {way.name} | {values['position_rms_mm']:.2f} mm "
                f"| {values['position_999_mm']:.2f} mm | {100 * values['within_1_mm']:.2f} % "
                f"| {values['speed_rms_mm_s']:.1f} mm/s "
                f"| {values['near_turn_rms_mm_s']:.1f} mm/s "
                f"| {values['elsewhere_rms_mm_s']:.1f} mm/s |"
            )
            figures.append({"strokes": title, "way": way.name, **values})
    return lines, figures


def rms(values: NDArray[np.float64]) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(np.square(values)))) if values.size else 0.0


def rendered_errors(
    path: Path,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return at each block after the first second: errors, mm and mm/s, and 1 near a turn."""
    at = path.lead_samples + BLOCK_SAMPLES * np.arange(len(path.courses))
    kept = (at < path.position_mm.shape[0]) & (at >= RATE_HZ)
    rendered = np.array([course.motion[:4] for course in path.courses])[kept]
    at = at[kept]
    position = np.hypot(*(rendered[:, :2] - path.position_mm[at]).T)
    velocity = rendered[:, 2] - path.velocity_mm_s[at, 0]
    turns = np.flatnonzero(np.diff(np.sign(path.velocity_mm_s[:, 0])) != 0)
    near = np.min(np.abs(at[:, np.newaxis] - turns), axis=1) < 0.1 * RATE_HZ
    return position, velocity, near.astype(np.float64)


def failing_sensors(texture: Texture) -> Table:
    """Measure the position from 0.5 s after a sensor failed, beside touch alone and fused."""
    scene = full_gain(texture, LAW, SCREEN, RATE_HZ)
    config = strokes_at(60.0)

    def position_mm(way: Way, config: SimulatedConfig) -> float:
        path = way.walk(config, 11.0, scene)
        return rms(rendered_errors(path)[0][round(2.5 * RATE_HZ / BLOCK_SAMPLES) :])

    rows = {"nothing; touch alone": position_mm(TOUCH, config)}
    rows["nothing; fused"] = position_mm(FUSED, config)
    for sensor in ("accel", "force"):
        for becomes in ("dead", "stuck", "saturated", "loose"):
            fault = SensorFault.model_validate(
                {"at_sample": 60_000, "sensor": sensor, "becomes": becomes}
            )
            failing = config.model_copy(update={"faults": (fault,)})
            rows[f"{sensor}: {becomes}"] = position_mm(FUSED, failing)
    for turned_deg in (90.0, 180.0):
        nail = NailConfig(mounted_deg=(0.0, 0.0, turned_deg))
        turned = config.model_copy(update={"nail": nail})
        rows[f"accel: mounted {turned_deg:g} degrees off"] = position_mm(FUSED, turned)
    lines = ["| fails | position, rms |", "|---|---|"]
    lines += [f"| {title} | {value:.2f} mm |" for title, value in rows.items()]
    return lines, [{"fails": title, "position_rms_mm": value} for title, value in rows.items()]


MODES: Final = ("compensated", "fixed at 60 mm/s", "none")


def inverses(law: FrictionLaw) -> dict[str, FrictionLaw]:
    """Return the laws that the three ways of rendering invert."""
    return dict(zip(MODES, (law, fixed_at(law, 60.0), uncompensated(law)), strict=True))


def judge(
    path: Path,
    texture: Texture,
    law: FrictionLaw,
    segments: list[slice],
    modes: tuple[str, ...] = MODES,
    true_law: FrictionLaw | None = None,
    noise: bool = True,
) -> dict[str, Error]:
    """Render a texture along a path in several ways; `law` is what the service believes."""
    sensors = (SensorNoise(0.002, 0.05, 1), Quantisation()) if noise else ()
    twin = standard_twin(screen=SCREEN, law=true_law or law, sensors=sensors)
    scene = full_gain(texture, law, SCREEN, RATE_HZ)
    target = target_along(texture, scene, path)
    errors = {}
    for mode in modes:
        signals, clipped = feel(path, scene, inverses(law)[mode], SCREEN, twin)
        errors[mode] = compare(signals, clipped, target, Mount().lateral, segments)
    return errors


def whole(path: Path) -> list[slice]:
    """Return windows over all of a path but its first second."""
    first = round(RATE_HZ)
    return [
        slice(part.start + first, part.stop + first)
        for part in windows(path.position_mm.shape[0] - first, 8192)
    ]


Effects = Sequence[tuple[str, Mapping[str, float]]]

FRICTION_COEFFICIENT = 0.5
"""Of the finger without drive; what is compared does not depend on it."""


@dataclass(frozen=True, slots=True)
class PlayedStroke:
    """A path at one speed, and when in its session it is made.

    Attributes
    ----------
    path : Path
        Of the finger.
    speed_mm_s : float
        Between the turns.
    minutes : float
        Since the session began.
    """

    path: Path
    speed_mm_s: float
    minutes: float = 0.0


@dataclass(frozen=True, slots=True)
class RenderingError:
    """How far what is felt is from what was asked for.

    Attributes
    ----------
    rms_db : float
        Level error in third octaves, over strokes, directions and thirds of the way.
    waveform : float
        Rms error of the waveform as a share of the target's, over strokes.
    clipped_share : float
        Share of the samples whose drive did not fit.
    """

    rms_db: float
    waveform: float
    clipped_share: float


@dataclass(frozen=True, slots=True)
class ExtensionGain:
    """The error before and after the effects came into the model, and the strength it costs.

    Attributes
    ----------
    before, after : RenderingError
        Without and with the effects in the model.
    applied_share : float
        Largest gain of the texture with the effects over that without.
    """

    before: RenderingError
    after: RenderingError
    applied_share: float


def gain_of(
    effects: Effects,
    texture: Texture,
    strokes: Sequence[PlayedStroke],
    law: FrictionLaw,
    screen: Screen,
) -> ExtensionGain:
    """Feel a texture on a twin that has the effects, without and with them undone.

    Parameters
    ----------
    effects : sequence of (id, parameters)
        What the finger has, and what the extended model says.
    texture : Texture
        No map.
    strokes : sequence of PlayedStroke
        Along which it is felt.
    law : FrictionLaw
        Of the finger and of both models.
    screen : Screen
        Its peak voltage, carrier and size.
    """
    simulator = extended(Simulator(law=law), effects)
    inverse = inverse_of(law, effects)
    rate_hz = strokes[0].path.sample_rate_hz
    plain = full_gain(texture, law, screen, rate_hz).applied.gain
    applied = full_gain(texture, inverse, screen, rate_hz).applied.gain
    before, after = (
        _felt(undone, inverse, simulator, texture, strokes, screen) for undone in (law, inverse)
    )
    return ExtensionGain(before, after, applied / plain)


def _felt(
    undone: Invertible,
    fitting: Inverse,
    simulator: Simulator,
    texture: Texture,
    strokes: Sequence[PlayedStroke],
    screen: Screen,
) -> RenderingError:
    errors, shapes, clipped, samples = [], [], 0, 0
    for stroke in strokes:
        path = stroke.path
        scene = full_gain(texture, fitting, screen, path.sample_rate_hz)
        twin = simulator.twin(screen, FRICTION_COEFFICIENT, minutes=stroke.minutes)
        signals, missed = feel(path, scene, undone, screen, twin, stroke.minutes)
        target = target_along(texture, scene, path)
        segments = steady_segments(path, stroke.speed_mm_s)
        errors += [
            error_db(
                band_power(signals.friction_n, path.sample_rate_hz, [piece]),
                band_power(target, path.sample_rate_hz, [piece]),
            )
            for segment in segments
            for piece in thirds(segment)
        ]
        shapes.append(waveform_error(signals.friction_n, target, path.sample_rate_hz, segments))
        clipped += missed
        samples += target.size
    return RenderingError(
        rms_db(np.array(errors)), float(np.sqrt(np.mean(np.square(shapes)))), clipped / samples
    )


def thirds(segment: slice) -> list[slice]:
    """Return a segment in three parts: near its begin, in the middle, and near its end."""
    edges = np.linspace(segment.start, segment.stop, 4).astype(int).tolist()
    return [slice(begin, end) for begin, end in pairwise(edges)]
