"""What every study offers, and opening one in whatever layout it is.

A package registers importers of its own as entry points of the group `frictus.importers`.

FabricSlide (Wang et al. 2022, doi 10.3389/fnbot.2022.808222): recognised and refused.

CSV files of a capacitive finger that a robot slides over fabrics. They hold speed and direction
in the file's name, and raw counts of pressure; nothing of that identifies friction.
"""

import csv
import re
from collections.abc import Iterator
from importlib.metadata import EntryPoint, entry_points
from itertools import pairwise
from pathlib import Path
from statistics import median
from typing import Final, NoReturn, Protocol, Self

from frictus_service.errors import Exclusion, StudyError, TrialError
from frictus_service.study.layout import copy_of, measured_digest
from frictus_service.study.plausible import SAMPLE_RATE
from frictus_service.study.reader import StudyReader
from frictus_service.study.trial import StudyInfo, Trial, TrialInfo


class Study(Protocol):
    """An open study; a context manager."""

    @property
    def info(self) -> StudyInfo:
        """What holds for all trials."""

    @property
    def trials(self) -> tuple[TrialInfo, ...]:
        """Trials that can be read, by participant, session and order."""

    @property
    def excluded(self) -> tuple[Exclusion, ...]:
        """Trials that cannot be used, known without reading their data."""

    @property
    def sha256(self) -> str:
        """Hash of the whole study, hexadecimal."""

    def n_samples(self, trial_id: str) -> int:
        """Return how many samples a trial of `trials` has, without reading them."""

    def read(self, trial_id: str) -> Trial:
        """Return one trial.

        Raises
        ------
        TrialError
            If its data cannot be used.
        """

    def __enter__(self) -> Self:
        """Return the study."""

    def __exit__(self, *_: object) -> None:
        """Close it."""


def read_all(study: Study) -> Iterator[Trial | Exclusion]:
    """Yield every trial in order, one in memory at a time; what cannot be used as exclusions.

    Parameters
    ----------
    study : Study

    Yields
    ------
    Trial or Exclusion
        First those of `study.excluded`; a trial that holds the same data as an
        earlier one is excluded.
    """
    yield from study.excluded
    kept: dict[str, str] = {}
    for info in study.trials:
        try:
            trial = study.read(info.id)
        except TrialError as error:
            yield error.exclusion
            continue
        first = kept.setdefault(measured_digest(trial), info.id)
        yield trial if first == info.id else copy_of(first, info.id)


GROUP: Final = "frictus.importers"


class Importer(Protocol):
    """Reads studies of one layout; an entry point names an instance.

    Attributes
    ----------
    layout : str
        What it reads, as users call it.
    """

    @property
    def layout(self) -> str:
        """What it reads, as users call it."""

    def recognises(self, path: Path) -> bool:
        """Return whether a file or folder has the layout; quick, and without raising."""

    def open(self, path: Path) -> Study:
        """Return the study.

        Raises
        ------
        StudyError
            If it cannot be used; the text says why.
        """


def importers() -> tuple[Importer, ...]:
    """Return the importers that are there: those of this package, then those of others.

    Raises
    ------
    StudyError
        If one of another package cannot be loaded.
    """
    return (FabricSlide(), *(_load(point) for point in entry_points(group=GROUP)))


def _load(point: EntryPoint) -> Importer:
    try:
        found: Importer = point.load()
    except Exception as error:
        raise StudyError(
            f"the importer {point.name} ({point.value}) does not load: {error}; repair or "
            "uninstall the package that registers it"
        ) from error
    return found


def open_study(path: Path | str) -> Study:
    """Return an open study; close it, or use it as a context manager.

    Parameters
    ----------
    path : Path or str
        A `study/1` file, or what an importer recognises.

    Raises
    ------
    FileNotFoundError
    StudyError
        If it cannot be used.
    """
    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"there is no file {path}")
    for importer in importers():
        if importer.recognises(path):
            return importer.open(path)
    if path.suffix == ".mcap":
        raise StudyError(
            f"{path} is a recording, and no study yet: frictus export {path} --to h5 makes one"
        )
    return StudyReader(path)


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
            "docs/study.md says. Looked at may be what they have, the normal force and its "
            "spectrum against speed: frictus study show --friction, with a column map (--map)"
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
