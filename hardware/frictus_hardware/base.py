"""What every rig backend promises. `tests/hardware/test_contract.py` holds each to it.

One rig: screen volts out; finger force, skin acceleration, monitor volts and touch reports in,
all on one sample clock. A backend moves blocks and keeps the output within its limit; it knows
nothing of textures.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Protocol, Self, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from frictus_hardware.arguments import StrictModel
from frictus_hardware.arrays import FloatArray


class Opened(ABC):
    """Opened at the beginning of a with statement, and closed at its end, whatever happened."""

    @abstractmethod
    def open(self) -> None:
        """Open."""

    @abstractmethod
    def close(self) -> None:
        """Close. Closing twice is harmless."""

    def __enter__(self) -> Self:
        """Open and return self."""
        self.open()
        return self

    def __exit__(self, *_: object) -> None:
        """Close."""
        self.close()


@dataclass(frozen=True, slots=True)
class RigInfo:
    """What does not change while a backend is open, but for a lead that grows."""

    backend: str
    simulated: bool
    finger_source: str
    """`touch`, `pointer` (a declared substitute) or `simulated`."""
    sample_rate_hz: float
    lead_samples: int
    """A drive handed over now is played this many samples after the last sensed sample."""
    screen_peak_v: float
    """Largest magnitude of screen volts; larger drives are clamped and counted."""
    screen_mm: tuple[float, float]
    touch_latency_s: float
    """Declared age of a touch report when it arrives."""
    aux: tuple[tuple[str, str], ...] = ()
    """Name and unit of each further channel."""
    converter_steps: Mapping[str, float] = field(default_factory=dict)
    """Value of one count of the converter behind `force` (N), `accel` (m/s²) or `voltage` (V);
    absent: not known, or not a whole multiple of one."""
    max_lead_samples: int = 0
    """The longest lead that `GrowingLead.lengthen_lead` takes; not above `lead_samples`: the
    lead is fixed."""
    finger_takeover: bool = False
    """Whether the simulated finger moves by itself until a client takes it over by points."""
    clock_scale: float = 1.0
    """Device seconds per second of this machine's clock; 1 but on a simulated or replayed rig
    that is told to run slower or faster."""

    @property
    def clock_hz(self) -> float:
        """Nominal samples per second of this machine's clock."""
        return self.sample_rate_hz * self.clock_scale

    @property
    def longest_lead_samples(self) -> int:
        """The longest that the lead is, or may become."""
        return max(self.lead_samples, self.max_lead_samples)


@dataclass(frozen=True, slots=True)
class TouchReport:
    """One report of the touch sensor.

    Attributes
    ----------
    measured_sample : float
        Device sample index at which the finger was there: by the sensor's own clock where it
        has one, else arrival less the declared latency. What that scatters by, up to about
        3 ms, costs nothing where the sensor reports evenly (`docs/hardware.md`).
    x_mm, y_mm : float
        Position on the screen.
    in_contact : bool
        Whether the finger touches.
    """

    measured_sample: float
    x_mm: float
    y_mm: float
    in_contact: bool


@dataclass(frozen=True, slots=True)
class Truth:
    """What only a simulated rig knows; for measuring, never for rendering.

    Arrays have shape (n_samples,) unless said otherwise.
    """

    position_mm: FloatArray
    """Shape (n_samples, 2)."""
    velocity_mm_s: FloatArray
    """Shape (n_samples, 2)."""
    friction_n: FloatArray
    """Electrostatic part of the friction at the screen, N, at n / fs."""
    normal_force_n: FloatArray
    in_contact: NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Exchange:
    """What one exchange applied and sensed.

    Attributes
    ----------
    first_sample : int
        Device index of the first sensed sample.
    force_n : ndarray, shape (n_samples, 3)
        Force of the finger on the screen in the rig frame, N; x has the sign of the velocity.
    accel_m_s2 : ndarray, shape (n_samples, 3)
        Skin acceleration at the nail.
    voltage_v : ndarray, shape (n_samples,)
        Monitored screen volts.
    touches : tuple of TouchReport
        Reports that arrived during the block, oldest first.
    applied_v : ndarray, shape (n_samples,)
        What plays of the drive, after clamping and the ramp that follows a gap, volts at the
        screen.
    play_sample : int
        Device index at which `applied_v` starts to play.
    clipped_samples : int
        How many samples of the drive were clamped.
    margin_samples : int
        Output still queued when the drive was handed over; the lead less the lateness.
    underrun_samples : int
        Samples that the output had nothing to play for; it played zero, or held its value
        where the device cannot but do so. What follows comes back over a ramp of
        `output.RETURN_S`.
    overrun_samples : int
        Sensed samples that were lost before this block.
    saturated_samples : int
        In which an acceleration or a further channel was at the end of its range.
    aux : ndarray, shape (n_samples, n_aux), or None
        Further channels, in the units that `RigInfo.aux` gives; None where there are none.
    truth : Truth or None
        On a simulated rig; a recording that is played has none.
    """

    first_sample: int
    force_n: FloatArray
    accel_m_s2: FloatArray
    voltage_v: FloatArray
    touches: tuple[TouchReport, ...]
    applied_v: FloatArray
    play_sample: int
    clipped_samples: int
    margin_samples: int
    underrun_samples: int = 0
    overrun_samples: int = 0
    saturated_samples: int = 0
    aux: FloatArray | None = None
    truth: Truth | None = None


