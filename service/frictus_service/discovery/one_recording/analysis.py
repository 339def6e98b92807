"""From the trials of a study that has too few for a test, to the ranking of one recording."""

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
from scipy import stats
from threadpoolctl import threadpool_limits

from frictus.model import Model
from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.effects import EFFECTS
from frictus_service.discovery.document import OneRecording, ParameterEstimate, RankedModel
from frictus_service.discovery.evidence.band_noise import resolved
from frictus_service.discovery.evidence.evidence_rows import EvidenceRows, subjects_of, take
from frictus_service.discovery.evidence.observation_table import (
    ResponseName,
    rows_of,
    says,
    used,
)
from frictus_service.discovery.evidence.trial_evidence import TrialEvidence
from frictus_service.discovery.inference.mode_shape import SHAPE
from frictus_service.discovery.one_recording.phrasing import statement_of
from frictus_service.discovery.one_recording.ranking import RULE, FittedModel, Ranking, rank
from frictus_service.discovery.one_recording.windows import (
    LEAST_APART_S,
    LEAST_FOLDS,
    LONG_S,
    MANY_S,
    SHORT_S,
    TIMES,
    SeenSamples,
    correlation_time_s,
    folds_of,
    windows_of,
)
from frictus_service.discovery.problem.base_models import simulator_of
from frictus_service.discovery.problem.candidates import candidates_of
from frictus_service.discovery.problem.problem import DiscoveryProblem
from frictus_service.identification.observation.observe import course_of
from frictus_service.identification.observation.validity import judge_signals
from frictus_service.study.importers import open_study
from frictus_service.study.layout import in_time
from frictus_service.study.trial import StudyInfo, Trial, TrialInfo

MOST_TRIALS: Final = 60
"""More make blocks that are tested."""
MOST_S: Final = 600.0
"""Of all trials together, that are held in memory."""
MOST_WINDOWS: Final = 150
MOST_MODELS: Final = 15
NEARLY: Final = 1.1
"""Times as fast as the base model's range a finger may be that was told to be within it."""


@dataclass(frozen=True, slots=True)
class Windows:
    """What a recording was cut into.

    Attributes
    ----------
    evidence : tuple of TrialEvidence
        Of each window that says something of the response, in time.
    seconds : float
        Of the trials together.
    length_s, apart_s, correlation_s : float
        Of a window; between two; of what is random in the friction.
    refused : tuple of str
        Trials that repeat others, one sentence each.
    unusable : tuple of str
        Trials whose signals may not be used, and windows, likewise.
    """

    evidence: tuple[TrialEvidence, ...]
    seconds: float
    length_s: float
    apart_s: float
    correlation_s: float
    refused: tuple[str, ...]
    unusable: tuple[str, ...]


