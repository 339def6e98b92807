"""The twin of a simulated rig, and what the rig says of itself, from its configuration."""

import numpy as np

from frictus_hardware.base import RigInfo
from frictus_hardware.physics.compiled import compiled
from frictus_hardware.physics.stages import Quantisation, SensorNoise
from frictus_hardware.physics.twin import Stage, Twin
from frictus_hardware.simulated.clock import scale_of
from frictus_hardware.simulated.config import SimulatedConfig
from frictus_hardware.simulated.sensors import NailSensor

_NAIL = 1
"""What is drawn for the nail is not drawn for the finger, which has the same seed."""


def info_of(config: SimulatedConfig) -> RigInfo:
    """Return what a rig of this configuration says of itself."""
    return RigInfo(
        backend=config.kind,
        simulated=True,
        finger_source="pointer" if config.finger.kind == "client" else "simulated",
        finger_takeover=config.finger.kind == "takeover",
        sample_rate_hz=config.sample_rate_hz,
        clock_scale=scale_of(config.clock),
        lead_samples=config.lead_samples,
        max_lead_samples=config.max_lead_samples,
        screen_peak_v=config.screen_peak_v,
        screen_mm=config.screen_mm,
        touch_latency_s=config.touch.declared_s,
        converter_steps=_steps() if config.quantisation else {},
    )


def _steps() -> dict[str, float]:
    converter = Quantisation()
    return {"force": converter.force_step_n, "accel": converter.accel_step_m_s2}


def make_twin(config: SimulatedConfig, minutes: float = 0.0) -> Twin:
    """Return the twin of the configured participant and sensors.

    Parameters
    ----------
    config : SimulatedConfig
        Finger, sensors and clock.
    minutes : float
        Since the finger's session began.

    Raises
    ------
    ConfigError
        If the participant has an effect that is not known or out of its range.
    """
    nail = np.random.default_rng((config.seed, _NAIL))
    sensors: tuple[Stage, ...] = (NailSensor.draw(config.nail, config.screen_mm, nail),)
    if config.force_noise_n or config.accel_noise_m_s2:
        noise = SensorNoise(config.force_noise_n, config.accel_noise_m_s2, config.seed)
        sensors = (*sensors, noise)
    if config.quantisation:
        sensors = (*sensors, Quantisation())
    twin = config.participant.simulator.twin(
        config.screen,
        config.participant.friction_coefficient,
        sensors,
        minutes=minutes,
        seed=config.seed,
    )
    return compiled(twin)
