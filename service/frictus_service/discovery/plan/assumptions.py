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
from frictus_service.discovery.problem.base_models import ResponseName
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
        Of the conditions, as `whitening` has them.
    spread : mapping of Candidate to float
        Standard deviation of an effect's coefficient between people.
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
            grid = np.array(self.scatter.get(int(each), self.scatter[PHASE]))
            known = np.exp(np.interp(np.log(tone[own]), np.log(grid[:, 0]), np.log(grid[:, 1])))
            found[own] = known
        weaker = self.at / np.maximum(strength, 1e-6)[trials_of(layout)]
        found = np.where(np.isin(kind, OF_NOISE), found * weaker, found)
        scatter: FloatArray = np.hypot(found, accuracy_of(layout) / 2.0)
        return scatter


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

ASSUMED_SCATTER: Final[Mapping[int, Grid]] = {
    TRIAL_SIZE: ((ANY, WithinPersonScatter().gain_per_trial),),
    TONE_SIZE: ((ANY, 0.001),),
    PHASE: ((800.0, 0.0008), (1700.0, 0.0014)),
    STRETCH_SIZE: ((800.0, 0.001), (1700.0, 0.002)),
    STRETCH_PHASE: ((800.0, 0.0008), (1700.0, 0.0012)),
    **dict.fromkeys(SECOND, ((30.0, 7e-5), (800.0, 7e-5), (1700.0, 5e-4))),
    **dict.fromkeys(THIRD, ((30.0, 7e-5), (800.0, 7e-5), (1700.0, 1.2e-3))),
    **dict.fromkeys(LINES, ((ANY, SMALL),)),
    LOW: ((ANY, 0.2),),
}
ASSUMED_DEVIATION: Final[dict[ResponseName, tuple[float, ...]]] = {
    "friction": (0.04, 0.12),
    "mobility": (0.035, 0.01, 0.01),
}
ASSUMED_SPREAD: Final[dict[ResponseName, dict[str, float]]] = {
    "friction": {
        "speed_dependent_cutoff": 3.4,
        "force_dependent_cutoff": 0.027,
        "speed_dependent_gain": 0.04,
        "force_dependent_gain": 0.035,
        "gain_drift": 0.003,
        "fractional_rolloff": 0.008,
        "channel_delay": 5e-7,
        "mount_resonance_shift": 1.5e-4,
        "charge_leakage": 0.012,
    },
    "mobility": {"speed_dependent_mass": 0.04},
}
"""By the first parameter. The last four are no differences between fingers: it is how people's
own slopes and exponents, which no law has, look through other effects."""
ASSUMED_SOURCE: Final = (
    "Scatters are assumed: contact made anew in each trial, 10 % of the gain; sensor noise "
    f"{FORCE_NOISE_N:g} N a sample; people and conditions differ as in simulated studies of 8 "
    "participants and 60 trials of 2 s (slopes by 25 %, cutoffs of conditions by 5 %, gain "
    "exponents by 0.04). A study in place of a design gives its own."
)


def assumed(response: ResponseName, candidates: Sequence[Candidate]) -> Assumptions:
    """Return what is assumed of a design that nobody has run.

    Scatters, deviations and spreads are what `frictus discover` finds in simulated studies
    without effects, averaged over several.

    Parameters
    ----------
    response : {'friction', 'mobility'}
    candidates : sequence of Candidate
        Parameters of effects that are tried.
    """
    spread = ASSUMED_SPREAD[response]
    scatter = dict(ASSUMED_SCATTER)
    if response == "mobility":
        scatter[TRIAL_SIZE] = scatter[PHASE]
    return Assumptions(
        scatter=scatter,
        at=0.5 * np.sqrt(REFERENCE_S),
        deviation=np.array(ASSUMED_DEVIATION[response]),
        spread={each: spread.get(each.effect, 0.0) for each in candidates},
        speed_wander=(0.004, 0.0125),
        force_wander=(0.03, 0.053),
        quiet_n2=FORCE_NOISE_N**2 * BAND_SHARE,
        source=ASSUMED_SOURCE,
    )


SOURCE = "Scatters and differences between people are those of this study."


@dataclass(slots=True)
class _Kept:
    """Whitens as if people did not differ, and keeps how."""

    layouts: Sequence[Layout] = ()
    raws: Sequence[UnwhitenedUnit] = ()
    found: list[Whitening] = field(default_factory=list)

    def __call__(
        self, layouts: Sequence[Layout], raws: Sequence[UnwhitenedUnit]
    ) -> list[Whitening]:
        self.layouts, self.raws = layouts, raws
        self.found = [
            replace(
                Whitening.of(raw, each.weight, each.deviation),
                random_coefficients=each.random_coefficients,
            )
            for raw, each in zip(raws, whiten(layouts, raws), strict=True)
        ]
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
    return Assumptions(
        scatter=_scatter(kept, rows.tones_hz),
        at=float(np.median(strength[strength > 0.0])),
        deviation=kept.found[0].deviation,
        spread=_spread(project_out(units), problem.candidates),
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


def _spread(left: ProjectedUnits, candidates: Sequence[Candidate]) -> dict[Candidate, float]:
    """Return by how much the units' coefficients differ more than their noise explains.

    By moments, each weighed by what it tells (DerSimonian and Laird 1986): who tells little
    differs by noise most of all.
    """
    weight = left.information
    whole, known = weight.sum(axis=0), weight > 0.0
    several = known.sum(axis=0) > 1
    total = np.where(several, whole, 1.0)
    apart = np.where(known, left.estimates - left.along.sum(axis=0) / total, 0.0)
    excess = (weight * np.square(apart)).sum(axis=0) - (known.sum(axis=0) - 1)
    free = np.where(several, total - np.square(weight).sum(axis=0) / total, 1.0)
    spread = np.sqrt(np.where(several, np.maximum(excess, 0.0) / free, 0.0))
    return dict(zip(candidates, spread.tolist(), strict=True))


def _wander(found: FloatArray, target: FloatArray, rows: EvidenceRows) -> tuple[float, float]:
    off = np.log(found / target[rows.trial])
    count = np.maximum(np.bincount(rows.trial, minlength=target.size), 1)
    mean = np.bincount(rows.trial, off, minlength=target.size) / count
    within = off - mean[rows.trial]
    several = count > 1
    return float(np.std(mean[several])), float(np.std(within[several[rows.trial]]))
