"""Whether intervals hold the truth and nulls stay nulls, over many small simulated studies."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from frictus_laboratory.reproduction.comparison import compare
from frictus_laboratory.reproduction.paper import Row
from frictus_laboratory.reproduction.plan import StudyConditions, plan_study
from frictus_laboratory.reproduction.population import POPULATION, Person, draw_people
from frictus_laboratory.reproduction.simulate import simulate_trial, study_info
from frictus_service.identification.analysis import identify
from frictus_service.identification.documents import ParticipantResult, Settings
from frictus_service.identification.observation.observe import observe
from frictus_service.identification.pipeline.workers import Crash, WorkerError, work_through

PEOPLE: Final = 8
SMALL: Final = StudyConditions(
    tones_hz=(40.0, 80.0, 150.0, 300.0, 500.0, 750.0, 2000.0),
    speeds_mm_s=(20.0, 60.0, 100.0),
    forces_n=(0.3, 0.5),
    seconds=1.2,
)
"""Six tones lie where the mobility is fitted, five of which it needs: one trial may be lost.
Mean speed and force are the population's."""

UNCOUNTED: Final = ("s", "r")
"""Units of what is not counted: correlations, whose truth is the study's own; and the delay,
which is the rig's, of one value for all: it comes out to 0.05 us, and the twin in its steps of
12.5 us is itself 0.1 us late."""

MEANS: Final = Person("population", {name: spread.mean for name, spread in POPULATION.items()})
"""The truth for people who are drawn freely."""


@dataclass(frozen=True, slots=True)
class CoverageCount:
    """One quantity over many studies.

    Attributes
    ----------
    quantity : str
        As people read it.
    tested : bool
        Whether it is an effect, which may be significant.
    null : bool
        Whether it is one and the truth is that there is none.
    studies, covered, significant : int
        How many studies told it; held the truth in the 95 % interval; had p below 0.05.
    bias : float
        Mean of estimate less truth over the standard deviation of the estimates.
    """

    quantity: str
    tested: bool
    null: bool
    studies: int
    covered: int
    significant: int
    bias: float

    @property
    def coverage(self) -> float:
        """Share of studies whose interval held the truth."""
        return self.covered / self.studies

    @property
    def rejected(self) -> float:
        """Share of studies in which it was significant."""
        return self.significant / self.studies


@dataclass(frozen=True, slots=True)
class Said:
    """What one study says.

    Attributes
    ----------
    population : list of Row
        Means and effects across people.
    people : list of Row
        Each person's own parameters.
    """

    population: list[Row]
    people: list[Row]


def run_study(seed: int, participants: int = PEOPLE, design: StudyConditions = SMALL) -> Said:
    """Return what one small study of freely drawn people says, from raw samples on.

    Parameters
    ----------
    seed : int
        Of everything random; the same seed gives the same result.
    participants : int
        How many.
    design : StudyConditions
        Tones, speeds, forces and scatter.
    """
    rng = np.random.default_rng(seed)
    people = draw_people(participants, rng)
    plans = plan_study(people, design, rng)
    observations = [observe(simulate_trial(plan), study_info()) for plan in plans]
    found = identify(observations, settings=Settings(mixed_models=False, sweeps=False))
    rows = compare(found, [MEANS], plans)
    own = zip(found.participants, people, strict=True)
    return Said(
        [row for row in rows if row.unit not in UNCOUNTED],
        [row for result, person in own for row in _own_rows(result, person)],
    )


def _own_rows(result: ParticipantResult, person: Person) -> list[Row]:
    planes = person.planes
    cutoff = planes["cutoff_hz"]
    truth = {
        "gain_n": planes["gain_n"].middle,
        "cutoff_0_hz": cutoff.at(0.0),
        "slope_hz_per_mm_s": cutoff.per_mm_s,
        "mass_kg": planes["mass_kg"].middle,
        "damping_n_s_m": planes["damping_n_s_m"].middle,
        "stiffness_n_m": planes["stiffness_n_m"].middle,
    }
    parts = (result.friction and result.friction.law, result.mobility)
    found = {
        name: getattr(part, name)
        for part in parts
        for name in truth
        if part is not None and hasattr(part, name)
    }
    return [
        Row(name, "", "", truth[name], estimate.value, estimate.ci95)
        for name, estimate in found.items()
    ]


def run_studies(
    seed: int, studies: int, workers: int, tell: Callable[[str], None]
) -> list[Said]:
    """Return what many small studies say.

    Parameters
    ----------
    seed : int
        Each study has its own, drawn from this one.
    studies : int
        How many.
    workers : int
        Processes to spawn; at least 1.
    tell : callable
        Told of progress, a line at a time.

    Raises
    ------
    WorkerError
        If workers do not start, or fail.
    """
    seeds = [int(each) for each in np.random.default_rng(seed).integers(2**63, size=studies)]
    done = []
    for number, outcome in work_through(run_study, seeds, workers, tell):
        if isinstance(outcome, Crash):
            raise WorkerError(f"the study of seed {seeds[number]} ended its workers")
        done.append(outcome)
        if len(done) % 10 == 0:
            so_far = summary(tally(said.population for said in done))
            tell(f"{len(done)} of {studies} studies; {so_far}")
    return done


def tally(studies: Iterable[Sequence[Row]]) -> list[CoverageCount]:
    """Count what many studies said.

    Parameters
    ----------
    studies : iterable of sequence of Row
        What each study found.
    """
    told: dict[str, list[Row]] = {}
    for rows in studies:
        for row in rows:
            told.setdefault(row.quantity, []).append(row)
    return [_tally(quantity, rows) for quantity, rows in told.items()]


def _tally(quantity: str, rows: list[Row]) -> CoverageCount:
    errors = np.array([row.estimate - row.drawn for row in rows])
    spread = float(np.std(errors)) if len(rows) > 1 else np.inf
    return CoverageCount(
        quantity,
        tested=rows[0].p_value is not None,
        null=rows[0].p_value is not None and rows[0].drawn == 0.0,
        studies=len(rows),
        covered=sum(row.covers is True for row in rows),  # without an interval: not
        significant=sum(row.p_value is not None and row.p_value < 0.05 for row in rows),
        bias=float(np.mean(errors)) / spread,
    )


def pooled_coverage(tallies: Sequence[CoverageCount]) -> float:
    """Return the share of all intervals that held the truth."""
    return sum(each.covered for each in tallies) / sum(each.studies for each in tallies)


def pooled_rejection(tallies: Sequence[CoverageCount]) -> float:
    """Return the share of all tests of nulls that were significant."""
    nulls = [each for each in tallies if each.null]
    return sum(each.significant for each in nulls) / sum(each.studies for each in nulls)


def summary(tallies: Sequence[CoverageCount]) -> str:
    """Return one line."""
    return (
        f"95 % intervals hold the truth in {pooled_coverage(tallies):.1%}, "
        f"nulls are significant in {pooled_rejection(tallies):.1%}"
    )
