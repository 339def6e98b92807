"""From a configuration to a rig with its sensors, and to outputs at 0 V."""

import time
from collections.abc import Callable

from frictus_hardware.nidaq.backend import NiRig, new_session
from frictus_hardware.nidaq.config import NiConfig
from frictus_hardware.nidaq.sensing import ForceSensor, SensorConversion
from frictus_hardware.nidaq.settings import NeonodeSettings, NiRigConfig
from frictus_hardware.nidaq.touch import PointerSource, TouchSensorSource, TouchSource
from frictus_hardware.sensors.analogue import Accelerometer
from frictus_hardware.sensors.ati import read_calibration
from frictus_hardware.sensors.hid import HidPort, TouchLink
from frictus_hardware.sensors.neonode import ScreenFrame, Touchpad
from frictus_hardware.sensors.rotation import in_turn


def make_rig(config: NiRigConfig) -> NiRig:
    """Return the rig, not open yet.

    Parameters
    ----------
    config : NiRigConfig

    Raises
    ------
    ConfigError
        If the force sensor's file cannot be read, or a sensor does not fit its channels.
    """
    wiring = config.wiring
    return NiRig(wiring, conversion_of(config), _touch(config))


def conversion_of(config: NiRigConfig) -> SensorConversion:
    """Return what the configured sensors make of the volts.

    Raises
    ------
    ConfigError
        As `make_rig`.
    """
    force, accel = config.force, config.accel
    return SensorConversion(
        config.wiring,
        ForceSensor(read_calibration(force.calibration), in_turn(force.rotation), force.bias_v),
        Accelerometer(
            zero_g_v=accel.zero_g_v,
            sensitivity_v_per_g=accel.sensitivity_v_per_g,
            output_range_v=accel.output_range_v,
            rotation=in_turn(accel.rotation),
        ),
    )


def _touch(config: NiRigConfig) -> TouchSource:
    touch = config.touch
    latency_s = 1e-3 * touch.latency_ms
    if not isinstance(touch, NeonodeSettings):
        return PointerSource(config.screen_mm, config.sample_rate_hz, latency_s)
    frame = ScreenFrame(touch.x_along, touch.y_along, touch.origin_mm, touch.mm_per_count)

    def make_link(wait: Callable[[float], object]) -> TouchLink:
        pad = Touchpad(frame, stale_s=1e-3 * touch.stale_ms)
        return TouchLink(pad, HidPort(serial_number=touch.serial_number), time.monotonic, wait)

    return TouchSensorSource(make_link, config.sample_rate_hz, latency_s, time.monotonic)


def reset(config: NiConfig) -> None:
    """Put the outputs of a device to 0 V, whoever drives it.

    Raises
    ------
    HardwareError
        If the device cannot be reached; its output may still hold its last value.
    """
    session = new_session(config)
    try:
        session.reset()
    finally:
        session.close()
