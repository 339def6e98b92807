"""A recording as a rig plays it, and its file `replay/1`; `docs/replay.md` lists the fields."""

import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, Final, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from frictus_hardware.arguments import LONGEST_MM
from frictus_hardware.arrays import FloatArray, IntArray
from frictus_hardware.base import RigConfig
from frictus_hardware.errors import ConfigError
from frictus_hardware.simulated.clock import ClockSetting, scale_of

if TYPE_CHECKING:
    from frictus_hardware.replay.rig import ReplayRig


class ReplayConfig(RigConfig):
    """A recording that plays as a rig.

    Lead, screen, limit of the output and latency of the touch sensor are the recorded rig's.

    Attributes
    ----------
    file : Path
        Of `replay/1`, as `frictus export RECORDING --to replay` makes it.
    sample_rate_hz : float
        At which it was recorded; the file has to agree.
    clock : "real", "virtual" or float
        A number, 0.01 to 100, plays that many times faster than real time; the virtual clock
        plays as fast as the rig is asked, and nothing is ever late.
    at_end : "stop" or "loop"
        Whether the device is lost where the recording ends, or plays it again.
    """

    kind: Literal["replay"] = "replay"
    file: Path
    sample_rate_hz: float = Field(default=20_000.0, ge=1_000.0, le=200_000.0)
    clock: ClockSetting = "real"
    at_end: Literal["stop", "loop"] = "stop"

    @property
    def nominal_rate_hz(self) -> float:
        """Samples per second of the device's clock."""
        return self.sample_rate_hz

    @property
    def clock_scale(self) -> float:
        """Seconds of the device's clock per second of this machine's."""
        return scale_of(self.clock)

    @property
    def files(self) -> Mapping[tuple[str, ...], Path]:
        """The recording, by the key that names it."""
        return {("file",): self.file}

    def make(self) -> "ReplayRig":
        """Return the rig, not yet open.

        Raises
        ------
        ConfigError
            If the file cannot be read, or is not such a recording.
        """
        from frictus_hardware.replay.rig import ReplayRig

        return ReplayRig(self, read_tape(self.file))

    def within(self, folder: Path) -> Self:
        """Return this configuration with a relative file made relative to `folder`."""
        return self.model_copy(update={"file": folder / self.file})


SCHEMA: Final = "replay/1"
N, STRETCHES, TOUCHES = "samples", "stretches", "touches"
FORMS: Final[dict[str, tuple[str, tuple[str | int, ...]]]] = {
    "name": ("U", ()),
    "finger_source": ("U", ()),
    "sample_rate_hz": ("f", ()),
    "lead_samples": ("i", ()),
    "screen_mm": ("f", (2,)),
    "screen_peak_v": ("f", ()),
    "touch_latency_s": ("f", ()),
    "force": ("if", (N, 3)),
    "force_step_n": ("f", ()),
    "accel": ("if", (N, 3)),
    "accel_step_m_s2": ("f", ()),
    "voltage_v": ("f", (N,)),
    "stretch_row": ("i", (STRETCHES,)),
    "stretch_first_sample": ("i", (STRETCHES,)),
    "touch_arrival_sample": ("i", (TOUCHES,)),
    "touch_measured_sample": ("f", (TOUCHES,)),
    "touch_x_mm": ("f", (TOUCHES,)),
    "touch_y_mm": ("f", (TOUCHES,)),
    "touch_in_contact": ("b", (TOUCHES,)),
}
"""Kinds of NumPy dtype, and shape; equal words stand for equal lengths."""
UNREADABLE: Final = (
    OSError,
    EOFError,
    ValueError,
    RuntimeError,
    zipfile.BadZipFile,
    zlib.error,
)


