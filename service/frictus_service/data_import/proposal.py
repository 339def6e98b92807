"""A column map proposed from a file: by names, units and magnitudes, axes and signs by motion.

What cannot be told from the file is a question, not a guess.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_service.data_import.channels import (
    BY_NAME,
    STANDARD_GRAVITY_M_S2,
    UNITS,
    Channel,
    channel_of,
    find_unit,
    named_channel,
    split_name,
    units_of,
    unknown_unit,
)
from frictus_service.data_import.column_map import ColumnMap, MappedColumn
from frictus_service.data_import.formats.columns import Column, Columns, named_rate_hz
from frictus_service.data_import.motion import signed
from frictus_service.data_import.recording_names import propose_people, speed_in
from frictus_service.data_import.recordings_in_file import groups_of
from frictus_service.study.plausible import OVER_PEAK

RATES_HZ: Final = (10.0, 2e6)
SECONDS: Final = (0.5, 1e5)
GRAVITY_TOLERANCE: Final = 0.05
USUAL: Final = tuple("N mN gf mm m um mm/s m/s m/s2 g V mV s ms us 1 %".split())
"""Units among which the size of a column decides; others have to be named."""
PEAK_V: Final = float(ColumnMap.model_fields["screen_peak_v"].default)
BEFORE_AMPLIFIER_V: Final = 12.0
"""Converters reach ±10 V: so small a drive is not the screen's."""


@dataclass(frozen=True, slots=True)
class Question:
    """What a person has to say.

    Attributes
    ----------
    entry : str
        The entry of the map, or how the names of several begin; answered once one is set, or
        the channel is left away.
    sentence : str
        What is open, and what is accepted.
    """

    entry: str
    sentence: str


@dataclass(frozen=True, slots=True)
class Proposal:
    """A map as far as the file shows it.

    Attributes
    ----------
    column_map : ColumnMap
        Provisional where a question is open.
    reasons : tuple of str
        Why, where it is not the file's own words.
    questions : tuple of Question
        What is open.
    signs_settled : bool
        Whether axes and signs are those that the motion shows, or a person's.
    """

    column_map: ColumnMap
    reasons: tuple[str, ...]
    questions: tuple[Question, ...]
    signs_settled: bool = False

    def answered(self, column_map: ColumnMap, entries: Iterable[str]) -> "Proposal":
        """Return the proposal with a changed map, without the questions that are answered.

        Parameters
        ----------
        column_map : ColumnMap
            With entries set.
        entries : iterable of str
            Names of these entries.
        """
        names = [entry.partition("=")[0].removeprefix("channels.") for entry in entries]
        left = tuple(
            question
            for question in self.questions
            if not any(
                name.startswith(_answers(question.entry))
                or name == question.entry.partition(".")[0]  # left away
                for name in names
            )
        )
        if not names:
            return self
        by_person = any(name.endswith(".sign") for name in names)
        return replace(self, column_map=column_map, questions=left, signs_settled=by_person)


def _answers(entry: str) -> tuple[str, ...]:
    """Return how entries begin that answer a question, where it may be several."""
    return {
        "force_z": ("force_z", "normal_load_n"),
        "rate_hz": ("rate_hz", "time."),
        "stage_speed_mm_s": ("stage_speed_mm_s", "position_x", "velocity_x"),
    }.get(entry, (entry,))


def propose(columns: Columns, place: str = "") -> Proposal:
    """Return a map of a file, and what is open.

    Parameters
    ----------
    columns : Columns
        Of the file.
    place : str
        Folder and name of the file, without its ending: people and a speed may stand in it.
    """
    groups = groups_of(columns)
    if groups:
        columns = max(groups.values(), key=lambda recording: len(recording.columns))
    draft = _Draft(columns)
    draft.reasons += columns.notes
    # Across the slide is little to tell a unit by: the other axes come first.
    for column in sorted(
        columns.columns, key=lambda each: split_name(each.name)[0][-1:] == "y"
    ):
        draft.consider(column)
    draft.settle_axes()
    draft.check_complete(place.rpartition("/")[2])
    if (people := propose_people(groups or {"": columns}, place)) is not None:
        draft.known[people.entry] = people.value
        draft.reasons.append(people.reason)
    column_map = ColumnMap(channels=draft.channels, **draft.known)
    return Proposal(column_map, tuple(draft.reasons), tuple(draft.questions))


