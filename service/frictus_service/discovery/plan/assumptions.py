"""How readings scatter and people differ: assumed for a design, estimated from a study."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from frictus_hardware.arrays import FloatArray, IntArray
from frictus_hardware.physics.stages import FORCE_NOISE_N
from frictus_hardware.simulated.config import WithinPersonScatter
from frictus_service.discovery.evidence.evidence_rows import EvidenceRows
from frictus_service.discovery.evidence.residuals import (
    HARMONIC,
    PHASE,
    STRETCH_PHASE,
    STRETCH_SIZE,
    TONE_SIZE,
    TONES,
    TRIAL_SIZE,
    Layout,
    accuracy_of,
    trials_of,
)
from frictus_service.discovery.inference.covariance import Whitening, whiten
from frictus_service.discovery.inference.linear_model import ProjectedUnits, project_out
from frictus_service.discovery.inference.linearisation import linearise
from frictus_service.discovery.problem.base_models import RANDOM_EFFECTS, ResponseName
from frictus_service.discovery.problem.candidates import Candidate
from frictus_service.discovery.problem.problem import DiscoveryProblem, UnwhitenedUnit

SECOND, THIRD = (HARMONIC + 4, HARMONIC + 8), (HARMONIC + 12, HARMONIC + 16)
LINES, LOW = (40, 41), 42
OF_NOISE: Final = (TONE_SIZE, PHASE, STRETCH_SIZE, STRETCH_PHASE, *SECOND, *THIRD)
"""Readings whose scatter falls with the drive and with the length of a trial."""

REFERENCE_S: Final = 2.0
"""Length of the trials on which the assumed scatters rest."""

Grid = tuple[tuple[float, float], ...]


@dataclass(frozen=True, slots=True)
class Assumptions:
    """What information follows from, besides the trials.

    Attributes
    ----------
    scatter : mapping of int to ((tone, scatter), ...)
        By kind of reading; beyond what measuring is accurate to. Interpolated in the
        logarithm of the tone.
    at : float
        Amplitude of the drive fraction times the root of a trial's seconds, where that holds.
    deviation : ndarray, shape (n_kinds,)
        Of the conditions, as `Whitening` has them.
    difference : ndarray, shape (n_random,)
        Of people in the random effects, as `Whitening` has them: no other effect is then shown
        by what could be such a difference.
    spread : mapping of Candidate to float
        Standard deviation of an effect's coefficient between people, beyond that.
    speed_wander, force_wander : tuple of (float, float)
        By how much they differ from their targets: shares, of a trial's mean, and of a third of
        a stroke within the trial.
    quiet_n2 : float
        Power from 4 to 30 Hz that is there anyway.
    source : str
        Where all this comes from, for people.
    """

    scatter: Mapping[int, Grid]
    at: float
    deviation: FloatArray
    difference: FloatArray
    spread: Mapping[Candidate, float]
    speed_wander: tuple[float, float]
    force_wander: tuple[float, float]
    quiet_n2: float
    source: str

    def scatters(
        self, layout: Layout, tones_hz: FloatArray, strength: FloatArray
    ) -> FloatArray:
        """Return the standard deviation of each reading of a unit.

        Parameters
        ----------
        layout : Layout
            Which rows make which reading.
        tones_hz : ndarray, shape (n_tones,)
            Of the study.
        strength : ndarray, shape (n_trials,)
            Amplitude of the drive fraction times the root of the trial's seconds; 0 in blank
            trials.
        """
        kind, tone = kinds(layout.part, tones_hz)
        found = np.zeros(kind.size)
        for each in np.unique(kind):
            own = kind == each
            grid = self.scatter.get(int(each), self.scatter[PHASE])
            found[own] = interpolated(grid, tone[own])
        weaker = self.at / np.maximum(strength, 1e-6)[trials_of(layout)]
        found = np.where(np.isin(kind, OF_NOISE), found * weaker, found)
        scatter: FloatArray = np.hypot(found, accuracy_of(layout) / 2.0)
        return scatter


def interpolated(grid: Grid, tones_hz: FloatArray) -> FloatArray:
    """Return the scatters at tones, linear in logarithms; beyond its ends as there."""
    tone, scatter = np.log(grid).T
    found: FloatArray = np.exp(np.interp(np.log(tones_hz), tone, scatter))
    return found


def kinds(part: IntArray, tones_hz: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return kind and tone of parts; a kind without tones gets the lowest.

    Parameters
    ----------
    part : ndarray of int
        As in `residuals.Layout`.
    tones_hz : ndarray
        Of the study.
    """
    kind, place = part // TONES, part % TONES
    place = np.where(kind == TRIAL_SIZE, np.maximum(place - 1, 0), place)
    return kind, tones_hz[np.where(kind < min(LINES), place, 0)]


