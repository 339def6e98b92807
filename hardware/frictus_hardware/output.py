"""The output queue of a device: what plays at each sample of its clock, or has played."""

from dataclasses import dataclass
from typing import Final

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


RETURN_S: Final = 0.02
"""After a gap the output comes back over a ramp of this length: a step would be felt."""


@dataclass(frozen=True, slots=True)
class DeviceOutput:
    """What the device has output lately.

    Attributes
    ----------
    first_sample : int
        Device index of the first sample; what was played before the last opening is negative.
    voltage_v : ndarray, shape (n_samples,)
        Ends with the sample that played just now.
    holding : bool
        Whether a last value other than zero is held because nothing follows it.
    armed : bool
        Whether output other than zero is allowed.
    """

    first_sample: int
    voltage_v: FloatArray
    holding: bool
    armed: bool


class OutputQueue:
    """A ring of output samples, addressed by device sample.

    What nobody handed over plays zero or, on a device that holds, the last value; what follows
    fades in from there. Every call takes `now`, the sample that is about to play.

    Parameters
    ----------
    capacity : int
        Samples kept, played and queued together; reserved at once.
    holds : bool
        Whether the device holds its last value when the queue runs dry.
    return_samples : int
        Length of the ramp over which the output comes back after a gap.
    past : ndarray, shape (n_samples,), optional
        What played before sample 0; `read` finds it at negative samples.
    """

    def __init__(
        self,
        capacity: int,
        holds: bool,
        return_samples: int,
        past: FloatArray | None = None,
    ) -> None:
        self._ring = SampleRing(capacity)
        self._holds = holds
        self._return_samples = return_samples
        self._returned = return_samples
        self._return_from_v = 0.0
        self._idle_v = 0.0
        self._end = 0
        self._handed_over_to: int | None = None
        if past is not None:
            self._ring.write(-past.size, past.size, past)

    @property
    def end(self) -> int:
        """First sample that nobody has handed over."""
        return self._end

    @property
    def idle_v(self) -> float:
        """What plays from `end` on."""
        return self._idle_v

    def write(self, first: int, values_v: FloatArray, now: int) -> tuple[int, FloatArray]:
        """Queue a block, faded in where it follows a gap.

        Parameters
        ----------
        first : int
            When it shall play, at or after `end`.
        values_v : ndarray, shape (n_samples,)
        now : int

        Returns
        -------
        late : int
            How many of its samples are too late to play.
        plays_v : ndarray, shape (n_samples,)
            What plays instead of the block.
        """
        late = min(max(now - first, 0), values_v.size)
        self.settle(first + late)
        if late or self._handed_over_to not in (None, first):
            self._returned, self._return_from_v = 0, self._idle_v
        self._handed_over_to = first + values_v.size
        plays_v = np.empty(values_v.size)
        plays_v[:late] = self._idle_v
        if late < values_v.size:
            plays_v[late:] = self._faded_in(values_v[late:])
            self._ring.write(first + late, values_v.size - late, plays_v[late:])
            self._end = first + values_v.size
            if self._holds:
                self._idle_v = float(plays_v[-1])
        return late, plays_v

    def _faded_in(self, values_v: FloatArray) -> FloatArray:
        if self._returned >= self._return_samples:
            return values_v
        since = self._returned + np.arange(1, values_v.size + 1)
        self._returned += values_v.size
        share = np.minimum(since / self._return_samples, 1.0)
        return self._return_from_v + share * (values_v - self._return_from_v)

    def read(self, first: int, n_samples: int) -> FloatArray:
        """Return what plays, or played, at given samples."""
        known = min(max(self._end - first, 0), n_samples)
        if known == n_samples:
            return self._ring.read(first, n_samples)
        out = np.full(n_samples, self._idle_v)
        out[:known] = self._ring.read(first, known)
        return out

    def settle(self, to: int) -> None:
        """Write the idle value down up to a sample: it has played, and can no longer change."""
        missing = min(to - self._end, self._ring.capacity)
        if missing > 0:
            self._ring.write(to - missing, missing, self._idle_v)
        self._end = max(self._end, to)

    def ramp(self, now: int, n_samples: int) -> None:
        """Take what is still queued to zero within so many samples, and the idle value too."""
        self.settle(now)
        queued = self._end - now
        length = min(n_samples, queued)
        gain = np.zeros(queued)
        gain[:length] = 1.0 - np.arange(1, length + 1) / max(length, 1)
        self._ring.write(now, queued, gain * self._ring.read(now, queued))
        self._idle_v = self._return_from_v = 0.0


@dataclass(frozen=True, slots=True)
class HandedOver:
    """A drive that was accepted, before what it goes with has been sensed."""

    first_sample: int
    applied_v: FloatArray
    play_sample: int
    clipped_samples: int
    margin_samples: int
    underrun_samples: int
    overrun_samples: int

    @property
    def end_sample(self) -> int:
        """The exchange is over once so many samples are."""
        return self.first_sample + self.applied_v.size