def cut(trials: Iterable[Trial], study: StudyInfo, base: Model) -> Windows:
    """Cut trials into windows, apart by more than a correlation time; refuse copies.

    Parameters
    ----------
    trials : iterable of Trial
        Of one person, in time.
    study : StudyInfo
        What holds for all trials: carrier, peak voltage, mount.
    base : Model
        What is criticised, where it holds.
    """
    seen = SeenSamples()
    refused: list[str] = []
    unusable: list[str] = []
    kept: list[Trial] = []
    seconds = 0.0
    for trial in trials:
        repeated = seen.repeated(trial)
        reasons = judge_signals(trial, study)
        lasting = trial.force_n.shape[0] / trial.info.sample_rate_hz
        if repeated:
            refused.append(repeated)
        elif reasons:
            unusable.append(f"trial {trial.info.id} is not used: {reasons[0]}")
        elif seconds + lasting > MOST_S:
            unusable.append(f"trial {trial.info.id} is not used: {MOST_S:g} s are enough")
        else:
            kept.append(trial)
            seconds += lasting
    moving_s = sum(
        sweep.end_s - sweep.begin_s for trial in kept for sweep in course_of(trial).sweeps
    )
    length_s = LONG_S if moving_s > MANY_S else SHORT_S
    correlation_s = max((correlation_time_s(trial) for trial in kept), default=0.0)
    apart_s = max(TIMES * correlation_s, LEAST_APART_S)
    found = [one for trial in kept for one in windows_of(trial, study, length_s, apart_s)]
    found = [one for one in resolved(used(found), base.response) if says(one, base.response)]
    within = [one for one in found if _holds(base, one)]
    if len(within) < len(found):
        low, high = base.validity.speed_mm_s
        unusable.append(
            f"{len(found) - len(within)} of {len(found)} windows are not used: the finger was "
            f"slower than {low:g} or faster than {high:g} mm/s there, where the base model "
            "does not hold"
        )
    found = within
    every = max(1, -(-len(found) // MOST_WINDOWS))
    return Windows(
        tuple(found[::every]),
        seconds,
        length_s,
        apart_s,
        correlation_s,
        tuple(refused),
        tuple(unusable),
    )


def _holds(base: Model, window: TrialEvidence) -> bool:
    """Return whether the finger had speeds at which the base model holds, or nearly."""
    low, high = base.validity.speed_mm_s
    speed = window.observed.rows.speed_mm_s
    within = (speed >= low / NEARLY) & (speed <= NEARLY * high)
    return base.response == "mobility" or bool(within.all())


def ranked(windows: Windows, study: StudyInfo, base: Model) -> OneRecording:
    """Return what explains the windows of a recording best.

    Parameters
    ----------
    windows : Windows
        At least `LEAST_FOLDS`.
    study : StudyInfo
        Its mount is used.
    base : Model
        What is criticised.
    """
    folds = folds_of(windows.evidence, base.response)
    rows = _each_alone(rows_of(windows.evidence, folds, base.response))
    problem = DiscoveryProblem(
        simulator_of(base, study.mount),
        study.mount,
        base.response,
        tuple(subjects_of(rows, len(folds.names))),
        tuple(candidates_of(base.response, [effect.id for effect in base.effects])),
        (),
        base.validity.speed_mm_s,
        differing=frozenset(),
    )
    # Matrices are small: threads would wait for each other longer than they work.
    with threadpool_limits(limits=1):
        fold = rows.unit_of_trial[rows.trial]
        found = rank(problem, [rows.variance[fold == k] for k in range(len(folds.names))])
    models = tuple(_model(found, each) for each in found.models[:MOST_MODELS])
    beyond = found.margin > 0.0
    return OneRecording(
        statement=statement_of(models, beyond=beyond),
        beyond_threshold=beyond,
        margin=found.margin,
        threshold=RULE,
        models=models,
        searched=found.searched,
        silent=found.silent,
        participant=folds.participant[0],
        seconds=windows.seconds,
        windows=len(windows.evidence),
        folds=len(folds.names),
        window_s=windows.length_s,
        apart_s=windows.apart_s,
        correlation_s=windows.correlation_s,
        refused=windows.refused,
    )


def _each_alone(rows: EvidenceRows) -> EvidenceRows:
    """Return each row as a trial of its own, whose condition is its window.

    A window deviates by itself, as contacts do; beside that its rows have no more in common.
    The mean over the bands of a window of a grating is that of those that hold mostly noise.
    """
    window = rows.trial
    first = np.zeros(window.size, dtype=np.bool_)
    first[np.unique(window, return_index=True)[1]] = True

    def once(of_window: FloatArray) -> FloatArray:
        return np.where(first, of_window[window], np.nan)

    measured = rows.measured
    return replace(
        rows,
        unit_of_trial=rows.unit_of_trial[window],
        condition_of_trial=window,
        target_mm_s=rows.target_mm_s[window],
        target_n=rows.target_n[window],
        trial=np.arange(window.size),
        trials=take(rows.trials, window),
        measured=replace(
            measured,
            line50=once(measured.line50),
            line60=once(measured.line60),
            low=once(measured.low),
        ),
    )


def _model(found: Ranking, fitted: FittedModel) -> RankedModel:
    """Return a model as the document holds it."""
    parameters: dict[str, dict[str, ParameterEstimate]] = {}
    quantile = float(stats.t.ppf(0.975, fitted.gain.size - 1))
    for place, k in enumerate(fitted.candidates):
        each = found.candidates[k]
        units = {p.name: p.unit for p in EFFECTS[each.effect].parameters}
        allowed = {p.name: (p.low, p.high) for p in EFFECTS[each.effect].parameters}
        value = fitted.coefficients[place]
        half = quantile * fitted.standard_errors[place]
        ends = np.array([value - half, value, value + half])
        ends = np.maximum(ends, 0.0) if each.positive else ends
        low, mean, high = (np.sqrt(ends) if each.squared else ends).tolist()
        parameters[each.effect] = {
            each.parameter: ParameterEstimate(
                value=mean, ci95=(low, high), unit=units[each.parameter]
            )
        }
        for name, held in each.held:
            estimate = ParameterEstimate(value=held, ci95=None, unit=units[name])
            if fitted.shape is not None and name in SHAPE:
                at = SHAPE.index(name)
                error = quantile * float(fitted.shape.standard_errors[at])
                log = float(np.log(held) + fitted.shape.off[at])
                ends = np.clip([log - error, log, log + error], *np.log(allowed[name]))
                low, mean, high = np.exp(ends).tolist()
                # A mode of no share is at no frequency.
                ci95 = (low, high) if error > 0.0 else None
                estimate = ParameterEstimate(value=mean, ci95=ci95, unit=units[name])
            parameters[each.effect][name] = estimate
    return RankedModel(
        causes=tuple(parameters),
        parameters=parameters,
        heldout_loglik=fitted.total,
        explained=fitted.explained,
        standard_error=fitted.standard_error,
        aic=fitted.aic,
    )


def rank_recording(
    path: Path | str, base: Model, tell: Callable[[str], None], late_s: float = 0.0
) -> tuple[OneRecording | None, tuple[str, ...]]:
    """Return what ranks first in the recording of one person, and what to know of it.

    Of the person who has most trials, in a study that has too few for a test.

    Parameters
    ----------
    path : Path or str
        A study file.
    base : Model
        What is criticised.
    tell : callable
        Told what is done.
    late_s : float
        By which the touch sensor was found late: positions are taken so much earlier.

    Returns
    -------
    OneRecording or None
        None where it holds too little for folds.
    tuple of str
        Notes: why, and what was left out.

    Raises
    ------
    StudyError
        If the study cannot be read.
    """
    tell("ranking what explains one recording")
    notes = []
    with open_study(path) as study:
        person, asked = _most_recorded(study.trials)
        if len(asked) < len(study.trials):
            notes.append(
                f"One recording: {len(asked)} of {len(study.trials)} trials are looked at: "
                f"those of {person}, who has most, and no more than {MOST_TRIALS}."
            )
        info = study.info
        trials = (in_time(study.read(trial.id), late_s) for trial in asked)
        windows = cut(trials, info, base)
    notes += [f"Not independent: {each}." for each in windows.refused]
    notes += [f"One recording: {each}." for each in windows.unusable]
    if len(windows.evidence) < LEAST_FOLDS:
        return None, (*notes, _too_little(windows, base.response))
    return ranked(windows, info, base), tuple(notes)


def _most_recorded(trials: Sequence[TrialInfo]) -> tuple[str, list[TrialInfo]]:
    counted = Counter(trial.participant for trial in trials)
    person = max(sorted(counted), key=lambda name: counted[name], default="")
    own = [trial for trial in trials if trial.participant == person]
    own.sort(key=lambda trial: (trial.session, trial.order, trial.id))
    return person, own[:MOST_TRIALS]


def _too_little(windows: Windows, response: ResponseName) -> str:
    lacking = {
        "friction": "a drive (voltage_v) and a force",
        "mobility": "a force and the skin's acceleration or velocity",
    }[response]
    other = "mobility" if response == "friction" else "friction"
    return (
        f"No ranking of one recording: {len(windows.evidence)} windows of "
        f"{windows.length_s:g} s say something of the {response} response; accepted: "
        f"{LEAST_FOLDS} at least, which needs {LEAST_FOLDS * windows.length_s:.1f} s of steady "
        f"sliding with {lacking}, coherent with each other. Record longer, or ask for "
        f"--response {other}."
    )
