"""What a plan assumes of a design, found in simulated studies in which nothing is hidden.

`uv run python -m tests.blind.null_studies --studies 12` prints it, beside what
`discovery/plan/assumptions.py` says, and the standard errors that a design with those
assumptions promises, beside those that are found. Friction is that of the blind generator,
whose skins are the same in all conditions; skins are those of the simulated paper, which
differ between conditions, without their slopes.
"""

import argparse
import secrets
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

import numpy as np
from numpy.typing import NDArray
from tests.blind.generator import Case, Design, Seeds, make_study
from tests.blind.generator.plan import draw_forces, draw_speeds, draw_tones
from threadpoolctl import threadpool_limits

from frictus_hardware.physics.linear import Mount
from frictus_laboratory.reproduction.plan import StudyConditions, plan_study
from frictus_laboratory.reproduction.population import Plane, draw_people
from frictus_laboratory.reproduction.reproduce import record_study
from frictus_service.discovery.evidence.band_noise import resolved
from frictus_service.discovery.evidence.evidence_rows import subjects_of
from frictus_service.discovery.evidence.observation_table import (
    comparable,
    rows_of,
    units_of,
    used,
)
from frictus_service.discovery.evidence.trial_evidence import TrialEvidence, study_evidence
from frictus_service.discovery.inference.linear_model import ProjectedUnits, project_out
from frictus_service.discovery.inference.linearisation import linearise
from frictus_service.discovery.inference.significance import standard_error
from frictus_service.discovery.plan.ability import ability_of
from frictus_service.discovery.plan.assumptions import (
    Assumptions,
    assumed,
    excess_variance,
    interpolated,
)
from frictus_service.discovery.plan.documents import FactorialDesign, Setup
from frictus_service.discovery.plan.programme import Programme, programme_of
from frictus_service.discovery.plan.run import of_study
from frictus_service.discovery.problem.base_models import (
    ResponseName,
    base_model,
    simulator_of,
)
from frictus_service.discovery.problem.candidates import candidates_of
from frictus_service.discovery.problem.problem import DiscoveryProblem
from frictus_service.study.importers import open_study

FloatArray = NDArray[np.float64]
RESPONSES: Final[tuple[ResponseName, ...]] = ("friction", "mobility")


def setup_of(response: ResponseName) -> Setup:
    """Return base model, rig and candidates, as of a design."""
    mount = Mount().lateral
    base = simulator_of(base_model("paper", response), mount)
    return Setup(base, mount, response, tuple(candidates_of(response)))


@dataclass(frozen=True)
class NullStudy:
    """A simulated study without effects, and what discovery makes of it.

    Attributes
    ----------
    path : Path
        Of its file; observations are kept beside it.
    truth : Design
        Of the generator.
    evidence : list of TrialEvidence
        Of the trials that are used.
    seconds : dict of str to float
        Length of each trial, by id.
    setup : Setup
        Base model, rig and candidates.
    """

    path: Path
    truth: Design
    evidence: list[TrialEvidence]
    seconds: dict[str, float]
    setup: Setup

    @classmethod
    def of(cls, path: Path, truth: Design, response: ResponseName) -> "NullStudy":
        """Return what is in a study file."""
        with open_study(path) as study:
            seconds = {
                one.id: study.n_samples(one.id) / one.sample_rate_hz for one in study.trials
            }
        evidence = study_evidence(path, workers=0, cache=path.parent)
        trials = comparable(used(resolved(evidence, response)), response)
        return cls(path, truth, trials, seconds, setup_of(response))

    @property
    def design(self) -> FactorialDesign:
        """What the study was asked for."""
        infos = [one.observed.info for one in self.evidence]
        return FactorialDesign(
            participants=self.truth.participants,
            tones_hz=tuple(sorted({tone for info in infos for tone in info.tones_hz})),
            speeds_mm_s=tuple(sorted({info.speed_mm_s for info in infos})),
            forces_n=tuple(sorted({info.force_n for info in infos})),
            seconds=self.truth.seconds,
        )

    @cached_property
    def found(self) -> ProjectedUnits:
        """What discovery compares: each unit's coefficients, and how well each is known."""
        setup = self.setup
        units = units_of(self.evidence, setup.response)
        rows = rows_of(self.evidence, units, setup.response)
        subjects = tuple(subjects_of(rows, len(units.names)))
        problem = DiscoveryProblem(
            setup.base, setup.nominal_mount, setup.response, subjects, setup.candidates, ()
        )
        with threadpool_limits(limits=1):
            return project_out(linearise(problem, ()).units)

    @cached_property
    def as_design(self) -> tuple[Programme, Assumptions]:
        """The trials that were run, and what a plan takes from the study."""
        return of_study(self.evidence, self.seconds, self.setup)

    @property
    def found_error(self) -> FloatArray:
        """Standard errors of means over units, (n_candidates,); NaN where untested."""
        return standard_error(self.found.estimates, self.found.information)

    def promised_error(self, seed: int) -> FloatArray:
        """Return the standard errors that the design promises, (n_candidates,)."""
        programme = programme_of(self.design, np.random.default_rng(seed))
        known = assumed(self.setup.response, self.setup.candidates)
        with threadpool_limits(limits=1):
            ability = ability_of(programme, self.setup, known, seed)
        assert ability is not None
        return ability.standard_error


