"""WAV: channels as fractions of full scale, which the map makes newtons or volts."""

import warnings
from pathlib import Path

import numpy as np

from frictus_service.data_import.formats.columns import Columns, Gatherer
from frictus_service.errors import StudyError


def read(path: Path) -> Columns:
    """Return the channels of a WAV file, 1 at full scale.

    Parameters
    ----------
    path : Path

    Raises
    ------
    StudyError
        If it is too large, or cut short.
    """
    from scipy.io import wavfile

    gathered = Gatherer("WAV")
    # A sample takes a byte at least.
    gathered.reserve("the file", (path.stat().st_size,))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", wavfile.WavFileWarning)  # chunks that hold no samples
        warnings.filterwarnings("error", "Reached EOF", wavfile.WavFileWarning)
        try:
            rate_hz, samples = wavfile.read(path)
        except wavfile.WavFileWarning as error:
            raise StudyError(f"it is cut short ({error}); restore it from a copy") from error
    matrix = samples.reshape(samples.shape[0], -1)
    names = [f"channel {number}" for number in range(1, matrix.shape[1] + 1)]
    for number, name in enumerate(names):
        gathered.add(name, _fractions(matrix[:, number]), "full scale", float(rate_hz))
    return gathered.result()


def _fractions(samples: np.ndarray) -> np.ndarray:
    if samples.dtype.kind == "f":
        return samples
    if samples.dtype == np.uint8:
        return (samples.astype(np.float64) - 128.0) / 128.0
    return samples / -float(np.iinfo(samples.dtype).min)
