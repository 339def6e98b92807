"""The column map: which column of a file is which channel, in which unit and direction.

Saved beside the file as `FILE.map.toml`, and read from there. Strict: a person answered it.
"""

import errno
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Final, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from frictus.errors import complaint
from frictus.files import read_toml, require_file
from frictus.lenient import NO_TRUTH
from frictus_service.data_import.channels import BY_NAME, DRIVES, UNITS, find_unit, units_of
from frictus_service.data_import.recording_names import check_template, said_by
from frictus_service.durable import replace_file
from frictus_service.errors import FieldError, StudyError

MAX_BYTES: Final = 1 << 20
SUFFIX: Final = ".map.toml"
SCHEMA: Final = "column_map/1"

_TEXTS: Final = (
    "column",
    "unit",
    "participant",
    "rig",
    "started_utc",
    "names",
    "participant_field",
)
"""Entries that are texts, though they may look like numbers: the unit 1, the participant 07."""

Positive = Annotated[float, Field(gt=1e-6, lt=1e9, allow_inf_nan=False)]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class MappedColumn(_Strict):
    """One channel: value = sign · scale · number · unit.

    Attributes
    ----------
    column : str
        Its name in the file.
    unit : str
        Of a number, once it is scaled; of the channel's dimension, or `counts`.
    sign : {1, -1}
        -1 where the file has it the other way round.
    scale : float
        Unit per number: sensitivity of a sensor, gain of an amplifier.
    rate_hz : float or None
        None: as the file or the map says for all.
    """

    column: str = Field(max_length=500)
    unit: str
    sign: Annotated[Literal[1, -1], NO_TRUTH] = 1
    scale: Annotated[float, Field(gt=1e-12, lt=1e12, allow_inf_nan=False)] = 1.0
    rate_hz: Positive | None = None


class ColumnMap(_Strict):
    """How a file, or every file of one layout, is read.

    Attributes
    ----------
    map_schema : str
        `column_map/1`; `schema` in the file.
    channels : dict of str to MappedColumn
        By the name of the channel.
    rate_hz : float or None
        Of all channels that say no other; None: from the column of time, or as the file says.
    speed_mm_s, force_n : float or None
        Targets; None: taken from what was measured.
    stage_speed_mm_s : float or None
        Speed of the stage, where neither position nor velocity was recorded.
    normal_load_n : float or None
        A dead weight, where the normal force was not recorded.
    positions_late_s : float
        By which positions, or the velocity, come late beside the force; taken off their times.
    tones_hz : tuple of float or None
        Of the drive; empty: broadband; None: found in each stroke.
    participant_field : str
        Field or attribute of each recording that says its participant; empty: none.
    names : str
        Template by which the name of each recording says entries of its own; empty: none.
    participant, session, started_utc, rig
        As in a study.
    carrier_hz, screen_peak_v : float
        As in a study.
    """

    map_schema: Literal["column_map/1"] = Field(default=SCHEMA, alias="schema")
    channels: dict[str, MappedColumn]
    rate_hz: Positive | None = None
    speed_mm_s: Positive | None = None
    force_n: Positive | None = None
    stage_speed_mm_s: Positive | None = None
    normal_load_n: Positive | None = None
    positions_late_s: Annotated[float, Field(gt=-1.0, lt=1.0, allow_inf_nan=False)] = 0.0
    tones_hz: Annotated[tuple[Positive, ...], Field(max_length=64, strict=False)] | None = None
    participant_field: str = Field(default="", max_length=100)
    names: str = Field(default="", max_length=200)
    participant: str = Field(default="p01", min_length=1, max_length=100)
    session: int = Field(default=1, ge=0, lt=10_000)
    started_utc: str = Field(default="", max_length=64)
    rig: str = Field(default="unknown", min_length=1, max_length=100)
    carrier_hz: Positive = 7000.0
    screen_peak_v: Positive = 75.0

    def of_recording(self, place: str, fields: Mapping[str, str]) -> "ColumnMap":
        """Return the map of one recording, with what it says of itself.

        Parameters
        ----------
        place : str
            Its name, from folder to group, levels apart by ``/``.
        fields : mapping of str to str
            Its fields and attributes.

        Raises
        ------
        FieldError
            If it lacks the field, the name has another form, or either says what cannot be.
        """
        said: dict[str, str | int | float] = {}
        if self.participant_field:
            if self.participant_field not in fields:
                listed = ", ".join(sorted(fields)[:20]) or "none"
                raise FieldError(
                    "participant_field",
                    f"is {self.participant_field!r}; accepted: a field of the recording, which "
                    f"has {listed}",
                )
            said["participant"] = fields[self.participant_field]
        if self.names:
            said |= said_by(self.names, place)
        if not said:
            return self
        try:
            return ColumnMap.model_validate(self.model_dump(by_alias=True) | said)
        except ValidationError as error:
            entry = "names" if self.names else "participant_field"
            raise FieldError(entry, f"of {place!r}: {_first(error)}") from error

    @property
    def direction_from_force(self) -> bool:
        """Whether the sign of the tangential force alone gives the direction of the slide."""
        known = {"force_x", "position_x", "velocity_x"} & self.channels.keys()
        return self.stage_speed_mm_s is not None and known == {"force_x"}

    @model_validator(mode="after")
    def _fits(self) -> "ColumnMap":
        for entry, text in (("participant", self.participant), ("rig", self.rig)):
            if not text.isprintable():
                raise ValueError(f"{entry} has control or formatting characters: {text!a}")
        if self.names:
            check_template(self.names)
        for name, mapped in self.channels.items():
            _check_channel(name, mapped)
        skin = "skin_velocity" in self.channels
        if skin and any(name.startswith("accel_") for name in self.channels):
            raise ValueError(
                "channels: skin_velocity stands beside an acceleration; keep one of them"
            )
        drives = [name for name in DRIVES if name in self.channels]
        if len(drives) > 1:
            raise ValueError(
                f"channels: {' and '.join(drives)} are one drive; keep one of them"
            )
        return self