def make(path: Path, truth: Design, response: ResponseName, seed: int) -> None:
    """Write a study whose friction, or whose skins, are as people's are taken to be."""
    path.parent.mkdir(parents=True)
    if response == "friction":
        make_study(path, Case("null", (), truth), Seeds(seed, seed + 1))
        return
    rng = np.random.default_rng(seed)
    conditions = StudyConditions(
        draw_tones(truth, rng),
        draw_speeds(truth, rng),
        draw_forces(truth, rng),
        seconds=truth.seconds,
    )
    people = [
        replace(one, planes={name: Plane(own.middle) for name, own in one.planes.items()})
        for one in draw_people(truth.participants, rng)
    ]
    record_study(path, plan_study(people, conditions, rng))


def root_mean_square(each: FloatArray) -> FloatArray:
    """Return the root of the mean of squares over studies; NaN is left out."""
    known = np.isfinite(each)
    count = known.sum(axis=0)
    total = np.square(np.where(known, each, 0.0)).sum(axis=0)
    found: FloatArray = np.sqrt(np.where(count > 0, total / np.maximum(count, 1), np.nan))
    return found


def report(studies: Sequence[NullStudy], seed: int) -> Iterator[str]:
    """Yield the lines on studies of one response."""
    setup = studies[0].setup
    names = [each.effect for each in setup.candidates]
    said = assumed(setup.response, setup.candidates)
    found = [study.as_design[1] for study in studies]
    yield f"{setup.response}: {len(studies)} studies, seed {seed}; found, and (assumed)"
    for what in ("deviation", "difference"):
        values = root_mean_square(np.array([getattr(each, what) for each in found]))
        yield f"  {what}: " + ", ".join(
            f"{value:.3g} ({known:.3g})"
            for value, known in zip(values, getattr(said, what), strict=True)
        )
    for what in ("speed_wander", "force_wander", "quiet_n2"):
        values = root_mean_square(np.array([getattr(each, what) for each in found]))
        yield f"  {what}: {values} ({getattr(said, what)})"
    for kind in sorted({kind for each in found for kind in each.scatter}):
        tone, scatter = np.array(
            sorted(pair for each in found for pair in each.scatter.get(kind, ()))
        ).T
        known = interpolated(said.scatter[kind], tone)
        yield f"  scatter of kind {kind}: " + ", ".join(
            f"{root_mean_square(scatter[near]):.2g} at {np.exp(np.log(tone[near]).mean()):.0f} "
            f"Hz ({root_mean_square(known[near]):.2g})"
            for near in np.array_split(np.arange(tone.size), min(5, tone.size))
        )
    excess = np.mean([excess_variance(study.found) for study in studies], axis=0)
    errors = np.array([study.found_error for study in studies])
    promised = np.array([study.promised_error(seed) for study in studies])
    both = np.where(np.isfinite(errors) & np.isfinite(promised), 1.0, np.nan)
    ratio = root_mean_square(promised * both) / root_mean_square(errors * both)
    yield "  effect: promised over found standard error; spread beyond difference (assumed)"
    for k, name in enumerate(names):
        spread = np.sqrt(max(excess[k], 0.0))
        yield (
            f"    {name} {ratio[k]:.2f}; {spread:.2g} ({said.spread[setup.candidates[k]]:.2g})"
        )


def main() -> None:
    """Make the studies, and print what they say."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--studies", type=int, default=6)
    parser.add_argument("--participants", type=int, default=8)
    parser.add_argument("--response", nargs="+", choices=RESPONSES, default=RESPONSES)
    parser.add_argument("--seed", type=int, default=secrets.randbits(31))
    parser.add_argument("--folder", type=Path, help="keeps studies; those there are not made")
    arguments = parser.parse_args()
    truth = Design(participants=arguments.participants)
    with TemporaryDirectory() as fresh:
        folder = arguments.folder or Path(fresh)
        for response in arguments.response:
            studies = []
            for number in range(arguments.studies):
                seed = arguments.seed + 2 * number
                path = folder / f"{response}_{seed}" / "null.h5"
                if not path.exists():
                    make(path, truth, response, seed)
                studies.append(NullStudy.of(path, truth, response))
            for line in report(studies, arguments.seed):
                sys.stdout.write(line + "\n")
                sys.stdout.flush()


if __name__ == "__main__":
    main()
