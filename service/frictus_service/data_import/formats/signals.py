"""Signals with a sample rate each: WAV, and TDMS of LabVIEW."""

import warnings
from pathlib import Path

import numpy as np

from frictus_service.data_import.formats.columns import Columns, Gatherer
from frictus_service.errors import StudyError


def read_wav(path: Path) -> Columns:
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
        except UnboundLocalError as error:  # what scipy raises then
            raise StudyError(
                "it has no format or no samples; restore it from a copy"
            ) from error
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


def read_tdms(path: Path) -> Columns:
    """Return the channels of a TDMS file.

    Parameters
    ----------
    path : Path

    Raises
    ------
    StudyError
        If npTDMS is not installed, or the file declares more than a file may hold.
    """
    try:
        from nptdms import TdmsFile
    except ImportError as error:
        raise StudyError(
            "reading TDMS needs npTDMS: pip install 'frictus[import]', or save as HDF5 or CSV"
        ) from error
    gathered = Gatherer("TDMS")
    started = ""
    with TdmsFile.open(path) as file:
        groups = file.groups()
        for group in groups:
            for channel in group.channels():
                name = channel.name if len(groups) == 1 else f"{group.name}/{channel.name}"
                if channel.dtype is None or np.dtype(channel.dtype).kind not in "biuf":
                    continue
                if not gathered.reserve(name, (len(channel),)):
                    continue
                known = channel.properties
                values = np.asarray(channel[:])
                gathered.add(name, values, str(known.get("unit_string", "")), _rate(known))
                if "wf_start_time" in known:
                    started = started or f"{np.datetime64(known['wf_start_time'], 's')}Z"
    return gathered.result(started)


def _rate(properties: dict[str, object]) -> float | None:
    step_s = properties.get("wf_increment")
    if not isinstance(step_s, int | float) or not 0.0 < step_s < 1e6:
        return None
    return 1.0 / step_s