BAND_SHARE: Final = (30.0 - 4.0) / 10_000.0
"""Of a sensor's noise at 20 kHz, from 4 to 30 Hz."""
SMALL: Final = 1e-9
"""A scatter that what measuring is accurate to outweighs."""
ANY: Final = 100.0

_NO_MAINS: Final = dict.fromkeys(LINES, ((ANY, SMALL),))
ASSUMED_SCATTER: Final[dict[ResponseName, Mapping[int, Grid]]] = {
    "friction": {
        TRIAL_SIZE: ((ANY, WithinPersonScatter().gain_per_trial),),
        TONE_SIZE: ((ANY, 0.001),),
        PHASE: (
            (50.0, 1.6e-4),
            (120.0, 2.2e-4),
            (300.0, 3.4e-4),
            (900.0, 6e-4),
            (1700.0, 8e-4),
        ),
        STRETCH_SIZE: ((50.0, 1.7e-3), (300.0, 1.7e-3), (900.0, 2.1e-3), (1700.0, 2.6e-3)),
        STRETCH_PHASE: ((50.0, 2.8e-4), (120.0, 4e-4), (300.0, 7.4e-4), (900.0, 1.4e-3)),
        **dict.fromkeys(SECOND, ((60.0, 8e-5), (400.0, 5.5e-5), (900.0, 1e-4), (1700.0, 6e-4))),
        **dict.fromkeys(THIRD, ((120.0, 8e-5), (300.0, 5e-5), (900.0, 2e-4), (1700.0, 1.5e-3))),
        **_NO_MAINS,
        LOW: ((ANY, 0.22),),
    },
    "mobility": {
        TRIAL_SIZE: ((ANY, 0.011),),
        TONE_SIZE: ((ANY, 0.011),),
        PHASE: ((50.0, 0.019), (120.0, 5e-3), (280.0, 4e-3), (900.0, 0.013), (1700.0, 0.025)),
        STRETCH_SIZE: ((50.0, 2e-3), (120.0, 7e-4), (300.0, 4e-4), (900.0, 1.2e-3)),
        STRETCH_PHASE: ((50.0, 2e-3), (120.0, 7e-4), (300.0, 4e-4), (900.0, 1.5e-3)),
    },
}
ASSUMED_DEVIATION: Final[dict[ResponseName, tuple[float, ...]]] = {
    "friction": (0.025, 0.051),
    "mobility": (0.05, 0.056, 0.056),
}
ASSUMED_DIFFERENCE: Final[dict[str, float]] = {
    "speed_dependent_cutoff": 3.4,
    "force_dependent_cutoff": 0.0013,
    "speed_dependent_gain": 0.042,
    "force_dependent_gain": 0.042,
    "speed_dependent_mass": 0.04,
    "speed_dependent_stiffness": 0.01,
}
"""Of the first parameter, between people. What is found times the root of 8/7: the most likely
differences of 8 people are too small by that. Of the mass 0.0006 is found, and more assumed:
nobody knows how people's masses differ in following speed."""
ASSUMED_SOURCE: Final = (
    "Scatters are assumed: contact made anew in each trial, 10 % of the gain; sensor noise "
    f"{FORCE_NOISE_N:g} N a sample; people and conditions differ as in simulated studies of 8 "
    "participants and 60 trials of 2 s (slopes by 25 %, gain exponents by 0.04; cutoffs and "
    "skins of conditions by 5 %). A study in place of a design gives its own."
)


def assumed(response: ResponseName, candidates: Sequence[Candidate]) -> Assumptions:
    """Return what is assumed of a design that nobody has run.

    Scatters, deviations and differences are what `frictus discover` finds in simulated studies
    in which nothing is hidden, root mean squares over twelve:
    ``python -m tests.blind.null_studies``. Beyond those, people are alike.

    Parameters
    ----------
    response : {'friction', 'mobility'}
    candidates : sequence of Candidate
        Parameters of effects that are tried.
    """
    return Assumptions(
        scatter=ASSUMED_SCATTER[response],
        at=0.5 * np.sqrt(REFERENCE_S),
        deviation=np.array(ASSUMED_DEVIATION[response]),
        difference=np.array(
            [
                ASSUMED_DIFFERENCE[each.effect]
                for each in candidates
                if each.effect in RANDOM_EFFECTS
            ]
        ),
        spread=dict.fromkeys(candidates, 0.0),
        speed_wander=(0.004, 0.0125),
        force_wander=(0.03, 0.053),
        quiet_n2=FORCE_NOISE_N**2 * BAND_SHARE,
        source=ASSUMED_SOURCE,
    )


