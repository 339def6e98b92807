"""A figure of the benchmark: what was measured, what it stands beside, and the target."""

import statistics
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, Literal

import numpy as np

SCHEMA: Final = "bench/1"


@dataclass(frozen=True, slots=True)
class Target:
    """A bound.

    Attributes
    ----------
    of : str
        `ratio`, or the name of a value.
    sense : {'at most', 'at least'}
    bound : float
        In the figure's unit.
    """

    of: str
    sense: Literal["at most", "at least"]
    bound: float

    def met_by(self, measured: float) -> bool:
        """Return whether a measured number keeps the bound; NaN never does."""
        return measured <= self.bound if self.sense == "at most" else measured >= self.bound


@dataclass(frozen=True, slots=True)
class Figure:
    """One row of the report.

    Attributes
    ----------
    name : str
        Stable; programs may look for it.
    unit : str
        Of all values, those beside included.
    value : dict
        What was measured, by name; empty where it could not be.
    beside : dict
        What it is to be compared with, measured in the same run.
    ratio : float or None
        As `remark` says; None where there is nothing to divide by.
    target : Target or None
        What is asked for; None: nothing.
    remark : str
        What the numbers are, or why there are none.
    """

    name: str
    unit: str
    value: dict[str, float]
    beside: dict[str, float] = field(default_factory=dict)
    ratio: float | None = None
    target: Target | None = None
    remark: str = ""

    @property
    def met(self) -> bool | None:
        """Whether the target is met; None without a target or a measurement."""
        if self.target is None:
            return None
        measured = self.ratio if self.target.of == "ratio" else self.value.get(self.target.of)
        return None if measured is None else self.target.met_by(measured)

    def fields(self) -> dict[str, Any]:
        """Return the figure as plain data, for JSON."""
        target = self.target
        return {
            "name": self.name,
            "unit": self.unit,
            "value": {key: _short(number) for key, number in self.value.items()},
            "beside": {key: _short(number) for key, number in self.beside.items()},
            "ratio": None if self.ratio is None else _short(self.ratio),
            "target": target and {"of": target.of, "is": target.sense, "bound": target.bound},
            "met": self.met,
            "remark": self.remark,
        }


def _short(number: float) -> float:
    return float(f"{number:.4g}")


def skipped(name: str, unit: str, why: str) -> Figure:
    """Return the figure of what cannot be measured here."""
    return Figure(name, unit, {}, remark=f"not measured: {why}")


def interleaved(repeats: int, *contenders: Callable[[], float]) -> list[float]:
    """Return the median of each contender's results; they take turns.

    Parameters
    ----------
    repeats : int
        How often each is called. What else the machine does meanwhile meets all alike.
    contenders : callable
        Return what they measured.
    """
    results: list[list[float]] = [[] for _ in contenders]
    for _ in range(repeats):
        for taken, contender in zip(results, contenders, strict=True):
            taken.append(contender())
    return [statistics.median(taken) for taken in results]


def spread(samples: Sequence[float], worst: bool = False) -> dict[str, float]:
    """Return `p50` and `p99` of what was measured, and `max` if asked for."""
    p50, p99 = np.percentile(samples, (50.0, 99.0))
    found = {"p50": float(p50), "p99": float(p99)}
    return found | {"max": float(max(samples))} if worst else found
