"""Balanced orders, each a function of seed and place alone: a resumed run repeats them."""

import zlib
from typing import Final

import numpy as np

from frictus.errors import ArgumentError

FLIP_BLOCK: Final = 8
"""Trials within which each of the two orders of intervals comes equally often."""


def latin_square(size: int) -> list[list[int]]:
    """Return a Williams design: rows of orders, balanced for position and first carry-over.

    Each treatment stands once in every position of the `size` rows; where `size` is odd, the
    mirrored rows follow, with which each also follows each other one equally often (Williams
    1949, Australian Journal of Scientific Research A 2, 149-168).

    Parameters
    ----------
    size : int
        Number of treatments, 1 to 32.

    Returns
    -------
    list of list of int
        `size` rows where it is even, or 1; else twice as many.

    Raises
    ------
    ArgumentError
        If the size is out of range.
    """
    if not 1 <= size <= 32:
        raise ArgumentError(f"{size} conditions: 1 to 32 can be balanced")
    first = [(k + 1) // 2 if k % 2 else (size - k // 2) % size for k in range(size)]
    rows = [[(each + shift) % size for each in first] for shift in range(size)]
    return rows + [row[::-1] for row in rows] * (size % 2 and size > 1)


def generator(seed: int, *place: int | str) -> np.random.Generator:
    """Return a random generator of its own for a place in an experiment.

    Parameters
    ----------
    seed : int
        Of the experiment, 0 or above.
    *place : int or str
        What it draws, and for which trial or condition.
    """
    words = [p if isinstance(p, int) else zlib.crc32(p.encode()) for p in place]
    return np.random.default_rng([seed, *words])


def flipped(seed: int, condition: str, trial: int, block: int = FLIP_BLOCK) -> bool:
    """Return whether the second order of intervals is used; balanced within a block.

    Parameters
    ----------
    seed : int
        Of the experiment.
    condition : str
        Name of the condition.
    trial : int
        Counts the trials of that condition from 0.
    block : int
        Trials within which each order comes equally often, even.
    """
    number, place = divmod(trial, block)
    order = generator(seed, "order of intervals", condition, number).permutation(block)
    return bool(order[place] % 2)


def is_catch(seed: int, condition: str, trial: int, every: int) -> bool:
    """Return whether a trial is a catch trial: one at a random place of each group.

    Parameters
    ----------
    seed : int
        Of the experiment.
    condition : str
        Name of the condition.
    trial : int
        Counts the trials of that condition from 0, catch trials included.
    every : int
        Size of a group; 0 for no catch trials.
    """
    if every == 0:
        return False
    group, place = divmod(trial, every)
    return bool(generator(seed, "catch trials", condition, group).integers(every) == place)


def next_condition(seed: int, trial: int, done: dict[str, int]) -> str:
    """Return which of interleaved conditions comes next: one of those with fewest trials.

    Parameters
    ----------
    seed : int
        Of the experiment.
    trial : int
        Counts all trials from 0.
    done : dict of str to int
        Trials done of each unfinished condition.
    """
    fewest = min(done.values())
    waiting = sorted(name for name, count in done.items() if count == fewest)
    return waiting[int(generator(seed, "condition", trial).integers(len(waiting)))]
