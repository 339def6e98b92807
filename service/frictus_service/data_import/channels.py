"""The channels that a recording may have: what each measures, and how files name it."""

import re
from dataclasses import dataclass
from typing import Final

from frictus_service.data_import.units import Dimension


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
    Channel("time", "time", "of each sample", r"t|time|time_?stamps?|zeit", (0.0, 1e7)),
    Channel(
        "force_x",
        "force",
        "of the finger on the screen along the slide, positive with the velocity",
        r"f_?x|f_?t|force_?[xt]|f_?lat|f_?tan|tangential.*|lateral.*|friction.*|shear.*|force:1",
        (0.01, 20.0),
    ),
    Channel("force_y", "force", "across the slide", r"f_?y|force_?y|force:2", (1e-4, 20.0)),
    Channel(
        "force_z",
        "force",
        "into the screen",
        r"f_?z|f_?n|force_?[zn]|normal.*|load.*|press.*|force:3",
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
        r"skin_?(vel(ocity)?|v).*|ldv.*|vibrometer.*|laser.*",
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
