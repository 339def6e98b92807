"""What a model leaves that is reproducible: how much, and where."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_service.discovery.inference.linear_model import (
    Unit,
    held_out_gain,
    joint,
    project_out,
)
from frictus_service.discovery.inference.linearisation import Linearised, columns_of
from frictus_service.discovery.inference.selection import select
from frictus_service.discovery.problem.patterns import Pattern
from frictus_service.discovery.problem.problem import DiscoveryProblem

OMNIBUS: Final = 0.025
"""Family-wise, of all patterns: noticing something unknown in nothing is a false alarm too. Six
units cannot reach it: theirs is the smallest p there is, 0.031."""
MOST_PATTERNS: Final = 6
HALF: Final = 0.5
"""Of the largest misfit at any tone: where it is."""


@dataclass(frozen=True, slots=True)
class UnexplainedPattern:
    """Something reproducible that no cause in the model accounts for.

    Attributes
    ----------
    pattern : Pattern
        Channel, tones and covariate.
    number : int
        Of the pattern.
    tones : tuple of int
        Where it is largest; empty where the channel has none.
    p_value : float
        Family-wise, over all patterns.
    gain : ndarray, shape (n_units,)
        Held-out, beside the residues before it.
    mean : float
        Coefficient of the pattern, over units, beside all other residues.
    """

    pattern: Pattern
    number: int
    tones: tuple[int, ...]
    p_value: float
    gain: FloatArray
    mean: float


def find_unexplained(
    problem: DiscoveryProblem, model: Linearised, units: Sequence[Unit], flips: FloatArray
) -> list[UnexplainedPattern]:
    """Return the patterns that a model leaves, strongest first, each beside those before.

    Parameters
    ----------
    problem : DiscoveryProblem
        Data, base model and candidates.
    model : Linearised
        A fitted model with the units about it.
    units : sequence of Unit
        About the model; their effects are the patterns, all that is known is their own.
    flips : ndarray
        Shape (n_flips, n_units), of `signs`.
    """
    level = max(OMNIBUS, 2.0 / len(flips))
    found = select(lambda chosen: units, flips, level, most=MOST_PATTERNS).effects
    means = joint(units, found).mean(axis=0) if found else np.zeros(0)
    unexplained = []
    for place, pattern in enumerate(found):
        left = project_out(units, found[:place])
        unexplained.append(
            UnexplainedPattern(
                problem.patterns[pattern],
                pattern,
                _largest_at(problem, model, units, problem.patterns[pattern]),
                float(left.significance(flips).p[pattern]),
                held_out_gain(left)[:, pattern],
                float(means[place]),
            )
        )
    return unexplained


def _largest_at(
    problem: DiscoveryProblem, model: Linearised, units: Sequence[Unit], found: Pattern
) -> tuple[int, ...]:
    """Return the tones at which a misfit of this kind is half as large as anywhere, at least.

    Size and phase are taken together: a resonance turns the phase far from where it is.
    """
    if found.channel not in ("size", "phase"):
        return found.tones
    tones = sorted({tone for subject in problem.subjects for tone in subject.tone.tolist()})
    alone = [
        Pattern(channel, (tone,), found.covariate, found.form)
        for channel in ("size", "phase")
        for tone in tones
    ]
    columns = columns_of(
        problem, model, lambda unit: [each.of(problem.subjects[unit]) for each in alone]
    )
    bare = [
        unit.looking_for(effects, accuracy)
        for unit, (effects, accuracy) in zip(units, columns, strict=True)
    ]
    mean = np.nan_to_num(project_out(bare).estimates).mean(axis=0)
    size, phase = np.split(mean, 2)
    misfit = np.hypot(size, phase)
    return tuple(
        tone for tone, m in zip(tones, misfit, strict=True) if m >= HALF * misfit.max()
    )
