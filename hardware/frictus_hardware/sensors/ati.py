"""ATI calibration files (.cal): read strictly, in N, N m and volts.

Each `UserAxis` row is an `Axis` row divided by its scale, seen from the origin that
`BasicTransform` gives. Source: the C library that ATI publishes for sensors on
data-acquisition cards (`createCalibration`, `TTM`).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final
from xml.etree import ElementTree

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_hardware.errors import ConfigError
from frictus_hardware.sensors.analogue import GAUGES, ForceCalibration
from frictus_hardware.sensors.rotation import rotation_about

AXIS_NAMES: Final = ("Fx", "Fy", "Fz", "Tx", "Ty", "Tz")
LARGEST_BYTES: Final = 65536
AGREE_WITHIN: Final = 5e-3
"""Of the largest value of a row; files give five decimals."""
TEMPERATURE_TAGS: Final = ("BiasSlope", "GainSlope", "Thermistor")

_POUND_N: Final = 4.4482216152605
_KILOPOND_N: Final = 9.80665
_INCH_M: Final = 0.0254
FORCE_N: Final[Mapping[str, float]] = {
    "N": 1.0,
    "kN": 1000.0,
    **dict.fromkeys(("lb", "lbf"), _POUND_N),
    **dict.fromkeys(("klb", "klbf"), 1000.0 * _POUND_N),
    **dict.fromkeys(("kg", "kgf"), _KILOPOND_N),
    **dict.fromkeys(("g", "gf"), _KILOPOND_N / 1000.0),
}
TORQUE_N_M: Final[Mapping[str, float]] = {
    **dict.fromkeys(("N-m", "Nm"), 1.0),
    **dict.fromkeys(("N-mm", "Nmm"), 0.001),
    **dict.fromkeys(("kN-m", "kNm"), 1000.0),
    **dict.fromkeys(("lbf-in", "lb-in", "in-lbf", "in-lb"), _POUND_N * _INCH_M),
    **dict.fromkeys(("lbf-ft", "lb-ft", "ft-lbf", "ft-lb"), _POUND_N * 12.0 * _INCH_M),
    **dict.fromkeys(("kg-cm", "kgcm", "kgf-cm"), _KILOPOND_N / 100.0),
}
DISTANCE_M: Final[Mapping[str, float]] = {
    "m": 1.0,
    "cm": 0.01,
    "mm": 0.001,
    "in": _INCH_M,
    "ft": 12.0 * _INCH_M,
}
ANGLE_DEG: Final[Mapping[str, float]] = {
    **dict.fromkeys(("degrees", "degree", "deg"), 1.0),
    **dict.fromkeys(("radians", "radian", "rad"), 180.0 / np.pi),
}
TRUTH: Final[Mapping[str, float]] = {"True": 1.0, "true": 1.0, "False": 0.0, "false": 0.0}


def read_calibration(path: Path) -> ForceCalibration:
    """Read a calibration file.

    Parameters
    ----------
    path : Path

    Raises
    ------
    ConfigError
        If it cannot be read or does not pass `parse_calibration`.
    """
    try:
        with path.open("rb") as file:
            data = file.read(LARGEST_BYTES + 1)
    except OSError as error:
        raise ConfigError(f"the calibration file {path} cannot be read: {error}") from error
    return parse_calibration(data, path.name)


def parse_calibration(data: bytes, name: str) -> ForceCalibration:
    """Return the calibration that a file holds.

    Parameters
    ----------
    data : bytes
        UTF-8, at most 64 KiB, without a document type.
    name : str
        Of the file, for messages.

    Raises
    ------
    ConfigError
        If the XML is not well-formed or declares a document type, or if an element or
        attribute is missing, repeated, of an unknown unit or not a finite number; and if
        `UserAxis` contradicts `Axis`, or the matrix is singular.
    """
    sensor = _Node(_root(data, name), name)
    if sensor.number("NumGages") != GAUGES:
        raise sensor.error("NumGages", f"sensors with {GAUGES} gauges are accepted")
    calibration = sensor.only("Calibration")
    matrix = _matrix(calibration)
    largest = np.abs(matrix).max(axis=1, keepdims=True)
    if not largest.all() or np.linalg.matrix_rank(matrix / largest) < GAUGES:
        raise ConfigError(f"{name}: the calibration matrix is singular; ask for a new file")
    matrix.setflags(write=False)
    return ForceCalibration(
        serial=sensor.text("Serial"),
        body_style=sensor.text("BodyStyle"),
        output_mode=calibration.text("OutputMode"),
        matrix=matrix,
        gauge_range_v=_gauge_range_v(calibration),
        software_temperature=any(calibration.all(tag) for tag in TEMPERATURE_TAGS),
    )


def _root(data: bytes, name: str) -> ElementTree.Element:
    if len(data) > LARGEST_BYTES:
        raise ConfigError(f"{name}: at most {LARGEST_BYTES} bytes are accepted")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ConfigError(f"{name}: not UTF-8 text ({error}); save it as UTF-8") from error
    # Looked for before parsing, so that no entity is ever expanded.
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise ConfigError(f"{name}: document types and entities are not accepted; remove them")
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise ConfigError(f"{name}: not well-formed XML: {error}") from error
    if root.tag != "FTSensor":
        raise ConfigError(f"{name}: the root is <{root.tag}>; <FTSensor> is accepted")
    return root


@dataclass(frozen=True, slots=True)
class _Node:
    """An element that tells what is wrong with it."""

    element: ElementTree.Element
    file: str

    def error(self, attribute: str, accepted: str) -> ConfigError:
        given = self.element.get(attribute)
        what = "is missing" if given is None else f"is {given[:80]!r}"
        label = self.element.get("Name")
        tag = self.element.tag if label is None else f"{self.element.tag}[{label[:20]}]"
        return ConfigError(f"{self.file}: {tag}@{attribute} {what}; {accepted}")

    def text(self, attribute: str) -> str:
        value = (self.element.get(attribute) or "").strip()
        if not value:
            raise self.error(attribute, "some text is accepted")
        return value

    def unit(self, attribute: str, table: Mapping[str, float]) -> float:
        value = table.get((self.element.get(attribute) or "").strip())
        if value is None:
            raise self.error(attribute, f"accepted: {', '.join(table)}")
        return value

    def numbers(self, attribute: str, count: int) -> FloatArray:
        accepted = f"{count} finite number{'s' * (count > 1)} are accepted"
        words = (self.element.get(attribute) or "").split()
        try:
            values = np.array([float(word) for word in words])
        except ValueError as error:
            raise self.error(attribute, accepted) from error
        if values.size != count or not np.all(np.isfinite(values)):
            raise self.error(attribute, accepted)
        return values

    def number(self, attribute: str) -> float:
        return float(self.numbers(attribute, 1)[0])

    def all(self, tag: str) -> list["_Node"]:
        return [_Node(element, self.file) for element in self.element.findall(tag)]

    def only(self, tag: str) -> "_Node":
        found = self.all(tag)
        if len(found) != 1:
            raise ConfigError(
                f"{self.file}: {self.element.tag} has {len(found)} elements {tag}; "
                "exactly one is accepted"
            )
        return found[0]


def _gauge_range_v(calibration: _Node) -> tuple[float, float]:
    span_v = calibration.number("OutputRange")
    if span_v <= 0.0:
        raise calibration.error("OutputRange", "volts above 0 are accepted")
    if calibration.unit("OutputBipolar", TRUTH):
        return -span_v / 2.0, span_v / 2.0
    return 0.0, span_v


def _matrix(calibration: _Node) -> FloatArray:
    units = np.repeat(
        [
            calibration.unit("ForceUnits", FORCE_N),
            calibration.unit("TorqueUnits", TORQUE_N_M),
        ],
        3,
    )[:, np.newaxis]
    user, basic = calibration.all("UserAxis"), calibration.all("Axis")
    if not user and not basic:
        raise ConfigError(f"{calibration.file}: Calibration has no UserAxis; six are accepted")
    if not user:
        return _derived(calibration, units)
    given = units * _values(_rows(calibration, "UserAxis"))
    if basic:
        _require_agreement(calibration.file, given, _derived(calibration, units))
    return given


def _derived(calibration: _Node, units: FloatArray) -> FloatArray:
    rows = _rows(calibration, "Axis")
    scales = np.array([[_scale(rows[name])] for name in AXIS_NAMES])
    derived: FloatArray = _transform(calibration) @ (units * _values(rows) / scales)
    return derived


def _rows(calibration: _Node, tag: str) -> dict[str, _Node]:
    nodes = calibration.all(tag)
    rows = {node.text("Name"): node for node in nodes}
    if len(nodes) != len(AXIS_NAMES) or set(rows) != set(AXIS_NAMES):
        names = ", ".join(str(node.element.get("Name"))[:20] for node in nodes)
        raise ConfigError(
            f"{calibration.file}: {tag}@Name are {names}; accepted is each of "
            f"{', '.join(AXIS_NAMES)} once"
        )
    return rows


def _values(rows: Mapping[str, _Node]) -> FloatArray:
    return np.array([rows[name].numbers("values", GAUGES) for name in AXIS_NAMES])


def _scale(row: _Node) -> float:
    scale = row.number("scale")
    if scale <= 0.0:
        raise row.error("scale", "a number above 0 is accepted")
    return scale


def _transform(calibration: _Node) -> FloatArray:
    """Return what takes a wrench to the origin and axes of the user, shape (6, 6)."""
    if not calibration.all("BasicTransform"):
        return np.eye(6)
    basic = calibration.only("BasicTransform")
    angles = [basic.number(f"R{axis}") for axis in "xyz"]
    if "AngleUnits" in calibration.element.attrib:
        angles = [angle * calibration.unit("AngleUnits", ANGLE_DEG) for angle in angles]
    unit_m = calibration.unit("DistUnits", DISTANCE_M)
    x, y, z = (unit_m * basic.number(f"D{axis}") for axis in "xyz")
    # The axes turn, about x first and each time about their own; so vectors turn back.
    turned = (
        rotation_about("x", angles[0])
        @ rotation_about("y", angles[1])
        @ rotation_about("z", angles[2])
    ).T
    shift = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    transform: FloatArray = np.block([[turned, np.zeros((3, 3))], [-turned @ shift, turned]])
    return transform


def _require_agreement(file: str, given: FloatArray, derived: FloatArray) -> None:
    largest = np.abs(given).max(axis=1)
    off = np.abs(given - derived).max(axis=1)
    for name, row_off, row_largest in zip(AXIS_NAMES, off, largest, strict=True):
        if not row_off <= AGREE_WITHIN * row_largest:
            raise ConfigError(
                f"{file}: UserAxis[{name}] and Axis[{name}] / scale with BasicTransform "
                f"differ by {row_off:.3g} in a row of at most {row_largest:.3g}; "
                f"{AGREE_WITHIN:.1%} is accepted. Use the file as the maker sent it"
            )
