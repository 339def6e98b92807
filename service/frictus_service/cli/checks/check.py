"""What one check of `frictus doctor` found."""

from dataclasses import dataclass
from typing import Literal

Verdict = Literal["ok", "warn", "fail"]


@dataclass(frozen=True, slots=True)
class Check:
    """What one check found.

    Attributes
    ----------
    name : str
        What was looked at.
    verdict : {'ok', 'warn', 'fail'}
    found : str
        What was found.
    to_do : str
        What an operator should do; empty if nothing.
    """

    name: str
    verdict: Verdict
    found: str
    to_do: str = ""
