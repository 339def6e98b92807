"""What is read from one trial, and by whom: what workers do and the cache keeps."""

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from importlib import import_module
from pathlib import Path

from frictus_service.identification.observation.observations import TrialObservations
from frictus_service.identification.pipeline.structured_columns import Table
from frictus_service.study.trial import StudyInfo, Trial


@dataclass(frozen=True, slots=True)
class Reading:
    """What was read from a trial.

    Attributes
    ----------
    observed : TrialObservations
        Responses, and whether the trial may be used.
    more : mapping of str to ndarray
        What the reader adds to the observations, as structured arrays by name; empty where a
        trial could not be read.
    """

    observed: TrialObservations
    more: Mapping[str, Table] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Reader:
    """A pure function of a trial, known by its name and its source.

    Attributes
    ----------
    name : str
        Of what it reads; files in the cache end in it.
    read : callable
        Of a module, so that a worker can import it.
    sources : tuple of str
        Modules, besides those of the observations, on which the result depends.
    """

    name: str
    read: Callable[[Trial, StudyInfo], Reading]
    sources: tuple[str, ...] = ()

    @property
    def version(self) -> str:
        """Hash of the source of its modules."""
        return version_of(self.sources)


@lru_cache(maxsize=8)
def version_of(modules: tuple[str, ...]) -> str:
    """Return the hash of the source of modules.

    Parameters
    ----------
    modules : tuple of str
        Their full names.
    """
    hashed = hashlib.sha256()
    for name in modules:
        hashed.update(Path(str(import_module(name).__file__)).read_bytes())
    return hashed.hexdigest()
