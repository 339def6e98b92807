"""What a rig can know of a finger, and how far the rendered motion is from the true one."""

import secrets
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from frictus.textures import Texture
from frictus_hardware.physics.friction import FrictionLaw
from frictus_hardware.physics.screen import Screen
from frictus_hardware.simulated.config import NailConfig, SimulatedConfig
from frictus_hardware.simulated.faults import SensorFault
from frictus_hardware.simulated.human import HumanStrokes
from frictus_hardware.simulated.motion import Press
from frictus_hardware.simulated.strokes import SteadyStrokes
from frictus_hardware.simulated.touch import TouchConfig
from frictus_service.fidelity.measure import full_gain
from frictus_service.fidelity.path import BLOCK_SAMPLES, Path, walk
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
