"""A rig's configuration file, and the volts that its sensors put out."""

from pathlib import Path

import numpy as np
from tests.hardware.sensors.calibration_file import CalibrationFile, gauge_matrix

from frictus_hardware.arrays import FloatArray

MATRIX = gauge_matrix()
TORQUE_N_M_PER_N = np.array([[0.0, 0.012, 0.0], [-0.012, 0.0, 0.0], [0.0, 0.0, 0.0]])
"""What a force 12 mm above the sensor's origin turns it by."""
BIAS_V = np.array([0.12, -0.3, 0.05, 0.0, 0.2, -0.11])
ZERO_G_V = np.array([0.91, 0.89, 0.9])
V_PER_G = np.array([0.081, 0.079, 0.08])
G_M_S2 = 9.80665
ACCEL_TURN = np.diag([1.0, -1.0, -1.0])
"""Half a turn about x: from the accelerometer's frame to the rig's."""


def write_calibration(folder: Path) -> Path:
    path = folder / "FT01234.cal"
    path.write_text(CalibrationFile(MATRIX).text(), encoding="utf-8")
    return path


def section(folder: Path, address: str = "127.0.0.1:1") -> str:
    """Return the backend's section of a configuration whose file is in the folder."""
    write_calibration(folder)
    return f"""
[backend]
kind = "nidaqmx"
address = "{address}"
deadline_s = 20.0

[backend.force]
calibration = "FT01234.cal"

[backend.accel]
channels = ["ai6", "ai7", "ai16"]
zero_g_v = {ZERO_G_V.tolist()}
sensitivity_v_per_g = {V_PER_G.tolist()}
rotation = [["x", 180.0]]

[backend.monitor]
channel = "ai17"

[backend.touch]
kind = "pointer"
"""


def sensor_volts(
    force_n: FloatArray, accel_m_s2: FloatArray, output_v: FloatArray
) -> FloatArray:
    """Return the volts of all inputs, shape (10, n_samples), for what happens to the sensors.

    Parameters
    ----------
    force_n, accel_m_s2 : ndarray, shape (n_samples, 3)
        In the rig's frame.
    output_v : ndarray, shape (n_samples,)
        At the connector; the monitor reads it back as it is.
    """
    wrench = np.hstack([force_n, force_n @ TORQUE_N_M_PER_N.T])
    gauges_v = BIAS_V + np.linalg.solve(MATRIX, wrench.T).T
    accel_v = ZERO_G_V + (accel_m_s2 @ ACCEL_TURN) / G_M_S2 * V_PER_G
    return np.vstack([gauges_v.T, accel_v.T, output_v])
