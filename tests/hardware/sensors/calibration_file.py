"""Writes calibration files as the maker does, from a matrix in N, N m and volts."""

import dataclasses
from dataclasses import dataclass

import numpy as np

from frictus_hardware.arrays import FloatArray

AXES = ("Fx", "Fy", "Fz", "Tx", "Ty", "Tz")
FORCE_N = {"N": 1.0, "kN": 1e3, "lbf": 4.4482216152605, "kg": 9.80665}
TORQUE_N_M = {
    "N-m": 1.0,
    "N-mm": 1e-3,
    "lbf-in": 0.1129848290276167,
    "ft-lb": 1.3558179483314004,
    "kg-cm": 0.0980665,
}
DISTANCE_M = {"m": 1.0, "mm": 1e-3, "in": 0.0254}


def moved(distance_m: FloatArray, turned: FloatArray) -> FloatArray:
    """The wrench at another origin and in other axes, from T' = T - d x F."""
    transform = np.zeros((6, 6))
    transform[:3, :3] = transform[3:, 3:] = turned
    for column, force in enumerate(np.eye(3)):
        transform[3:, column] = turned @ -np.cross(distance_m, force)
    return transform


@dataclass(frozen=True)
class CalibrationFile:
    """What the file says; `matrix` is what a reader must get, N/V and N m/V."""

    matrix: FloatArray
    force_units: str = "N"
    torque_units: str = "N-m"
    distance_units: str = "m"
    distance_m: tuple[float, float, float] = (0.0, 0.0, 0.012)
    angles_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)
    turned: FloatArray = dataclasses.field(default_factory=lambda: np.eye(3))
    """What `angles_deg` means, given apart so that the reader's own formula is not used."""
    scales: tuple[float, ...] = (3.0, 3.0, 0.7, 45.0, 45.0, 43.0)
    user: bool = True
    basic: bool = True
    decimals: int = 12
    extra: str = ""

    def text(self) -> str:
        units = np.repeat([FORCE_N[self.force_units], TORQUE_N_M[self.torque_units]], 3)
        undone = np.linalg.inv(moved(np.array(self.distance_m), self.turned)) @ self.matrix
        basic = np.array(self.scales)[:, np.newaxis] * undone / units[:, np.newaxis]
        lines = [
            '<?xml version="1.0" encoding="utf-8"?>',
            "<!-- NOTE: the UserAxis elements are the calibration matrix. -->",
            '<FTSensor  Serial="FT01234" BodyStyle="Nano43" Family="DAQ" NumGages="6">',
            f'<Calibration PartNumber="SI-36-0.5" ForceUnits="{self.force_units}" '
            f'TorqueUnits="{self.torque_units}" DistUnits="{self.distance_units}" '
            'OutputMode="Ground Referenced Differential" OutputRange="20" '
            'OutputBipolar="True">',
        ]
        if self.basic:
            lines += [
                f'<Axis Name="{name}" values="{self._row(row)}" max="36" scale="{scale!r}"/>'
                for name, row, scale in zip(AXES, basic, self.scales, strict=True)
            ]
            unit_m = DISTANCE_M[self.distance_units]
            x, y, z = (value / unit_m for value in self.distance_m)
            a, b, c = self.angles_deg
            lines.append(
                f'<BasicTransform Dx="{x}" Dy="{y}" Dz="{z}" Rx="{a}" Ry="{b}" Rz="{c}"/>'
            )
        if self.user:
            lines += [
                f'<UserAxis Name="{name}" values="{self._row(row)}" max="36"/>'
                for name, row in zip(AXES, self.matrix / units[:, np.newaxis], strict=True)
            ]
        return "\n".join([*lines, self.extra, "</Calibration></FTSensor>"])

    def _row(self, row: FloatArray) -> str:
        return " " + "  ".join(f"{value:.{self.decimals}f}" for value in row) + " "


def gauge_matrix() -> FloatArray:
    """Three pairs of gauges at thirds of a ring: one bends up, one sideways."""
    around = np.deg2rad([0.0, 120.0, 240.0])
    matrix = np.zeros((6, 6))
    matrix[2, 0::2] = 12.0
    matrix[0, 1::2], matrix[1, 1::2] = 8.0 * np.cos(around), 8.0 * np.sin(around)
    matrix[3, 0::2], matrix[4, 0::2] = 0.15 * np.sin(around), -0.15 * np.cos(around)
    matrix[5, 1::2] = 0.12
    return matrix
