"""A ring of samples, addressed by device sample."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from frictus_hardware.arrays import FloatArray


class SampleRing:
    """The last samples of a signal that never ends.

    Parameters
    ----------
    capacity : int
        Samples kept; reserved at once and zero at first.
    """

    def __init__(self, capacity: int) -> None:
        self._values = np.zeros(capacity)

    @property
    def capacity(self) -> int:
        """Samples kept."""
        return self._values.size

    def write(self, first: int, n_samples: int, values: ArrayLike) -> None:
        """Set samples from `first` on, to one value or to `n_samples` of them."""
        self._values[self._places(first, n_samples)] = values

    def read(self, first: int, n_samples: int) -> FloatArray:
        """Return a copy of the samples from `first` on."""
        found: FloatArray = self._values[self._places(first, n_samples)]
        return found.copy()

    def _places(self, first: int, n_samples: int) -> slice | NDArray[np.int64]:
        at = first % self._values.size
        if at + n_samples <= self._values.size:  # in one piece, as nearly always
            return slice(at, at + n_samples)
        return np.arange(at, at + n_samples) % self._values.size
