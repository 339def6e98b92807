"""Opening a study in whatever layout it is: `study/1`, or one that an importer reads.

A package registers importers of its own as entry points of the group `frictus.importers`.
"""

from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Final, Protocol

from frictus_service.study.errors import StudyError
from frictus_service.study.fabricslide import FabricSlide
from frictus_service.study.reader import StudyReader
from frictus_service.study.study import Study

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
    return StudyReader(path)
