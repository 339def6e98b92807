"""A finger with twice the cutoff, on the twin: what a rig publishes of it."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from frictus.aligned import AlignedSamples
from frictus.block import Flag
from frictus.recordings import texture_of
from frictus_hardware import SimulatedConfig
from frictus_hardware.physics.friction import FrictionLaw
from frictus_hardware.physics.linear import Mount
from frictus_hardware.physics.stages import SensorNoise
from frictus_hardware.physics.twin import Signals
from frictus_hardware.simulated.config import SimulatedParticipant
from frictus_hardware.simulated.human import HumanStrokes
from frictus_service.calibration.coordinates import Prior
from frictus_service.fidelity.measure import feel, full_gain
from frictus_service.fidelity.path import walk
from frictus_service.library import SHIPPED
from frictus_service.synthesis.compensability import placeholder_model
from frictus_service.tracking.model_in_force import ModelInForce
from frictus_service.tracking.tracker import Tracker
from frictus_service.tracking.windows import WindowCutter

RATE_HZ = 20_000.0
PERSON = SimulatedParticipant(gain_n=0.39, cutoff_0_hz=2 * 385.68, slope_hz_per_mm_s=2 * 13.811)


def played(person: SimulatedParticipant, seconds: float, seed: int) -> Signals:
    """Return what is played by the placeholder and felt by a person in free strokes."""
    config = SimulatedConfig(seed=seed, finger=HumanStrokes(), participant=person)
    path = walk(config, seconds)
    flat = texture_of((SHIPPED / "flat.json").read_text(encoding="utf-8"))
    scene = full_gain(flat, FrictionLaw(), config.screen, RATE_HZ)
    sensors = (SensorNoise(0.002, 0.05, seed),)
    twin = person.simulator.twin(config.screen, person.friction_coefficient, sensors)
    signals, _ = feel(path, scene, FrictionLaw(), config.screen, twin)
    return signals


def parts(signals: Signals, samples: int = 100) -> Iterator[AlignedSamples]:
    speed = np.hypot(*signals.velocity_mm_s.T)
    for first in range(0, speed.size, samples):
        cut = slice(first, first + samples)
        yield AlignedSamples(
            1,
            first,
            round(5e4 * first),
            RATE_HZ,
            0,
            Flag(0),
            {
                "force": signals.force_n[cut].T.astype(np.float32),
                "voltage": signals.voltage_v[np.newaxis, cut].astype(np.float32),
                "render": np.vstack([signals.position_mm[cut].T, speed[cut]]).astype("f4"),
            },
        )


def tracker() -> Tracker:
    found = Tracker(WindowCutter(RATE_HZ, 75.0, Mount().lateral), Prior.weak(), "rig1")
    found.put_in_force(ModelInForce.of("etag", placeholder_model()))
    return found


def lift(found: Tracker, felt: Signals) -> None:
    """Let the finger leave the screen after what was felt."""
    for part in list(parts(felt))[-30:]:
        nothing = {**part.data, "force": np.zeros_like(part.data["force"])}
        found.take(replace(part, data=nothing, first_sample=part.first_sample + 3_000))
