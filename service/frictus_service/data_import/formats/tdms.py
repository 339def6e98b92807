"""TDMS of LabVIEW: channels with `unit_string` and `wf_increment`."""

from pathlib import Path

import numpy as np

from frictus_service.data_import.formats.columns import Columns, Gatherer
from frictus_service.errors import StudyError


def read(path: Path) -> Columns:
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
