"""The channels that a recording may have, and their units, as files and people write them."""

import re
from dataclasses import dataclass
from typing import Final, Literal

Dimension = Literal[
    "force", "length", "speed", "acceleration", "voltage", "time", "frequency", "ratio",
    "counts", "angle", "level",
]  # fmt: skip

STANDARD_GRAVITY_M_S2: Final = 9.80665
POUND_N: Final = 4.4482216152605
INCH_M: Final = 0.0254


@dataclass(frozen=True, slots=True)
class ChannelUnit:
    """A unit.

    Attributes
    ----------
    dimension : str
        What it measures.
    factor : float
        To newton, mm, mm/s, m/s², volt, second, hertz, 1, count, radian or decibel.
    """

    dimension: Dimension
    factor: float


UNITS: Final[dict[str, ChannelUnit]] = {
    "N": ChannelUnit("force", 1.0),
    "mN": ChannelUnit("force", 1e-3),
    "uN": ChannelUnit("force", 1e-6),
    "kN": ChannelUnit("force", 1e3),
    "gf": ChannelUnit("force", STANDARD_GRAVITY_M_S2 * 1e-3),
    "kgf": ChannelUnit("force", STANDARD_GRAVITY_M_S2),
    "lbf": ChannelUnit("force", POUND_N),
    "mm": ChannelUnit("length", 1.0),
    "cm": ChannelUnit("length", 10.0),
    "m": ChannelUnit("length", 1e3),
    "um": ChannelUnit("length", 1e-3),
    "in": ChannelUnit("length", INCH_M * 1e3),
    "mm/s": ChannelUnit("speed", 1.0),
    "cm/s": ChannelUnit("speed", 10.0),
    "m/s": ChannelUnit("speed", 1e3),
    "um/s": ChannelUnit("speed", 1e-3),
    "m/s2": ChannelUnit("acceleration", 1.0),
    "mm/s2": ChannelUnit("acceleration", 1e-3),
    "g": ChannelUnit("acceleration", STANDARD_GRAVITY_M_S2),
    "mg": ChannelUnit("acceleration", STANDARD_GRAVITY_M_S2 * 1e-3),
    "V": ChannelUnit("voltage", 1.0),
    "mV": ChannelUnit("voltage", 1e-3),
    "kV": ChannelUnit("voltage", 1e3),
    "s": ChannelUnit("time", 1.0),
    "ms": ChannelUnit("time", 1e-3),
    "us": ChannelUnit("time", 1e-6),
    "ns": ChannelUnit("time", 1e-9),
    "min": ChannelUnit("time", 60.0),
    "Hz": ChannelUnit("frequency", 1.0),
    "kHz": ChannelUnit("frequency", 1e3),
    "rad/s": ChannelUnit("frequency", 0.15915494309189535),
    "1": ChannelUnit("ratio", 1.0),
    "%": ChannelUnit("ratio", 0.01),
    "counts": ChannelUnit("counts", 1.0),
    "deg": ChannelUnit("angle", 0.017453292519943295),
    "rad": ChannelUnit("angle", 1.0),
    "dB": ChannelUnit("level", 1.0),
}

_SPELLINGS: Final = {
    "newton": "N", "newtons": "N", "millinewton": "mN", "grams": "gf", "gram": "gf",
    "lb": "lbf", "lbs": "lbf", "pound": "lbf", "pounds": "lbf",
    "millimeter": "mm", "millimetre": "mm", "millimeters": "mm",
    "meter": "m", "metre": "m", "meters": "m", "inch": "in", "inches": "in",
    "mm/sec": "mm/s", "mmps": "mm/s", "m/sec": "m/s", "mm_s": "mm/s", "m_s": "m/s",
    "mps": "m/s", "m/s^2": "m/s2", "m/s/s": "m/s2", "m_s2": "m/s2", "m.s-2": "m/s2",
    "ms-2": "m/s2", "ms2": "m/s2", "mps2": "m/s2", "m/s**2": "m/s2",
    "g0": "g", "gee": "g", "volt": "V", "volts": "V", "sec": "s", "second": "s",
    "seconds": "s", "msec": "ms", "usec": "us", "hertz": "Hz", "count": "counts",
    "adc": "counts", "lsb": "counts", "raw": "counts", "degree": "deg", "degrees": "deg",
    "db": "dB", "hz": "Hz", "khz": "kHz", "n": "N", "mn": "mN", "v": "V", "mv": "mV",
    "full scale": "counts", "percent": "%",
}  # fmt: skip


