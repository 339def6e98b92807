"""Why trials are left out: all reasons, counted by kind."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

_FIGURE: Final = re.compile(r"(?<=trial )\S+|[-+±]?\d[\d.,e+-]*")
"""Which the same reason gives anew for every trial."""
MOST: Final = 8
"""Kinds that are listed."""


@dataclass(frozen=True, slots=True)
class ReasonCount:
    """One kind of reason.

    Attributes
    ----------
    trials : int
        That have it.
    example : str
        The reason of the first of them.
    """

    trials: int
    example: str


def count_reasons(reasons: Iterable[Sequence[str]]) -> tuple[ReasonCount, ...]:
    """Return the kinds of reasons, the most frequent first.

    Parameters
    ----------
    reasons : iterable of sequence of str
        Of each trial, all that it has; those that differ in figures alone are of one kind.
    """
    counts: dict[str, int] = {}
    examples: dict[str, str] = {}
    for of_trial in reasons:
        for kind, reason in {_FIGURE.sub("", reason): reason for reason in of_trial}.items():
            counts[kind] = counts.get(kind, 0) + 1
            examples.setdefault(kind, reason)
    ordered = sorted(counts, key=lambda kind: -counts[kind])
    return tuple(ReasonCount(counts[kind], examples[kind]) for kind in ordered)


def list_reasons(reasons: Iterable[Sequence[str]]) -> str:
    """Return all kinds of reasons with their counts as one line.

    Parameters
    ----------
    reasons : iterable of sequence of str
        As for `count_reasons`.
    """
    found = count_reasons(reasons)
    told = [f"{each.trials} x {each.example}" for each in found[:MOST]]
    rest = found[MOST:]
    if rest:
        told.append(f"and {len(rest)} rarer kinds")
    return "; ".join(told)
