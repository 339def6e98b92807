"""Names of models, and references to one version of them.

A name has one or two parts: ``population``, ``rig1/P01``. A reference is ``rig1/P01@3`` (a
version), ``rig1/P01@production`` (an alias) or ``rig1/P01`` (the newest version).
"""

import re
from dataclasses import dataclass
from typing import Final

from frictus_service.registry.errors import RegistryNameError

_PART: Final = r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}"
NAME: Final = rf"{_PART}(/{_PART})?"
ALIAS: Final = "[a-z][a-z0-9_-]{0,31}"
_WHICH: Final = "[1-9][0-9]{0,8}"
REFERENCE: Final = rf"{NAME}(@({_WHICH}|{ALIAS}))?"
"""Names, aliases and references, as patterns."""
_NAME: Final = re.compile(NAME, re.ASCII)
_ALIAS: Final = re.compile(ALIAS, re.ASCII)
_VERSION: Final = re.compile(_WHICH, re.ASCII)
RESERVED: Final = frozenset({"aliases", "audit", "compare", "model.json", "model.mat"})
"""Parts that no name may have: the REST paths below a model's end with them."""


@dataclass(frozen=True, slots=True)
class Reference:
    """Which version is meant.

    Attributes
    ----------
    name : str
        Name of the model.
    which : int, str or None
        Version, alias, or None for the newest.
    """

    name: str
    which: int | str | None

    def __str__(self) -> str:
        """Return the reference as people write it."""
        return self.name if self.which is None else f"{self.name}@{self.which}"


def check_name(name: str) -> str:
    """Return the name of a model.

    Raises
    ------
    RegistryNameError
        If no model can have it.
    """
    if not _NAME.fullmatch(name) or RESERVED.intersection(name.split("/")):
        raise RegistryNameError(
            f"model name {name[:150]!r}: one or two parts joined by '/' are accepted, such as "
            "'population' or 'rig1/P01', each 1 to 64 letters, digits, '.', '_' and '-' "
            f"beginning with a letter or digit; not {', '.join(sorted(RESERVED))}"
        )
    return name


def check_alias(alias: str) -> str:
    """Return the name of an alias.

    Raises
    ------
    RegistryNameError
        If no alias can have it.
    """
    if not _ALIAS.fullmatch(alias):
        raise RegistryNameError(
            f"alias {alias[:80]!r}: 1 to 32 lower-case letters, digits, '_' and '-' beginning "
            "with a letter are accepted, such as 'production'"
        )
    return alias


def parse_reference(text: str) -> Reference:
    """Return what ``NAME``, ``NAME@VERSION`` or ``NAME@ALIAS`` stands for.

    Raises
    ------
    RegistryNameError
        If it is none of them.
    """
    name, at, which = text.partition("@")
    check_name(name)
    if not at:
        return Reference(name, None)
    if _VERSION.fullmatch(which):
        return Reference(name, int(which))
    return Reference(name, check_alias(which))