def find_unit(text: str) -> str | None:
    """Return a unit's name in `UNITS`, however it is spelled; None where it is unknown.

    Parameters
    ----------
    text : str
        As a file or a person writes it.
    """
    plain = text.strip().replace("µ", "u").replace("μ", "u").replace("²", "2").replace("·", ".")
    if plain in UNITS:
        return plain
    return _SPELLINGS.get(plain.lower())


def is_unit(text: str) -> bool:
    """Return whether text is the name of a unit."""
    return find_unit(text) is not None


def units_of(dimension: Dimension) -> tuple[str, ...]:
    """Return the names of all units that measure the same.

    Parameters
    ----------
    dimension : str
        As `ChannelUnit.dimension`.
    """
    return tuple(name for name, unit in UNITS.items() if unit.dimension == dimension)


_BRACKETED: Final = re.compile(r"(.*?)\s*[\[(]([^\])]+)[\])]\s*")
_SUFFIXED: Final = (
    ("_m_s2", "m/s2"), ("_mm_s2", "mm/s2"), ("_mm_s", "mm/s"), ("_m_s", "m/s"),
    ("_um_s", "um/s"),
)  # fmt: skip


def unknown_unit(name: str, unit: str) -> str:
    """Return what a column names as its unit and is none; empty where it names one, or none.

    Parameters
    ----------
    name, unit : str
        As the file has them.
    """
    bracketed = _BRACKETED.fullmatch(name)
    text = unit.strip() or (bracketed[2].strip() if bracketed else "")
    return "" if text == "-" or is_unit(text) else text


def split_name(name: str) -> tuple[str, str]:
    """Return the name of a column without its unit, and the unit, empty where it has none.

    Parameters
    ----------
    name : str
        As `Fx [mN]`, `Fx (N)`, `force_x_mN`, `force_mN:2` (a column of a matrix) or `Fx`.
    """
    matrix, colon, number = name.rpartition(":")
    if colon and number.isdigit():
        bare, unit = split_name(matrix)
        return f"{bare}:{number}", unit
    if (match := _BRACKETED.fullmatch(name)) and is_unit(match[2]):
        return match[1], find_unit(match[2]) or ""
    for suffix, unit in _SUFFIXED:
        if name.lower().endswith(suffix) and len(name) > len(suffix):
            return name[: -len(suffix)], unit
    head, found, tail = name.rpartition("_")
    if found and head and tail in UNITS:
        return head, tail
    if found and head and is_unit(tail):
        unit, channel = find_unit(tail) or "", named_channel(head)
        # `force_n` is normal and `skin_v` a velocity; `voltage_v` is in V.
        if len(tail) > 1 or (channel and channel.dimension == UNITS[unit].dimension):
            return head, unit
    return name, ""


@dataclass(frozen=True, slots=True)
class Channel:
    """One channel.

    Attributes
    ----------
    name : str
        In a column map.
    dimension : str
        Of its units.
    meaning : str
        For people: what it is, and in which direction it is positive.
    pattern : str
        Regular expression of the names that files give it, lower case.
    magnitude : tuple of float
        Between these its size in a sliding recording lies, in the kept unit; by it a unit is
        guessed where the file names none.
    """

    name: str
    dimension: Dimension
    meaning: str
    pattern: str
    magnitude: tuple[float, float]