def with_signs(columns: Columns, proposal: Proposal) -> Proposal:
    """Return the proposal with axes and signs as the motion shows them, once it can be seen.

    Parameters
    ----------
    columns : Columns
        Of the file.
    proposal : Proposal
        As answered so far.
    """
    if proposal.signs_settled:
        return proposal
    if any(
        not question.entry.startswith(("drive_", "screen_peak_v"))
        for question in proposal.questions
    ):
        return proposal
    found = signed(columns, proposal.column_map)
    questions = tuple(Question(*each) for each in found.questions)
    return Proposal(
        found.column_map,
        (*proposal.reasons, *found.reasons),
        (*proposal.questions, *questions),
        signs_settled=True,
    )


class _Draft:
    """Gathers channels, reasons and questions."""

    def __init__(self, columns: Columns) -> None:
        self._columns = columns
        self._names = {column.name for column in columns.columns}
        self.channels: dict[str, MappedColumn] = {}
        self.known: dict[str, Any] = {}
        self.reasons: list[str] = []
        self.questions: list[Question] = []

    def consider(self, column: Column) -> None:
        """Map a column where its name says what it is."""
        name, unit = split_name(column.name)
        unit = find_unit(column.unit) or unit
        named = named_channel(name)
        if unit == "g" and named is not None and named.dimension == "force":
            unit = "gf"  # of a load cell
        matrix, colon, _ = column.name.rpartition(":")
        if colon and f"{matrix}:7" in self._names:
            return  # of a matrix of trials: a sensor of force and torque has six axes
        channel = channel_of(name, unit)
        if channel is None or not np.isfinite(column.values).any():
            return
        low, high = np.nanmin(column.values), np.nanmax(column.values)
        if channel.name == "position_x" and low == high:
            self.reasons.append(f"{column.name!r} never changes: it is no position")
            return
        if channel.name == "drive_voltage" and low >= 0.0 < high:
            channel = BY_NAME["drive_envelope"]
            self.reasons.append(
                f"{column.name!r} is never negative, so it has no carrier: it is taken as the "
                "carrier's amplitude (rms values: set drive_envelope.scale=1.4142)"
            )
        if channel.name in self.channels:
            other = self.channels[channel.name].column
            self.questions.append(
                Question(
                    f"{channel.name}.column",
                    f"{other!r} and {column.name!r} are both called like {channel.name}: set "
                    f"{channel.name}.column",
                )
            )
            return
        counts = unit == "counts" and channel.dimension == "force"
        if not unit or not (counts or UNITS[unit].dimension == channel.dimension):
            unit = self._guessed(channel, column)
        self.channels[channel.name] = MappedColumn(column=column.name, unit=unit)
        if counts:
            self._ask_scale(channel.name, column)
        if channel.name in ("drive_voltage", "drive_envelope"):
            self._check_drive(channel.name, column, unit)

    def _guessed(self, channel: Channel, column: Column) -> str:
        """Return a unit by magnitude; a question where several or none fit."""
        candidates = units_of(channel.dimension)
        if unknown := unknown_unit(column.name, column.unit):
            self.questions.append(
                Question(
                    channel.name,
                    f"{column.name!r} as {channel.name} is in {unknown[:40]!r}, which is no "
                    f"known unit: set {channel.name}.unit to one of {', '.join(candidates)}, "
                    f"and {channel.name}.scale to how many one is, or {channel.name}= to "
                    "leave it away",
                )
            )
            return candidates[0]
        for name, mapped in self.channels.items():
            same_sensor = name[:-1] == channel.name[:-1] and not self._is_open(name)
            if (
                same_sensor
                and channel.dimension != "acceleration"
                and _fits(channel, column, UNITS[mapped.unit].factor)
            ):
                self.reasons.append(f"{column.name!r} has the unit of {mapped.column!r}")
                return mapped.unit
        usual = [unit for unit in candidates if unit in USUAL]
        fitting = [unit for unit in usual if _fits(channel, column, UNITS[unit].factor)]
        if channel.dimension == "acceleration":  # a vibration has no usual size
            fitting = _by_gravity(column) or ["m/s2", "g"]
        if len(fitting) == 1:
            self.reasons.append(
                f"{column.name!r} names no unit; by its size it is in {fitting[0]}"
            )
            return fitting[0]
        could = f"could be {' or '.join(fitting)}" if fitting else "fits none of the usual ones"
        self.questions.append(
            Question(
                f"{channel.name}.unit",
                f"the unit of {column.name!r} as {channel.name} is open, by its size it "
                f"{could}: set {channel.name}.unit to one of {', '.join(candidates)}",
            )
        )
        return fitting[0] if fitting else candidates[0]

    def _is_open(self, name: str) -> bool:
        """Return whether the unit of a channel is a question, as that of counts is."""
        return not self._asked.isdisjoint((name, f"{name}.", f"{name}.unit"))

    @property
    def _asked(self) -> set[str]:
        return {question.entry for question in self.questions}

    def settle_axes(self) -> None:
        """Give the axes of a sensor the unit that one of them shows, whatever their order."""
        by_name = {column.name: column for column in self._columns.columns}
        for sensor in ("accel_", "force_"):
            axes = [name for name in self.channels if name.startswith(sensor)]
            known = [name for name in axes if not self._is_open(name)]
            for name in axes if known else ():
                first, mapped = self.channels[known[0]], self.channels[name]
                column, factor = by_name[mapped.column], UNITS[first.unit].factor
                # A vibration has no usual size.
                fits = sensor == "accel_" or _fits(BY_NAME[name], column, factor)
                if f"{name}.unit" not in self._asked or not fits:
                    continue
                self.channels[name] = mapped.model_copy(update={"unit": first.unit})
                self.reasons.append(f"{name} has the unit of {known[0]}: one sensor")
                self.questions = [
                    question for question in self.questions if question.entry != f"{name}.unit"
                ]

    def _ask_scale(self, name: str, column: Column) -> None:
        self.questions.append(
            Question(
                f"{name}.",
                f"{column.name!r} is in counts or fractions of full scale: set {name}.scale to "
                f"the newtons of one and {name}.unit to N (counts make no study, but show "
                "friction)",
            )
        )

    def _check_drive(self, name: str, column: Column, unit: str) -> None:
        peak = float(np.nanmax(np.abs(column.values))) * UNITS[unit].factor
        if 0.0 < peak <= BEFORE_AMPLIFIER_V:
            self.questions.append(
                Question(
                    f"{name}.scale",
                    f"the drive voltage {column.name!r} reaches {peak:.3g} V: before an "
                    f"amplifier, set {name}.scale to its gain; at the screen, to 1",
                )
            )
        elif peak > OVER_PEAK * PEAK_V:
            self.questions.append(
                Question(
                    "screen_peak_v",
                    f"the drive voltage {column.name!r} reaches {peak:.3g} V: set "
                    "screen_peak_v to the screen volts at full drive",
                )
            )

    def check_complete(self, file_stem: str) -> None:
        """Ask for what a recording cannot do without."""
        for name in ("force_x", "force_z"):
            if name in self.channels:
                continue
            listed = ", ".join(repr(column.name) for column in self._columns.columns[:20])
            other = (
                ", or normal_load_n to a dead weight in N"
                if name == "force_z"
                else " (hammer blows are for frictus mount)"
            )
            self.questions.append(
                Question(
                    name,
                    f"no column is called like {name} ({BY_NAME[name].meaning}): set "
                    f"{name}.column and {name}.unit{other}; columns: {listed}",
                )
            )
        self._check_rate()
        moved = {"position_x", "velocity_x"} & set(self.channels)
        if not moved:
            speed = speed_in(file_stem)
            if speed is not None:
                self.known["stage_speed_mm_s"] = speed
                self.reasons.append(f"the stage moves at {speed:g} mm/s, by the file's name")
                return
            self.questions.append(
                Question(
                    "stage_speed_mm_s",
                    "no column is called like a position or a velocity: set position_x.column "
                    "or velocity_x.column, or stage_speed_mm_s to the speed of the stage",
                )
            )

    def _check_rate(self) -> None:
        from_file = named_rate_hz(self._columns.numbers)
        each = [column.rate_hz for column in self._columns.columns]
        if "time" in self.channels or from_file or all(each):
            return
        self.questions.append(
            Question(
                "rate_hz",
                "no sample rate is given, or several: set rate_hz or time.column and time.unit",
            )
        )


def _fits(channel: Channel, column: Column, factor: float) -> bool:
    """Return whether a column in a unit has the size of a channel."""
    values = column.values[np.isfinite(column.values)]
    if channel.dimension == "time":
        step = float(np.median(np.diff(values))) * factor if values.size > 1 else 0.0
        span = float(values[-1] - values[0]) * factor
        return (
            step > 0.0
            and RATES_HZ[0] <= 1.0 / step <= RATES_HZ[1]
            and SECONDS[0] <= span <= SECONDS[1]
        )
    low, high = channel.magnitude
    return low <= _size(channel, values) * factor <= high


def _size(channel: Channel, values: FloatArray) -> float:
    if channel.dimension == "length":
        return float(np.ptp(np.quantile(values, (0.01, 0.99))))
    return float(np.quantile(np.abs(values), 0.95))


def _by_gravity(column: Column) -> list[str]:
    """Return the unit in which the mean is that of gravity; empty where it is not."""
    mean = abs(float(np.nanmean(column.values)))
    return [
        unit
        for unit in ("m/s2", "g")
        if abs(mean * UNITS[unit].factor / STANDARD_GRAVITY_M_S2 - 1.0) < GRAVITY_TOLERANCE
    ]