@dataclass(frozen=True, slots=True)
class Tape:
    """What one run of a rig sensed, with its gaps.

    Device samples count as they did when it was recorded.

    Attributes
    ----------
    name : str
        Of the recording.
    finger_source : str
        `touch`, `pointer` or `simulated`, as it was recorded.
    sample_rate_hz : float
        1 to 200 kHz.
    lead_samples : int
        Of the recorded rig, up to 1 s.
    screen_mm : tuple of float
        Width and height.
    screen_peak_v : float
        Up to 75 V.
    touch_latency_s : float
        Declared age of a report when it arrived, up to 1 s.
    force, accel : ndarray, shape (n_samples, 3)
        Counts or values: times the step they are N and m/s².
    force_step_n, accel_step_m_s2 : float
        1 where values are stored.
    voltage_v : ndarray, shape (n_samples,)
        Screen volts, as monitored then.
    stretch_row, stretch_first_sample : ndarray, shape (n_stretches,)
        Where each unbroken stretch begins, among the samples stored and on the device. What
        lies between two of them is missing.
    touch_arrival_sample : ndarray, shape (n_touches,)
        During which a report arrived.
    touch_measured_sample : ndarray, shape (n_touches,)
        At which the finger was there.
    touch_x_mm, touch_y_mm, touch_in_contact : ndarray, shape (n_touches,)

    Raises
    ------
    ConfigError
        If a value is out of its range, or two contradict each other.
    """

    name: str
    finger_source: str
    sample_rate_hz: float
    lead_samples: int
    screen_mm: tuple[float, float]
    screen_peak_v: float
    touch_latency_s: float
    force: NDArray[Any]
    force_step_n: float
    accel: NDArray[Any]
    accel_step_m_s2: float
    voltage_v: NDArray[Any]
    stretch_row: IntArray
    stretch_first_sample: IntArray
    touch_arrival_sample: IntArray
    touch_measured_sample: FloatArray
    touch_x_mm: FloatArray
    touch_y_mm: FloatArray
    touch_in_contact: NDArray[np.bool_]

    def __post_init__(self) -> None:
        """Refuse what cannot have been recorded."""
        if not self.voltage_v.size:
            raise ConfigError("it holds no samples")
        for field, (holds, accepted) in self._rules().items():
            if not holds:
                raise ConfigError(f"{field}: {accepted}, not {_shown(getattr(self, field))}")

    def _rules(self) -> dict[str, tuple[bool, str]]:
        rate_hz, width_height = self.sample_rate_hz, self.screen_mm
        steps, gaps = np.diff(self.stretch_row), np.diff(self.stretch_first_sample)
        rows, arrivals = self.stretch_row, self.touch_arrival_sample
        whole = rows.size > 0 and rows[0] == 0 and rows[-1] < self.voltage_v.size
        rules = {
            "finger_source": (
                self.finger_source in ("touch", "pointer", "simulated"),
                "'touch', 'pointer' or 'simulated' accepted",
            ),
            "sample_rate_hz": (1e3 <= rate_hz <= 2e5, "1000 to 200000 accepted"),
            "lead_samples": (1 <= self.lead_samples <= rate_hz, "1 sample to 1 s accepted"),
            "screen_mm": (
                all(0.0 < side <= LONGEST_MM for side in width_height),
                f"above 0, to {LONGEST_MM:g} accepted",
            ),
            "screen_peak_v": (0.0 < self.screen_peak_v <= 75.0, "above 0, to 75 accepted"),
            "touch_latency_s": (0.0 <= self.touch_latency_s <= 1.0, "0 to 1 accepted"),
            "force_step_n": (self.force_step_n > 0.0, "above 0 accepted"),
            "accel_step_m_s2": (self.accel_step_m_s2 > 0.0, "above 0 accepted"),
            "stretch_row": (
                whole and bool(np.all(steps > 0)),
                "0, then growing numbers of samples stored accepted",
            ),
        }
        if rules["stretch_row"][0]:
            inside = (arrivals >= self.first_sample) & (arrivals < self.end_sample)
            rules["stretch_first_sample"] = (
                bool(self.first_sample >= 0 and np.all(gaps > steps)),
                "samples of the device accepted, with some missing between two stretches",
            )
            rules["touch_arrival_sample"] = (
                bool(np.all(inside) and np.all(np.diff(arrivals) >= 0)),
                "samples of the device within the recording accepted, in order",
            )
        return rules

    @property
    def first_sample(self) -> int:
        """Device index of the first sample."""
        return int(self.stretch_first_sample[0])

    @property
    def end_sample(self) -> int:
        """Device index one past the last sample."""
        rest = self.voltage_v.size - self.stretch_row[-1]
        return int(self.stretch_first_sample[-1] + rest)

    def voltage_at(self, samples: IntArray) -> NDArray[Any]:
        """Return the volts that were monitored at device samples; NaN where none were."""
        stretch = np.searchsorted(self.stretch_first_sample, samples, side="right") - 1
        begins = np.maximum(stretch, 0)
        row = self.stretch_row[begins] + samples - self.stretch_first_sample[begins]
        ends = np.append(self.stretch_row[1:], self.voltage_v.size)[begins]
        known = (stretch >= 0) & (row < ends)
        return np.where(known, self.voltage_v[np.where(known, row, 0)], np.nan)


