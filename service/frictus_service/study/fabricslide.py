"""FabricSlide (Wang et al. 2022, doi 10.3389/fnbot.2022.808222): recognised and refused.

CSV files of a capacitive finger that a robot slides over fabrics. They hold speed and direction
in the file's name, and raw counts of pressure; nothing of that identifies friction.
"""

import csv
import re
from itertools import pairwise
from pathlib import Path
from statistics import median
from typing import Final, NoReturn

from frictus_service.study.errors import StudyError
from frictus_service.study.plausible import SAMPLE_RATE

_NAME: Final = re.compile(r"\w+_F\d+_V-?\d+mmps_\d+\.csv")
_FIRST_COLUMNS: Final = ["timestamp", "proximity1", "proximity2", "channel1"]


class FabricSlide:
    """Importer of one file, or of a folder of them."""

    layout = "FabricSlide CSV"

    def recognises(self, path: Path) -> bool:
        """Return whether it is such a file, or a folder that holds one."""
        return any(True for _ in _files(path))

    def open(self, path: Path) -> NoReturn:
        """Refuse the recordings.

        Raises
        ------
        StudyError
            Always: it says what they lack.
        """
        files = sorted(_files(path))
        rate_hz = sample_rate_hz(files[0])
        raise StudyError(
            f"{path}: {len(files)} FabricSlide recording{'s'[: len(files) > 1]} cannot be "
            f"identified: no tangential force was recorded; {rate_hz:.1f} Hz is too slow for "
            f"the band of 20 to 1000 Hz, which needs at least {SAMPLE_RATE.lowest:g} Hz; no "
            "electrovibration was driven; the normal force is in raw counts, of a sensor that "
            "is no finger. Accepted: recordings with force, drive voltage and position, as "
            "docs/study.md says"
        )


def sample_rate_hz(path: Path) -> float:
    """Return the sample rate of a file, from the median step of its timestamps in ms.

    Parameters
    ----------
    path : Path

    Raises
    ------
    StudyError
        If it is damaged.
    """
    try:
        with path.open(newline="", encoding="utf-8") as stream:
            times_ms = [float(row[0]) for row in list(csv.reader(stream))[1:]]
        return 1000.0 / median(late - early for early, late in pairwise(times_ms))
    except (ValueError, IndexError, ZeroDivisionError) as error:
        raise StudyError(
            f"{path}: looks like FabricSlide, but its timestamps cannot be read ({error}); "
            "restore the file"
        ) from error


def _files(path: Path) -> list[Path]:
    candidates = list(path.iterdir()) if path.is_dir() else [path]
    return [file for file in candidates if _NAME.fullmatch(file.name) and _has_columns(file)]


def _has_columns(path: Path) -> bool:
    try:
        with path.open(encoding="utf-8") as stream:
            columns = stream.readline(1000).split(",")
    except (OSError, UnicodeDecodeError):
        return False
    return [column.strip() for column in columns[:4]] == _FIRST_COLUMNS
