"""Seconds of a discovery: from raw samples, from kept observations, and how they grow."""

import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
from threadpoolctl import threadpool_limits

from frictus.model import Effect, Model
from frictus_hardware.physics.effects import EFFECTS
from frictus_hardware.physics.linear import Mount
from frictus_laboratory.benchmarks.figure import Figure, Target, interleaved
from frictus_laboratory.reproduction.plan import StudyConditions, plan_study
from frictus_laboratory.reproduction.population import draw_people
from frictus_laboratory.reproduction.simulate import STEPS, simulate_trial, study_info
from frictus_service.discovery.discover import discover, discover_study
from frictus_service.discovery.document import StudyFacts
from frictus_service.discovery.evidence.trial_evidence import TrialEvidence, study_evidence
from frictus_service.discovery.problem.base_models import base_model
from frictus_service.study.writer import StudyWriter

PEOPLE: Final = 8
DESIGN: Final = StudyConditions(
    (30.0, 91.3, 217.1, 487.9, 907.3, 1888.7),
    (20.0, 40.0, 60.0, 80.0, 100.0),
    (0.3, 0.5),
    seconds=1.0,
)
"""Sixty conditions, in each of which a person is measured once."""
BASE: Final = "constant-cutoff"
"""Criticised: there is a cause to find, as most studies have."""


def measure(
    people: int = PEOPLE, design: StudyConditions = DESIGN, repeats: int = 1
) -> list[Figure]:
    """Return seconds from raw samples and from the cache, and how the analysis grows.

    Parameters
    ----------
    people : int
        How many are simulated.
    design : StudyConditions
        Tones, speeds, forces and scatter.
    repeats : int
        Of what is done from kept observations.
    """
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        study, cache = Path(folder) / "study.h5", Path(folder) / "observations"
        trials = _write(study, people, design)

        def whole() -> float:
            return _seconds(lambda: discover_study(study, base=BASE, seed=1, cache=cache))

        raw_s = whole()
        (kept_s,) = interleaved(repeats, whole)
        evidence = study_evidence(study, cache=cache)
    what = f"{people} participants x {trials // people} trials of {design.seconds:g} s"
    return [
        Figure(
            "discovery_raw",
            "s",
            {"raw": raw_s},
            {"kept": kept_s},
            raw_s / kept_s,
            Target("raw", "at most", 60.0),
            f"a study of {what} with a cause to find, from its samples; ratio: over the same "
            "with kept observations",
        ),
        Figure(
            "discovery_kept",
            "s",
            {"kept": kept_s},
            target=Target("kept", "at most", 10.0),
            remark="the same study once its observations are kept",
        ),
        _growth(evidence, repeats),
    ]


def _write(path: Path, people: int, design: StudyConditions) -> int:
    """Write a simulated study, and return how many trials it has."""
    rng = np.random.default_rng(0)
    plans = plan_study(draw_people(people, rng), design, rng)
    with StudyWriter(path, study_info()) as writer:
        for plan in plans:
            writer.add(simulate_trial(plan), STEPS)
    return len(plans)


def _growth(evidence: Sequence[TrialEvidence], repeats: int) -> Figure:
    """Return how many times as long the analysis takes with twice as much of something."""
    base = base_model(BASE, "friction")
    once, people, trials, catalogue = interleaved(
        repeats,
        lambda: _analysis_s(evidence, _half_known(base)),
        lambda: _analysis_s(_twice(evidence, "-again"), _half_known(base)),
        lambda: _analysis_s(_twice(evidence), _half_known(base)),
        lambda: _analysis_s(evidence, base),
    )
    return Figure(
        "discovery_growth",
        "s",
        {"participants": people, "trials": trials, "catalogue": catalogue},
        {"once": once},
        max(people, trials, catalogue) / once,
        None,
        "analysis alone, with twice as many participants, trials of each, and causes, beside "
        "once with half of the catalogue; ratio: the largest over once",
    )


def _half_known(base: Model) -> Model:
    """Return the base with half of the other causes in it, at no dose: those are not tried."""
    others = [name for name in sorted(EFFECTS) if name != "speed_dependent_cutoff"]
    known = [
        Effect(id=name, parameters={EFFECTS[name].parameters[0].name: 0.0})
        for name in others[::2]
    ]
    return base.model_copy(update={"effects": known})


def _twice(evidence: Sequence[TrialEvidence], person: str = "") -> list[TrialEvidence]:
    """Return evidence and the same again, as other trials of people whose names end so."""
    again = []
    for one in evidence:
        info = one.observed.info
        renamed = replace(
            info, id=f"{info.id}-again", participant=f"{info.participant}{person}"
        )
        again.append(replace(one, observed=replace(one.observed, info=renamed)))
    return [*evidence, *again]


def _analysis_s(evidence: Sequence[TrialEvidence], base: Model) -> float:
    people = len({one.observed.info.participant for one in evidence})
    facts = StudyFacts(
        path="", sha256="", participants=people, trials=len(evidence), trials_used=0
    )

    def analyse() -> None:
        with threadpool_limits(limits=1):
            discover(evidence, facts, Mount().lateral, base, seed=1)

    return _seconds(analyse)


def _seconds(work: Callable[[], object]) -> float:
    begun = time.perf_counter()
    work()
    return time.perf_counter() - begun
