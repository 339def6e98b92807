"""The names, shapes and number formats of `study/1`; nothing here reads or writes."""

from dataclasses import dataclass
from typing import Final

SCHEMA: Final = "study/1"
ROOT: Final = ("schema", "rig", "carrier_hz", "screen_peak_v", "mount")
MAX_VALUES: Final = 200_000_000
"""Of one data set: one trial at a time is held in memory, as float64."""


@dataclass(frozen=True, slots=True)
class DataSet:
    """One data set of a trial.

    Attributes
    ----------
    name : str
        Unique among its kind.
    columns : int
        1: a vector.
    along : {'sample', 'position'}
        What a row is; all data sets of a kind have as many rows.
    required : bool
        Whether a trial without it is refused.
    """

    name: str
    columns: int
    along: str
    required: bool


DATA_SETS: Final = (
    DataSet("voltage_v", 1, "sample", required=False),
    DataSet("force_n", 3, "sample", required=True),
    DataSet("accel_m_s2", 3, "sample", required=False),
    DataSet("skin_velocity_m_s", 1, "sample", required=False),
    DataSet("position_mm", 2, "position", required=True),
    DataSet("position_t_s", 1, "position", required=True),
)
NAMES: Final = tuple(data_set.name for data_set in DATA_SETS)


def is_shape_of(data_set: DataSet, shape: tuple[int, ...]) -> bool:
    """Return whether an array of this shape holds the data set.

    A vector may also be a matrix of one row or one column, as MATLAB writes it.
    """
    if data_set.columns > 1:
        return len(shape) == 2 and shape[1] == data_set.columns
    return len(shape) == 1 or (len(shape) == 2 and 1 in shape)


def shape_hint(data_set: DataSet, shape: tuple[int, ...]) -> str:
    """Return what to say of a shape that is not the data set's."""
    letter = "n" if data_set.along == "sample" else "k"
    asked = f"({letter}, {data_set.columns})" if data_set.columns > 1 else f"({letter},)"
    hint = f"has shape {shape}; accepted: {asked}, time along the first axis"
    if len(shape) == 2 and shape[0] == data_set.columns > 1:
        hint += "; write its transpose (MATLAB reverses the axes of what it stores)"
    return hint