def _check_channel(name: str, mapped: MappedColumn) -> None:
    if name not in BY_NAME:
        raise ValueError(
            f"channels: there is no channel {name}; accepted: {', '.join(BY_NAME)}"
        )
    unit, dimension = find_unit(mapped.unit), BY_NAME[name].dimension
    counts = dimension == "force" and unit == "counts"
    if not counts and (unit is None or UNITS[unit].dimension != dimension):
        raise ValueError(
            f"channels.{name}: its unit is {mapped.unit!r}; accepted: "
            f"{', '.join(units_of(dimension))}; give scale where a number is no such unit"
        )


def map_beside(path: Path) -> Path:
    """Return where the map of a file lies: beside it.

    Parameters
    ----------
    path : Path
        Of the recording.
    """
    return path.with_name(path.name + SUFFIX)


def has_map(path: Path) -> bool:
    """Return whether the map of a file lies beside it.

    Parameters
    ----------
    path : Path
        Of the recording.
    """
    try:
        return map_beside(path).is_file()
    except OSError as error:
        if error.errno == errno.ENAMETOOLONG:  # with the ending of a map: there is none
            return False
        raise


def load_map(path: Path) -> ColumnMap:
    """Return a map from TOML, or JSON where the file is called so.

    Parameters
    ----------
    path : Path

    Raises
    ------
    FileNotFoundError
    StudyError
        If it is no column map; the text names the entry.
    UnreadableFileError
        If it is a pipe or a device.
    """
    require_file(path)
    if path.stat().st_size > MAX_BYTES:
        raise StudyError(f"{path} is larger than a column map can be")
    content = path.read_bytes()
    try:
        text = content.decode("utf-8-sig")
        parsed = json.loads(text) if path.suffix == ".json" else read_toml(text)
    except (ValueError, RecursionError) as error:
        raise StudyError(f"{path} is no TOML ({error}); JSON is called .json") from error
    return parse_map(parsed, str(path))


def parse_map(parsed: object, where: str) -> ColumnMap:
    """Return a map from plain values.

    Parameters
    ----------
    parsed : object
        Of JSON or TOML.
    where : str
        It comes from, for the error.

    Raises
    ------
    StudyError
        If it is no column map; the text names the entry.
    """
    try:
        return ColumnMap.model_validate(parsed)
    except ValidationError as error:
        raise StudyError(f"{where}: {_first(error)}") from error


def _first(error: ValidationError) -> str:
    """Return the first entry that is wrong, and why."""
    first = error.errors()[0]
    place = ".".join(str(part) for part in first["loc"])
    return f"{place}: {complaint(first)}" if place else complaint(first)


def save_map(column_map: ColumnMap, path: Path) -> None:
    """Write a map as TOML.

    Parameters
    ----------
    column_map : ColumnMap
        As it was confirmed.
    path : Path
        Of the map.
    """
    replace_file(path, map_text(column_map).encode())


def map_text(column_map: ColumnMap) -> str:
    """Return a map as TOML; each channel with what it means.

    Parameters
    ----------
    column_map : ColumnMap
        As it is saved.
    """
    plain = column_map.model_dump(mode="json", by_alias=True, exclude_none=True)
    channels = plain.pop("channels")
    lines = _entries(plain)
    for name, values in channels.items():
        lines += ["", f"[channels.{name}]  # {BY_NAME[name].meaning}"]
        lines += [
            f"{key} = {json.dumps(value, ensure_ascii=False)}" for key, value in values.items()
        ]
    return "\n".join(lines) + "\n"


def _entries(values: dict[str, object]) -> list[str]:
    # Values of these kinds read the same in TOML as in JSON.
    return [f"{key} = {json.dumps(value, ensure_ascii=False)}" for key, value in values.items()]


def changed(column_map: ColumnMap, assignments: list[str]) -> ColumnMap:
    """Return a map with entries set, each as `speed_mm_s=80` or `force_x.unit=mN`.

    A channel set to nothing, as `time=`, is left away. A participant is that of all recordings:
    what they say themselves does not count then.

    Parameters
    ----------
    column_map : ColumnMap
        To begin with.
    assignments : list of str

    Raises
    ------
    StudyError
        If an entry does not exist, or cannot have the value.
    """
    plain = column_map.model_dump(by_alias=True, exclude_none=True)
    for assignment in assignments:
        place, equals, value = assignment.partition("=")
        if not equals:
            raise FieldError("--set", f"is {assignment!r}; accepted: force_x.unit=mN")
        *channel, key = place.removeprefix("channels.").split(".")
        if len(channel) > 1:
            raise FieldError("--set", f"is {assignment!r}; accepted: force_x.unit=mN")
        if not channel and not value and plain["channels"].pop(key, None):
            continue
        held = plain["channels"].setdefault(channel[0], {"unit": ""}) if channel else plain
        if place == "participant":
            plain["participant_field"] = ""
            plain["names"] = "" if "{participant}" in plain["names"] else plain["names"]
        held[key] = value if key in _TEXTS and not value.startswith('"') else _plain(value)
    return parse_map(plain, "--set")


def _plain(text: str) -> object:
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        return text
