"""A recording of a hammer's blows on a mount, as MATLAB and NumPy write them."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from frictus.files import require_file
from frictus_hardware.arrays import FloatArray
from frictus_service.errors import ServiceError
from frictus_service.study.matlab import read_variables

RATES: Final = ("sample_rate_hz", "rate_hz", "sr", "fs", "Fs")
"""Names under which a MATLAB file may hold its sample rate."""
ACCEPTED: Final = "accepted: .mat (level 5) or .npy with one channel of samples"


class ImpactRecordingError(ServiceError, ValueError):
    """The recording cannot be used; the text says why."""


@dataclass(frozen=True, slots=True)
class ImpactRecording:
    """A recording.

    Attributes
    ----------
    samples : ndarray, shape (n_samples,)
    rate_hz : float
        Samples per second.
    """

    samples: FloatArray
    rate_hz: float


def read_impacts(path: Path, rate_hz: float | None = None) -> ImpactRecording:
    """Return a recording of blows: the longest variable of a file is the channel.

    Parameters
    ----------
    path : Path
        Of the file.
    rate_hz : float or None
        Instead of the file's own.

    Raises
    ------
    FileNotFoundError
    UnreadableFileError
        If it is a pipe or a device.
    ImpactRecordingError
        If the file is of another kind, holds no single channel, or nobody says its rate.
    """
    held = _variables(path)
    arrays = {name: value for name, value in held.items() if _is_channel(value)}
    if not arrays:
        raise ImpactRecordingError(f"{path} holds no channel of samples; {ACCEPTED}")
    samples = max(arrays.values(), key=np.size)
    said = rate_hz or next((_number(held[name]) for name in RATES if name in held), None)
    if said is None or not 0.0 < said < np.inf:
        raise ImpactRecordingError(
            f"{path} does not say its sample rate ({', '.join(RATES)}): give it with --rate, Hz"
        )
    return ImpactRecording(samples.ravel().astype(np.float64), said)


def _variables(path: Path) -> dict[str, Any]:
    if path.is_dir():
        raise ImpactRecordingError(f"{path} is a folder; {ACCEPTED}")
    if path.suffix not in (".mat", ".npy"):
        raise ImpactRecordingError(
            f"{path} is a {path.suffix or 'file without ending'}; {ACCEPTED}"
        )
    require_file(path)
    try:
        if path.suffix == ".npy":
            return {"samples": np.load(path, allow_pickle=False)}
        return read_variables(path)
    except OSError:
        raise
    except Exception as error:  # parsers raise whatever a damaged file leads them to
        raise ImpactRecordingError(f"{path} cannot be read ({error}); {ACCEPTED}") from error


def _is_channel(value: Any) -> bool:
    return (
        isinstance(value, np.ndarray)
        and value.dtype.kind in "fiu"
        and value.size == max(value.shape, default=0) > 1
    )


def _number(value: Any) -> float | None:
    array = np.asarray(value)
    return float(array.item()) if array.size == 1 and array.dtype.kind in "fiu" else None
