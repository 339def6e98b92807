"""How readings scatter and people differ, estimated from a study that was run."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_service.discovery.evidence.evidence_rows import EvidenceRows
from frictus_service.discovery.evidence.residuals import TRIAL_SIZE, Layout, accuracy_of
from frictus_service.discovery.inference.covariance import Whitening, whiten
from frictus_service.discovery.inference.linear_model import ProjectedUnits, project_out
from frictus_service.discovery.inference.linearisation import linearise
from frictus_service.discovery.plan.assumptions import SMALL, Assumptions, Grid, kinds
from frictus_service.discovery.problem.candidates import Candidate
from frictus_service.discovery.problem.problem import DiscoveryProblem, UnwhitenedUnit

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
    """Return by how much the units' coefficients differ more than their noise explains."""
    with np.errstate(divide="ignore", invalid="ignore"):
        noise = np.mean(1.0 / left.information, axis=0)
        variance = np.var(left.estimates, axis=0, ddof=1) - noise
    spread = np.sqrt(np.maximum(np.nan_to_num(variance), 0.0))
    return dict(zip(candidates, spread.tolist(), strict=True))


def _wander(found: FloatArray, target: FloatArray, rows: EvidenceRows) -> tuple[float, float]:
    off = np.log(found / target[rows.trial])
    count = np.maximum(np.bincount(rows.trial, minlength=target.size), 1)
    mean = np.bincount(rows.trial, off, minlength=target.size) / count
    within = off - mean[rows.trial]
    several = count > 1
    return float(np.std(mean[several])), float(np.std(within[several[rows.trial]]))
