"""The catalogue of causes; each has an effect of the same id in `frictus_hardware.physics`."""

import importlib
import pkgutil
from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from frictus_service.discovery.catalogue.cause import Cause
from frictus_service.errors import UnknownCauseError


def _found() -> dict[str, Cause]:
    names = [module.name for module in pkgutil.iter_modules(__path__)]
    modules = [importlib.import_module(f"{__name__}.{name}") for name in names]
    causes: list[Cause] = [cause for module in modules for cause in module.CAUSES]
    return {cause.id: cause for cause in sorted(causes, key=lambda cause: cause.id)}


CAUSES: Final[Mapping[str, Cause]] = MappingProxyType(_found())
"""By id, in alphabetical order."""


def cause_of(cause_id: str) -> Cause:
    """Return a cause.

    Raises
    ------
    UnknownCauseError
    """
    if cause_id not in CAUSES:
        raise UnknownCauseError(f"no cause {cause_id[:100]!r}: known are {', '.join(CAUSES)}")
    return CAUSES[cause_id]


def confusable_with(cause_id: str) -> dict[str, str]:
    """Return what a design may take for a cause, each with the separating experiment.

    Raises
    ------
    UnknownCauseError
    """
    found = dict(cause_of(cause_id).confusable)
    for other in CAUSES.values():
        for partner, experiment in other.confusable:
            if partner == cause_id:
                found[other.id] = experiment
    return found


def separating_experiment(first: str, second: str) -> str:
    """Return what separates two causes that a design cannot tell apart.

    Where the catalogue has nothing on the pair, it is what makes each of them firmer.

    Raises
    ------
    UnknownCauseError
    """
    known = confusable_with(first).get(second)
    if known is not None:
        return known
    return " ".join(
        dict.fromkeys([cause_of(first).next_experiment, cause_of(second).next_experiment])
    )
