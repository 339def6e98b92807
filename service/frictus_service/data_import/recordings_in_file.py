"""The recordings that a file holds: one, or several of one layout.

Programs of laboratories write each trial as a group (`trials/trial_0001/fx`), as an element of
an array of structs (`trial(1).fx`), or below the one before, where the clock begins anew. Each
is a recording of its own: nothing is known of the time between them.
"""

import re
from collections import ChainMap, defaultdict
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Final

import numpy as np

from frictus_service.data_import.channels import named_channel, split_name
from frictus_service.data_import.column_map import ColumnMap
from frictus_service.data_import.formats.columns import Column, Columns
from frictus_service.data_import.recording import MappedRecording, apply_map
from frictus_service.data_import.recording_names import levels_of, place_of
from frictus_service.errors import Exclusion, FieldError

MOTION: Final = ("length", "speed", "time")
MAX_STARTS: Final = 4096
"""A clock that begins anew more often is no clock."""


def groups_of(columns: Columns) -> dict[str, Columns]:
    """Return the groups of a file that are recordings, by name; empty where there are not two.

    They are called alike but for numbers, and hold a force, and a motion or a time: two sensors
    of one recording may be called alike, too. Columns are called without the group.

    Parameters
    ----------
    columns : Columns
        Of the file.
    """
    members: defaultdict[str, list[Column]] = defaultdict(list)
    for column in columns.columns:
        group, _, name = column.name.rpartition(".")
        members[group].append(replace(column, name=name))
    alike: defaultdict[str, list[str]] = defaultdict(list)
    for group, held in members.items():
        if re.search(r"\d", group) and _is_recording(held):
            alike[re.sub(r"\d+", "#", group)].append(group)
    groups = max(alike.values(), key=len, default=[])
    if len(groups) < 2:
        return {}
    of_all = {
        name: value
        for name, value in columns.numbers.items()
        if name.rpartition(".")[0] not in members
    }
    found = {}
    told = [
        f"{len(groups)} recordings, {groups[0]} to {groups[-1]}: columns are called without "
        "the group"
    ]
    others = [group for own in alike.values() if own is not groups for group in own]
    if others:
        told.append(
            f"{len(others)} more are called otherwise and left out, as {others[0]}: call all "
            "alike but for numbers, or save them as files of their own"
        )
    texts: defaultdict[str, dict[str, str]] = defaultdict(dict)
    for name, text in columns.texts.items():
        holder, _, last = name.rpartition(".")
        texts[holder][last] = text
    numbers: dict[str, dict[str, float]] = {group: {} for group in groups}
    for name, value in columns.numbers.items():
        for holder in _holders(name.rpartition(".")[0]):
            if holder in numbers:
                numbers[holder][name.removeprefix(f"{holder}.")] = value
    for group in groups:
        found[group] = replace(
            columns,
            columns=tuple(members[group]),
            numbers=of_all | numbers[group],
            notes=(*columns.notes, *told),
            texts=dict(ChainMap(*(texts[holder] for holder in _holders(group)))),
        )
    return found


def _holders(group: str) -> Iterator[str]:
    """Yield a group and all that hold it, the file last: what they say is said of it."""
    while group:
        yield group
        group = group.rpartition(".")[0]
    yield ""


def _is_recording(held: list[Column]) -> bool:
    named = (named_channel(split_name(column.name)[0]) for column in held)
    dimensions = {channel.dimension for channel in named if channel is not None}
    return "force" in dimensions and not dimensions.isdisjoint(MOTION)


def mapped_recordings(
    columns: Columns, column_map: ColumnMap, file: Path | None = None
) -> tuple[list[MappedRecording], list[Exclusion]]:
    """Return the recordings of a file under its map, and those of several that it does not fit.

    Parameters
    ----------
    columns : Columns
        Of the file.
    column_map : ColumnMap
        That calls the columns of groups without the group; one that calls each by its whole
        name makes one recording of the file.
    file : Path or None
        Whose folders and name may say whose recording it is; None: names are not read.

    Raises
    ------
    FieldError
        If the map fits none; the text names the channel and what to do.
    """
    found: list[MappedRecording] = []
    refused: list[FieldError] = []
    excluded: list[Exclusion] = []
    levels = "" if file is None else levels_of(file)
    for group, name, part in _recordings(columns, column_map):
        try:
            own = column_map
            if levels:
                own = own.of_recording(place_of(levels, group), part.fields)
            found.append(apply_map(part, own))
        except FieldError as error:
            refused.append(error)
            excluded.append(Exclusion(name, error.field, error.reason))
    if not found:
        raise refused[0]
    return found, excluded


def _recordings(columns: Columns, column_map: ColumnMap) -> Iterator[tuple[str, str, Columns]]:
    """Yield group, name and columns of each recording, in the order of the file."""
    names = {mapped.column for mapped in column_map.channels.values()}
    parts = {"": columns}
    if not names <= {column.name for column in columns.columns}:
        parts = groups_of(columns) or parts
    for group, part in parts.items():
        pieces = _at_each_start(part, column_map, names)
        for number, piece in enumerate(pieces, 1):
            one_of = f"{group} recording {number}".strip() if len(pieces) > 1 else group
            yield group, one_of, piece


def _at_each_start(part: Columns, column_map: ColumnMap, names: set[str]) -> list[Columns]:
    """Return a part cut where its clock falls back to its first time."""
    clock = column_map.channels.get("time")
    mapped = {column.name: column.values for column in part.columns if column.name in names}
    if clock is None or clock.column not in mapped:
        return [part]
    times = mapped[clock.column]
    if times.size < 2 or any(values.size != times.size for values in mapped.values()):
        return [part]
    with np.errstate(invalid="ignore"):  # of infinite times, which are refused later
        steps = np.diff(times)
        step = np.median(np.abs(steps[np.isfinite(steps)])) if np.isfinite(steps).any() else 0.0
        anew = (steps < 0.0) & (np.abs(times[1:] - times[0]) <= step)
    starts = [0, *(np.flatnonzero(anew) + 1).tolist(), times.size]
    if not 2 < len(starts) <= MAX_STARTS:
        return [part]
    cut = [column for column in part.columns if column.values.size == times.size]
    return [
        replace(
            part,
            columns=tuple(replace(each, values=each.values[first:last]) for each in cut),
        )
        for first, last in pairwise(starts)
    ]