class Backend(Protocol):
    """One rig. Open → (arm → exchange … → stop)* → close; exchange also runs disarmed."""

    @property
    def info(self) -> RigInfo:
        """What does not change while the backend is open."""
        ...

    def open(self) -> None:
        """Start the sample clock with the lead prefilled with zeros; disarmed.

        Raises
        ------
        ConfigError
            If the configuration does not fit the device.
        """
        ...

    @property
    def next_play_sample(self) -> int:
        """Device index at which the next drive handed over will start to play."""
        ...

    def arm(self) -> None:
        """Allow output other than zero."""
        ...

    def exchange(self, drive_v: FloatArray) -> Exchange:
        """Hand over the next block of output; wait for as many sensed samples.

        Parameters
        ----------
        drive_v : ndarray, shape (n_samples,)
            Screen volts. Beyond +/-`screen_peak_v` they are clamped and counted.

        Raises
        ------
        UnsafeDriveError
            If a sample is not finite; nothing of the block is output.
        NotArmedError
            If a sample is not zero while disarmed; nothing of the block is output.
        ClosedError, TransientError, StreamLostError, DeviceLostError, LinkLostError
            See `frictus_hardware.errors`.
        """
        ...

    def stop(self, ramp_s: float) -> None:
        """Ramp what is queued to zero within `ramp_s`, drop the rest, and disarm.

        The ramp starts at the earliest sample that can still be changed. Safe at any time, and
        more than once.
        """
        ...

    def health(self) -> str | None:
        """Return what is wrong with the device, or None."""
        ...

    def close(self) -> None:
        """Bring the output to zero and release the device. Closing twice is harmless."""
        ...

    def __enter__(self) -> Self:
        """Open and return self."""
        ...

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Close, whatever happened."""
        ...


@runtime_checkable
class GrowingLead(Protocol):
    """A backend whose lead may be made longer while nothing is output."""

    def lengthen_lead(self, lead_samples: int) -> None:
        """Have what is handed over from now on play later; zeros play in between.

        The lead stays that long through closing and opening.

        Parameters
        ----------
        lead_samples : int
            `RigInfo.lead_samples` to `RigInfo.max_lead_samples`.

        Raises
        ------
        ConfigError
            If it is out of this range, or the output is armed.
        ClosedError
            If the rig is not open; or the fault that lasts.
        """
        ...


class RigConfig(StrictModel, ABC):
    """A backend as a configuration file names it, by its `kind`.

    It is read in processes that need no backend: what `make` needs is imported there.

    Attributes
    ----------
    kind : str
        Each backend's own word.
    """

    kind: str

    @property
    @abstractmethod
    def nominal_rate_hz(self) -> float:
        """Samples per second of the device's clock."""

    @property
    def clock_scale(self) -> float:
        """Seconds of the device's clock per second of this machine's."""
        return 1.0

    @property
    def files(self) -> Mapping[tuple[str, ...], Path]:
        """The files that the rig is made from, by the keys that name them."""
        return {}

    def within(self, folder: Path) -> Self:
        """Return this configuration with relative files made relative to `folder`.

        Parameters
        ----------
        folder : Path
            Of the configuration file.
        """
        return self

    @abstractmethod
    def make(self) -> Backend:
        """Return the rig, not yet open: its sample clock starts with `open`.

        Raises
        ------
        ConfigError
            If the configuration does not fit the device.
        """

    def reset(self) -> None:
        """Bring the device's output to zero after the process that drove it has died.

        A rig simulated inside that process has died with it, and needs nothing.

        Raises
        ------
        HardwareError
            If the device cannot be reached.
        """