def write_tape(file: BinaryIO, tape: Tape) -> None:
    """Write a tape as `replay/1`."""
    content = {field.name: np.asarray(getattr(tape, field.name)) for field in fields(Tape)}
    np.savez(file, schema=np.asarray(SCHEMA), **content)  # type: ignore[arg-type]


def read_tape(path: Path) -> Tape:
    """Read a file of `replay/1`.

    Raises
    ------
    ConfigError
        If it cannot be read, is torn, of another version, or holds what cannot be played.
    """
    if path.is_dir():
        raise ConfigError(
            f"backend.file {path}: a folder; accepted: a file of {SCHEMA}; `frictus export "
            "RECORDING --to replay` makes one"
        )
    if path.exists() and not path.is_file():
        raise ConfigError(f"backend.file {path}: a pipe or a device; accepted: a file")
    try:
        with path.open("rb") as file:
            _refuse_spoilt(file)
            with np.load(file, allow_pickle=False) as archive:
                stored = {name: archive[name] for name in archive.files}
        return Tape(**_checked(stored))
    except ConfigError as error:
        raise ConfigError(f"backend.file {path}: {error}") from error
    except UNREADABLE as error:
        raise ConfigError(
            f"backend.file {path}: not a whole file of {SCHEMA} ({error}); `frictus export "
            "RECORDING --to replay` makes one"
        ) from error


def _refuse_spoilt(file: BinaryIO) -> None:
    """Compare checksums before anything is believed; NumPy parses headers first."""
    with zipfile.ZipFile(file) as archive:
        spoilt = archive.testzip()
    if spoilt is not None:
        raise ValueError(f"{spoilt} does not agree with its checksum")
    file.seek(0)


def _checked(stored: Mapping[str, NDArray[Any]]) -> dict[str, Any]:
    """Return the fields of a tape, each of its kind and shape and finite."""
    schema = str(stored.get("schema", ""))
    if schema != SCHEMA:
        raise ConfigError(f"schema {schema!r}: this version plays {SCHEMA!r}; export it anew")
    lengths: dict[str | int, int] = {}
    found: dict[str, Any] = {}
    for name, (kinds, shape) in FORMS.items():
        if name not in stored:
            raise ConfigError(f"{name} is missing")
        value = stored[name]
        wanted = value.ndim == len(shape) and all(
            size == (lengths.setdefault(length, size) if isinstance(length, str) else length)
            for size, length in zip(value.shape, shape, strict=True)
        )
        if value.dtype.kind not in kinds or not wanted:
            raise ConfigError(
                f"{name}: shape {value.shape} of {value.dtype}; accepted is "
                f"{_form(kinds, shape, lengths)}"
            )
        if value.dtype.kind == "f" and not np.all(np.isfinite(value)):
            raise ConfigError(f"{name}: NaN or infinite; what is missing is left out")
        if not shape:
            found[name] = value.item()
        else:
            found[name] = value.astype(np.int64) if kinds == "i" else value
    found["screen_mm"] = tuple(found["screen_mm"].tolist())
    return found


def _form(kinds: str, shape: tuple[str | int, ...], lengths: dict[str | int, int]) -> str:
    words = {"U": "text", "f": "float", "i": "integer", "if": "int16 or float", "b": "bool"}
    sizes = ", ".join(str(lengths.get(length, length)) for length in shape)
    return f"({sizes}) of {words[kinds]}"


def _shown(value: Any) -> str:
    return repr(value) if not isinstance(value, np.ndarray) else np.array2string(value[:8])
