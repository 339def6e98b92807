"""From the trials of units to the rows that they will give, as far as it can be told before."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.schedule import REFERENCE_POSITION_MM, SlidingConditions
from frictus_hardware.physics.simulator import Probe
from frictus_service.discovery.evidence.background import LEAST_LOW_S, lines_of
from frictus_service.discovery.evidence.evidence_rows import EvidenceRows, subjects_of
from frictus_service.discovery.evidence.observation_table import LEAST_UNITS, blocks_of, dealt
from frictus_service.discovery.evidence.residuals import Compared, Layout, accuracy_of
from frictus_service.discovery.inference.covariance import Whitening
from frictus_service.discovery.inference.linear_model import Unit
from frictus_service.discovery.inference.linearisation import linearise
from frictus_service.discovery.plan.assumptions import Assumptions
from frictus_service.discovery.plan.documents import Setup
from frictus_service.discovery.plan.programme import (
    PlannedTrial,
    Programme,
    StrokeThird,
    stretches_of,
    tones_in,
)
from frictus_service.discovery.problem.base_models import NUISANCE
from frictus_service.discovery.problem.problem import DiscoveryProblem, UnwhitenedUnit
from frictus_service.errors import DesignError


def units_of_people(programme: Programme) -> list[tuple[PlannedTrial, ...]]:
    """Return the trials of each unit: people, or where there are too few, blocks of trials.

    Parameters
    ----------
    programme : Programme
        All trials of everybody, in order.
    """
    people = list(programme.people)
    if programme.participants >= LEAST_UNITS:
        return people
    blocks = blocks_of([sum(bool(trial.tones_hz) for trial in trials) for trials in people])
    if not any(blocks):
        return people
    units = []
    for trials, count in zip(people, blocks, strict=True):
        if count:
            block = dealt([trial.tones_hz for trial in trials], count)
            units += [
                tuple(trial for trial, of in zip(trials, block, strict=True) if of == k)
                for k in range(count)
            ]
    return units


@dataclass(frozen=True, slots=True)
class ExpectedUnits:
    """Units, how each was whitened, and how accurate its readings are at best, (n,)."""

    units: tuple[Unit, ...]
    whitenings: tuple[Whitening, ...]
    accuracies: tuple[FloatArray, ...]


def expected(
    programme: Programme,
    setup: Setup,
    assumptions: Assumptions,
    rng: np.random.Generator | None,
) -> ExpectedUnits:
    """Return the units of those who stand in a programme; all readings are zero.

    Parameters
    ----------
    programme : Programme
        All trials of everybody, in order.
    setup : Setup
        Base model, rig and candidates.
    assumptions : Assumptions
        How readings scatter and people differ.
    rng : numpy.random.Generator or None
        Of how fingers wander about their targets; None: they do not.

    Raises
    ------
    DesignError
        If no tone of any trial can be measured.
    """
    trials = units_of_people(programme)
    rows = rows_of_trials(trials, programme.span_mm, setup, assumptions, rng)

    def known(layouts: Sequence[Layout], raws: Sequence[UnwhitenedUnit]) -> list[Whitening]:
        return [
            Whitening.of(
                raw,
                1.0 / assumptions.scatters(layout, rows.tones_hz, strength(own)),
                assumptions.deviation,
                assumptions.difference,
            )
            for layout, raw, own in zip(layouts, raws, trials, strict=True)
        ]

    subjects = subjects_of(rows, len(trials))
    problem = DiscoveryProblem(
        setup.base,
        setup.nominal_mount,
        setup.response,
        tuple(subjects),
        setup.candidates,
        (),
    )
    # What the base predicts is what will be measured: the units stand about it as they are.
    own = np.zeros(len(NUISANCE[setup.response]))
    met = [
        replace(each, measured=problem.predicted(each, own, (), np.zeros(0)))
        for each in subjects
    ]
    model = linearise(replace(problem, subjects=tuple(met)), (), whiten=known)
    accuracies = tuple(accuracy_of(each.layout) for each in subjects)
    return ExpectedUnits(model.units, model.whitenings, accuracies)


FULL_VPP: Final = 150.0
"""At which the drive reaches a fraction of one; friction follows the square."""


@dataclass(frozen=True, slots=True)
class _Cells:
    """Trials, their stretches, and the tones of those: a row each."""

    trials: list[PlannedTrial]
    stretches: list[StrokeThird]
    by_tone: list[tuple[int, float]]


def rows_of_trials(
    units: Sequence[Sequence[PlannedTrial]],
    span_mm: float,
    setup: Setup,
    assumptions: Assumptions,
    rng: np.random.Generator | None,
) -> EvidenceRows:
    """Return the rows; measured is 0, or NaN where nothing can be.

    Parameters
    ----------
    units : sequence of sequence of PlannedTrial
        Trials of each unit.
    span_mm : float
        Length of a stroke.
    setup : Setup
        Base model, rig and candidates.
    assumptions : Assumptions
        How readings scatter and people differ.
    rng : numpy.random.Generator or None
        Of how fingers wander about their targets; None: they do not.

    Raises
    ------
    DesignError
        If no tone of any trial can be measured.
    """
    trials = [trial for unit in units for trial in unit]
    stretches = stretches_of(trials, span_mm)
    cells = _Cells(trials, stretches, tones_in(trials, stretches, setup.sample_rate_hz))
    if not cells.by_tone:
        raise DesignError(
            "no third of a stroke is long enough for its tones; accepted: three periods of the "
            "lowest tone at least. Move slower, over more millimetres, or play higher tones."
        )
    tones_hz, tone = np.unique([hz for _, hz in cells.by_tone], return_inverse=True)
    targets = np.array([(trial.speed_mm_s, trial.force_n) for trial in trials])
    return EvidenceRows(
        unit_of_trial=np.repeat(np.arange(len(units)), [len(unit) for unit in units]),
        condition_of_trial=np.unique(targets, axis=0, return_inverse=True)[1].ravel(),
        target_mm_s=targets[:, 0],
        target_n=targets[:, 1],
        trial=np.array([stretches[place].trial for place, _ in cells.by_tone]),
        tone=tone.ravel().astype(np.int64),
        tones_hz=tones_hz,
        rows=_at_rows(cells, assumptions, rng),
        trials=_at_trials(trials),
        measured=_seen(cells, setup, assumptions),
        variance=np.full(tone.size, np.nan),
    )


def amplitude(trial: PlannedTrial) -> float:
    """Return the amplitude of the drive fraction at each tone of a trial; 0 of a blank one.

    Parameters
    ----------
    trial : PlannedTrial
        Tones, speed, force and drive.
    """
    if not trial.tones_hz:
        return 0.0
    return 0.5 * (trial.drive_vpp / FULL_VPP) ** 2 / len(trial.tones_hz)


def strength(trials: Sequence[PlannedTrial]) -> FloatArray:
    """Return what the noise of trials falls with: amplitude times root of the seconds.

    Parameters
    ----------
    trials : sequence of PlannedTrial
        In order.
    """
    return np.array([amplitude(trial) * np.sqrt(trial.seconds) for trial in trials])


def _at_rows(cells: _Cells, assumptions: Assumptions, rng: np.random.Generator | None) -> Probe:
    place = np.array([place for place, _ in cells.by_tone])
    of = np.array([stretch.trial for stretch in cells.stretches])
    trial = of[place]
    message = np.array([amplitude(each) for each in cells.trials])
    count = np.array([len(each.tones_hz) for each in cells.trials])
    speed = np.array([each.speed_mm_s for each in cells.trials])[of]
    force = np.array([each.force_n for each in cells.trials])[of]
    if rng is not None:
        speed = speed * _wander(of, len(cells.trials), assumptions.speed_wander, rng)
        force = force * _wander(of, len(cells.trials), assumptions.force_wander, rng)
    return Probe(
        tone_hz=np.array([hz for _, hz in cells.by_tone]),
        message=message[trial].astype(np.complex128),
        message_mean=(message * count)[trial],
        message_power=(np.square(message) * count / 2.0)[trial],
        circumstances=SlidingConditions(
            speed[place],
            force[place],
            np.array([each.position_mm for each in cells.stretches])[place],
            np.array([each.direction for each in cells.stretches], dtype=np.float64)[place],
            np.array([each.minutes for each in cells.trials])[trial],
        ),
    )


def _wander(
    trial: NDArray[np.int64], n_trials: int, size: tuple[float, float], rng: np.random.Generator
) -> FloatArray:
    """Return what each stretch has over its target: of its trial, and of its own."""
    of_trial, within = size
    whole = rng.normal(0.0, of_trial, n_trials)[trial]
    return np.exp(whole + rng.normal(0.0, within, trial.size))


def _at_trials(trials: Sequence[PlannedTrial]) -> Probe:
    nothing = np.zeros(len(trials))
    around = SlidingConditions(
        np.array([trial.speed_mm_s for trial in trials]),
        np.array([trial.force_n for trial in trials]),
        nothing + REFERENCE_POSITION_MM,
        nothing,
        np.array([trial.minutes for trial in trials]),
    )
    return Probe(nothing + 100.0, nothing.astype(np.complex128), nothing, nothing, around)


def _seen(cells: _Cells, setup: Setup, assumptions: Assumptions) -> Compared:
    """Return 0 where something will be measured (the quiet power), NaN where nothing can be."""
    lines = [
        lines_of(each.tones_hz, setup.carrier_hz, setup.sample_rate_hz) for each in cells.trials
    ]
    longest = np.zeros(len(lines))
    for stretch in cells.stretches:
        longest[stretch.trial] = max(longest[stretch.trial], stretch.seconds)
    least_s = np.array([each.tones.least_s for each in lines])
    enough = (longest >= least_s) & (setup.response == "friction")
    harmonic = np.full((2, len(cells.by_tone)), np.nan)
    for row, (place, hz) in enumerate(cells.by_tone):
        trial = cells.stretches[place].trial
        at = cells.trials[trial].tones_hz.index(hz)
        there = [enough[trial] and places[at] >= 0 for places in lines[trial].harmonics]
        harmonic[there, row] = 0.0
    mains = np.array([[place >= 0 for place in each.mains] for each in lines])
    line50, line60 = np.where(enough[:, np.newaxis] & mains, 0.0, np.nan).T
    low = np.where(enough & (longest >= LEAST_LOW_S), np.log(assumptions.quiet_n2), np.nan)
    nothing = np.zeros(len(cells.by_tone))
    second, third = (np.column_stack([each, each]) for each in harmonic)
    return Compared(nothing, nothing, second, third, line50, line60, low)
