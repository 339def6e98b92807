"""Numbers as they are stored: counts of a converter, or the smallest exact floating point."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from frictus_hardware.arrays import FloatArray
from frictus_service.study.errors import FieldError


@dataclass(frozen=True, slots=True)
class ConverterStep:
    """How a converter counts: value = count * scale + offset.

    Attributes
    ----------
    scale : float or tuple of float
        Unit per count, of all columns or of each; not 0.
    offset : float or tuple of float
        Value of a count of 0; one for each column.
    """

    scale: float | tuple[float, ...]
    offset: float | tuple[float, ...] = 0.0

    def values(self, counts: NDArray[Any]) -> FloatArray:
        """Return what counts stand for; the very numbers that every reader gets."""
        values: FloatArray = counts * np.asarray(self.scale, dtype=np.float64)
        values += np.asarray(self.offset, dtype=np.float64)
        return values

    def counts(self, values: FloatArray) -> NDArray[np.float64]:
        """Return the nearest counts, as floats."""
        scale, offset = np.asarray(self.scale), np.asarray(self.offset)
        counts: FloatArray = np.rint((values - offset) / scale)
        return counts


@dataclass(frozen=True, slots=True)
class Encoded:
    """A data set as it stands in the file.

    Attributes
    ----------
    raw : ndarray
        Counts, or the values themselves.
    step : ConverterStep or None
        Of integers.
    """

    raw: NDArray[Any]
    step: ConverterStep | None

    @property
    def values(self) -> FloatArray:
        """What a reader gets."""
        return self.raw.astype(np.float64) if self.step is None else self.step.values(self.raw)


def encode(field: str, values: FloatArray, step: ConverterStep | None) -> Encoded:
    """Return how to store an array.

    Parameters
    ----------
    field : str
        Name of the data set.
    values : ndarray
        NaN where samples are missing; counts cannot say that, so these stay floating point.
    step : ConverterStep or None
        None: exact, as float32 where that is enough.

    Raises
    ------
    FieldError
        If the step does not suit the values.
    """
    values = np.asarray(values, dtype=np.float64)
    if step is None or not np.all(np.isfinite(values)):
        with np.errstate(over="ignore"):
            short = values.astype(np.float32)
        exact = np.array_equal(short.astype(np.float64), values, equal_nan=True)
        return Encoded(short if exact else values, None)
    counts = step.counts(values)
    for kind in (np.int16, np.int32):
        limits = np.iinfo(kind)
        if not np.all(np.isfinite(counts)):
            break
        if limits.min <= counts.min(initial=0.0) and counts.max(initial=0.0) <= limits.max:
            return Encoded(counts.astype(kind), step)
    raise FieldError(
        field,
        f"reaches more than 32 bits of counts at a step of {step.scale}; give the step of the "
        "converter",
    )
