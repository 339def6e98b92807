"""Compiled code beside itself as plain Python: the same calls, and what came of them compared.

As plain Python the same lines run on numpy with its indices checked, in other rounding, and
without whatever compiling may have done to them.
"""

import copy
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FunctionType, ModuleType
from typing import Any

import numpy as np
from hypothesis import settings
from numba.core.dispatcher import Dispatcher

TOLERANCE = 1e-9
"""Largest difference, relative to the largest value of an array."""


def few(share: int) -> int:
    """Return a share of the examples of a property, 20 at least: for one that takes long."""
    assert settings.default is not None
    return max(20, settings.default.max_examples // share)


def plain(compiled: Dispatcher) -> Callable[..., Any]:
    """Return a compiled function as plain Python, with all that it calls."""
    return _plain(compiled, {})


def _plain(compiled: Any, made: dict[int, FunctionType]) -> FunctionType:
    if id(compiled) not in made:
        python = compiled.py_func
        scope = dict(python.__globals__)
        made[id(compiled)] = FunctionType(
            python.__code__, scope, python.__name__, python.__defaults__, python.__closure__
        )
        for name, value in python.__globals__.items():
            if isinstance(value, Dispatcher):
                scope[name] = _plain(value, made)
    return made[id(compiled)]


class Compared:
    """A compiled function whose calls are made twice.

    Parameters
    ----------
    compiled : Dispatcher
    most_items : int
        A call with more in its arrays is made once: plain Python takes too long for it.
    """

    def __init__(self, compiled: Any, most_items: int) -> None:
        self.calls = 0
        self._compiled = compiled
        self._plain = plain(compiled)
        self._most_items = most_items

    def __call__(self, *arguments: Any) -> Any:
        """Return what the compiled function does."""
        if _items(arguments) > self._most_items:
            return self._compiled(*arguments)
        beside = copy.deepcopy(arguments)
        returned = self._compiled(*arguments)
        with np.errstate(all="ignore"):
            expected = self._plain(*beside)
        self.calls += 1
        self._assert_equal(returned, expected)
        self._assert_equal(arguments, beside)
        return returned

    def _assert_equal(self, got: Any, expected: Any) -> None:
        if isinstance(expected, tuple):
            assert len(got) == len(expected)
            for mine, its in zip(got, expected, strict=True):
                self._assert_equal(mine, its)
        elif isinstance(expected, np.ndarray | float | complex | int | np.generic):
            expected = np.asarray(expected)
            finite = np.abs(expected[np.isfinite(expected)])
            scale = float(finite.max(initial=0.0))
            np.testing.assert_allclose(got, expected, rtol=TOLERANCE, atol=TOLERANCE * scale)


def _items(value: Any) -> int:
    if isinstance(value, tuple):
        return sum(map(_items, value))
    return int(value.size) if isinstance(value, np.ndarray) else 0


@contextmanager
def compared(
    *modules: ModuleType, most_items: int = 10_000_000
) -> Iterator[dict[str, Compared]]:
    """Have every compiled function of these modules compared whenever Python calls it.

    Parameters
    ----------
    modules : module
        Where they are defined.
    most_items : int
        As of `Compared`.

    Yields
    ------
    dict
        The functions by name, with the number of their calls.
    """
    own = {
        name: value
        for module in modules
        for name, value in vars(module).items()
        if isinstance(value, Dispatcher) and value.py_func.__module__ == module.__name__
    }
    watched = {name: Compared(value, most_items) for name, value in own.items()}
    replaced: list[tuple[ModuleType, str, Any]] = []
    for module in [m for name, m in sys.modules.items() if name.startswith("frictus")]:
        here = {name: v for name, v in vars(module).items() if isinstance(v, Dispatcher)}
        # What compiled code itself calls stays what it is where it is looked up to be compiled.
        kept = {name for v in here.values() for name in v.py_func.__code__.co_names}
        for name in here.keys() - kept:
            if any(here[name] is each for each in own.values()):
                replaced.append((module, name, here[name]))
                setattr(module, name, watched[here[name].py_func.__name__])
    try:
        yield watched
    finally:
        for module, name, value in replaced:
            setattr(module, name, value)