CHANNELS: Final = (
    Channel("time", "time", "of each sample", r"t|time|time_?stamps?|zeit|x_value", (0.0, 1e7)),
    Channel(
        "force_x",
        "force",
        "of the finger on the screen along the slide, positive with the velocity",
        r"f_?x|f_?t|force_?[xt]|f_?lat|f_?tan|lat|tan|tangential.*|lateral.*|friction(?!.*coef).*|"
        r"shear.*|force:1",
        (0.01, 20.0),
    ),
    Channel("force_y", "force", "across the slide", r"f_?y|force_?y|force:2", (1e-4, 20.0)),
    Channel(
        "force_z",
        "force",
        "into the screen",
        r"f_?z|f_?n|force_?[zn]|f_?norm?|nor|normal.*|load.*|press.*|force:3",
        (0.05, 20.0),
    ),
    Channel(
        "position_x",
        "length",
        "of the finger along the slide",
        r"x|p(os)?_?x|position(_?x)?|x_?pos(ition)?|finger_?x|touch_?x|pos|weg|"
        r"(pos|position):1",
        (3.0, 700.0),
    ),
    Channel(
        "position_y",
        "length",
        "of the finger across the slide",
        r"y|p(os)?_?y|position_?y|y_?pos(ition)?|finger_?y|touch_?y|(pos|position):2",
        (0.0, 700.0),
    ),
    Channel(
        "position_time",
        "time",
        "of each position, where it has a clock of its own",
        r"(pos(ition)?|touch)_?t(ime)?|t_?(pos(ition)?|touch)",
        (0.0, 1e7),
    ),
    Channel(
        "velocity_x",
        "speed",
        "of the finger or of the stage under it, along the slide",
        r"v|v_?x|vel(ocity)?(_?x)?|speed|(stage|finger)_?(vel(ocity)?|speed)",
        (1.0, 1000.0),
    ),
    Channel(
        "skin_velocity",
        "speed",
        "of the skin along the slide, as a vibrometer measures it",
        r"skin_?(vel(ocity)?|v).*|(ldv|vibrometer|laser)(?!.*(pos|disp|dist)).*",
        (0.1, 300.0),
    ),
    Channel(
        "accel_x",
        "acceleration",
        "of the nail along the slide",
        r"a_?x|acc(el(eration)?)?_?x?|(acc|accel):1",
        (0.1, 2000.0),
    ),
    Channel(
        "accel_y",
        "acceleration",
        "of the nail across the slide",
        r"a_?y|acc(el(eration)?)?_?y|(acc|accel):2",
        (0.1, 2000.0),
    ),
    Channel(
        "accel_z",
        "acceleration",
        "of the nail into the screen",
        r"a_?z|acc(el(eration)?)?_?z|(acc|accel):3",
        (0.1, 2000.0),
    ),
    Channel(
        "drive_voltage",
        "voltage",
        "at the screen, carrier included",
        r"u|volt(age)?s?|drive(_?v(oltage)?)?|v_?screen|screen_?v|monitor|hv|ao\d?",
        (15.0, 500.0),
    ),
    Channel(
        "drive_envelope",
        "voltage",
        "amplitude of the carrier at the screen",
        r"env(elope)?|(drive|voltage)_?(amp(litude)?|env(elope)?)|amplitude",
        (15.0, 500.0),
    ),
    Channel(
        "drive_fraction",
        "ratio",
        "of full drive, 2 V² / V_pk²",
        r"(drive|message)_?(fraction|level)?|command|msg|cmd",
        (0.02, 1.0),
    ),
)  # fmt: skip

BY_NAME: Final = {channel.name: channel for channel in CHANNELS}
DRIVES: Final = ("drive_voltage", "drive_envelope", "drive_fraction")


def named_channel(name: str) -> Channel | None:
    """Return the channel that a column's name, without its unit, stands for; None where none.

    Parameters
    ----------
    name : str
        As the file has it.
    """
    last = re.split(r"[./]", name)[-1]
    plain = re.sub(r"[\s\-]+", "_", last.strip().lower())
    if plain in BY_NAME:
        return BY_NAME[plain]
    return next((each for each in CHANNELS if re.fullmatch(each.pattern, plain)), None)


def channel_of(name: str, unit: str) -> Channel | None:
    """Return the channel that name and unit stand for; where they differ, the unit decides.

    Parameters
    ----------
    name : str
        As the file has it, without its unit.
    unit : str
        One of `UNITS`; empty where none is named.
    """
    channel = named_channel(name)
    if channel is None or not unit:
        return channel
    dimension = UNITS[unit].dimension
    if dimension == channel.dimension or (
        dimension == "counts" and channel.dimension == "force"
    ):
        return channel
    if channel.name in DRIVES:  # what drives is called alike, whatever is known of it
        drive = {"voltage": "drive_voltage", "ratio": "drive_fraction"}.get(dimension)
        return BY_NAME[drive] if drive else None
    axis = name.strip().lower()[-1:]
    stem = {"force": "force_", "length": "position_", "acceleration": "accel_"}.get(dimension)
    if dimension == "speed" and axis == "x":
        return BY_NAME["velocity_x"]
    return BY_NAME.get(f"{stem}{axis}") if stem else None