SOURCE = "Scatters and differences between people are those of this study."


@dataclass(slots=True)
class _Kept:
    """Whitens, and keeps how."""

    layouts: Sequence[Layout] = ()
    found: list[Whitening] = field(default_factory=list)

    def __call__(
        self, layouts: Sequence[Layout], raws: Sequence[UnwhitenedUnit]
    ) -> list[Whitening]:
        self.layouts, self.found = layouts, whiten(layouts, raws)
        return self.found


def estimated(
    problem: DiscoveryProblem, rows: EvidenceRows, strength: FloatArray
) -> Assumptions:
    """Return how the readings of a study scatter about its base model.

    Parameters
    ----------
    problem : DiscoveryProblem
        Data, base model and candidates.
    rows : EvidenceRows
        From which the subjects of the problem were made.
    strength : ndarray, shape (n_trials,)
        From `rows.strength`; 0 of trials without drive.
    """
    kept = _Kept()
    units = linearise(replace(problem, patterns=()), (), whiten=kept).units
    excess = excess_variance(project_out(units))
    spread = np.sqrt(np.maximum(excess, 0.0)).tolist()
    return Assumptions(
        scatter=_scatter(kept, rows.tones_hz),
        at=float(np.median(strength[strength > 0.0])),
        deviation=kept.found[0].deviation,
        difference=kept.found[0].difference,
        spread=dict(zip(problem.candidates, spread, strict=True)),
        speed_wander=_wander(rows.rows.circumstances.speed_mm_s, rows.target_mm_s, rows),
        force_wander=_wander(rows.rows.circumstances.normal_force_n, rows.target_n, rows),
        quiet_n2=float(np.median([subject.quiet_n2 for subject in problem.subjects])),
        source=SOURCE,
    )


def _scatter(kept: _Kept, tones_hz: FloatArray) -> dict[int, Grid]:
    part = np.concatenate([layout.part for layout in kept.layouts])
    weight = np.concatenate([whitening.weight for whitening in kept.found])
    best = np.concatenate([accuracy_of(layout) for layout in kept.layouts]) / 2.0
    found: dict[int, list[tuple[float, float]]] = {}
    for each in np.unique(part):
        own = part == each
        whole = 1.0 / float(weight[own].max())  # outliers weigh less than the others
        beyond = np.sqrt(max(whole**2 - float(best[own][0]) ** 2, SMALL**2))
        kind, tone = kinds(np.array([each]), tones_hz)
        found.setdefault(int(kind[0]), []).append((float(tone[0]), float(beyond)))
    contact = [scatter for _, scatter in found.get(TRIAL_SIZE, [])]
    if contact:
        found[TRIAL_SIZE] = [(float(tones_hz[0]), float(np.median(contact)))]
    return {kind: tuple(sorted(grid)) for kind, grid in found.items()}


def excess_variance(left: ProjectedUnits) -> FloatArray:
    """Return by how much more than noise explains the units' coefficients differ, (n_effects,).

    By moments, each weighed by what it tells (DerSimonian and Laird 1986): who tells little
    differs by noise most of all. By chance below zero where there is no such difference.

    Parameters
    ----------
    left : ProjectedUnits
        Whose information holds what is already known of how people differ.
    """
    weight = left.information
    whole, known = weight.sum(axis=0), weight > 0.0
    several = known.sum(axis=0) > 1
    total = np.where(several, whole, 1.0)
    apart = np.where(known, left.estimates - left.along.sum(axis=0) / total, 0.0)
    excess = (weight * np.square(apart)).sum(axis=0) - (known.sum(axis=0) - 1)
    free = np.where(several, total - np.square(weight).sum(axis=0) / total, 1.0)
    found: FloatArray = np.where(several, excess / free, 0.0)
    return found


def _wander(found: FloatArray, target: FloatArray, rows: EvidenceRows) -> tuple[float, float]:
    off = np.log(found / target[rows.trial])
    count = np.maximum(np.bincount(rows.trial, minlength=target.size), 1)
    mean = np.bincount(rows.trial, off, minlength=target.size) / count
    within = off - mean[rows.trial]
    several = count > 1
    return float(np.std(mean[several])), float(np.std(within[several[rows.trial]]))
