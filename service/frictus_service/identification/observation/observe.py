"""From one trial to its observations, and why trials are left out."""

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from frictus_hardware.arrays import FloatArray
from frictus_service.identification.observation.blocks import BLOCK
from frictus_service.identification.observation.images import without_images
from frictus_service.identification.observation.response import TrialObservations, rows_of
from frictus_service.identification.observation.sweeps import (
    Sweep,
    SweepThird,
    TouchMotion,
    cut_thirds,
    find_sweeps,
    smooth,
)
from frictus_service.identification.observation.validity import Means, judge
from frictus_service.study.trial import StudyInfo, Trial

NO_SKIN = "nothing measures the skin: there is no mobility"
PRESSED_SHARE = 0.25
"""The finger is on the screen where it presses with this share of its median force."""


@dataclass(frozen=True, slots=True)
class FingerTrajectory:
    """How the finger moved and pressed in a trial.

    Attributes
    ----------
    motion : TouchMotion
        Position and velocity at the reports.
    normal_n : ndarray, shape (n_blocks,)
        Mean normal force of each block of samples; NaN where one is missing.
    sweeps : list of Sweep
        Steady movements, in time.
    segments : list of SweepThird
        Thirds of the sweeps.
    """

    motion: TouchMotion
    normal_n: FloatArray
    sweeps: list[Sweep]
    segments: list[SweepThird]


def course_of(trial: Trial) -> FingerTrajectory:
    """Return how the finger moved and pressed.

    Parameters
    ----------
    trial : Trial
        As it was recorded.
    """
    motion = smooth(trial.position_mm, trial.position_t_s)
    normal_n = _normal_force(trial)
    sweeps = find_sweeps(motion, _pressed(motion, normal_n, trial.info.sample_rate_hz))
    return FingerTrajectory(motion, normal_n, sweeps, cut_thirds(motion, sweeps))


def observe(trial: Trial, study: StudyInfo) -> TrialObservations:
    """Return what a trial says: sweeps, responses, and whether it may be used.

    Parameters
    ----------
    trial : Trial
        As it was recorded.
    study : StudyInfo
        Its mount and its screen voltage are used.
    """
    return observe_along(course_of(trial), trial, study)


def observe_along(
    course: FingerTrajectory, trial: Trial, study: StudyInfo
) -> TrialObservations:
    """Return the observations of a trial whose course is known.

    Parameters
    ----------
    course : FingerTrajectory
        From `course_of`.
    trial : Trial
        As it was recorded.
    study : StudyInfo
        What holds for all trials: carrier, peak voltage, mount.
    """
    motion, normal_n, sweeps = course.motion, course.normal_n, course.sweeps
    means = _means(course.segments, normal_n, trial.info.sample_rate_hz)
    rows, left_out = rows_of(trial, study, course.segments, normal_n)
    rows = without_images(rows, trial, study)
    reasons = judge(trial, study, motion, sweeps, means)
    return TrialObservations(
        info=trial.info,
        sha256=trial.sha256,
        valid=not reasons,
        reasons=reasons,
        notes=(*_gaps(trial, motion), *left_out),
        mean_speed_mm_s=means.speed_mm_s,
        mean_force_n=means.force_n,
        rows=rows,
        measured_sha256=trial.measured_sha256,
    )


def _normal_force(trial: Trial) -> FloatArray:
    """Return the mean normal force of each block of samples; NaN where one is missing."""
    blocks = trial.force_n.shape[0] // BLOCK
    into = trial.force_n[: blocks * BLOCK, 2].reshape(blocks, BLOCK)
    mean: FloatArray = into.mean(axis=1)
    return mean


def _pressed(motion: TouchMotion, normal_n: FloatArray, rate_hz: float) -> NDArray[np.bool_]:
    """Return whether the finger is on the screen at each report."""
    measured = normal_n[np.isfinite(normal_n)]
    if not measured.size:
        return np.zeros(motion.time_s.size, dtype=np.bool_)
    block = (motion.time_s * rate_hz / BLOCK).astype(np.int64)
    inside = (block >= 0) & (block < normal_n.size)
    at = normal_n[np.clip(block, 0, normal_n.size - 1)]
    # Where the force is missing it says nothing against contact.
    off: NDArray[np.bool_] = at < PRESSED_SHARE * np.median(measured)
    return inside & ~off


def _means(segments: Sequence[SweepThird], normal_n: FloatArray, rate_hz: float) -> Means:
    """Return speed and force over the sweeps."""
    if not segments:
        return Means(np.nan, np.nan)
    lasting = np.array([segment.end_s - segment.begin_s for segment in segments])
    speed = np.array([segment.speed_mm_s for segment in segments])
    pieces = [
        normal_n[int(segment.begin_s * rate_hz / BLOCK) : int(segment.end_s * rate_hz / BLOCK)]
        for segment in segments
    ]
    swept = np.concatenate(pieces)
    measured = swept[np.isfinite(swept)]
    force = float(measured.mean()) if measured.size else np.nan
    return Means(float(speed @ lasting / lasting.sum()), force)


def _gaps(trial: Trial, motion: TouchMotion) -> Iterator[str]:
    """Yield what a reader should know of missing data."""
    reports = trial.position_t_s.size
    if motion.time_s.size < reports:
        yield (
            f"{reports - motion.time_s.size} of {reports} position reports are missing, "
            "stray or alone, and were not used"
        )
    for name in ("voltage_v", "force_n", "accel_m_s2", "skin_velocity_m_s"):
        samples = getattr(trial, name)
        if samples is not None and not np.isfinite(samples.sum()):
            lacking = np.isnan(samples.reshape(samples.shape[0], -1)).any(axis=1)
            yield f"{int(lacking.sum())} of {lacking.size} samples of {name} are missing"
    if trial.accel_m_s2 is None and trial.skin_velocity_m_s is None:
        yield NO_SKIN


_FIGURE: Final = re.compile(r"(?<=trial )\S+|[-+±]?\d[\d.,e+-]*")
"""Which the same reason gives anew for every trial."""
MOST: Final = 8
"""Kinds that are listed."""


@dataclass(frozen=True, slots=True)
class ReasonCount:
    """One kind of reason.

    Attributes
    ----------
    trials : int
        That have it.
    example : str
        The reason of the first of them.
    """

    trials: int
    example: str


def count_reasons(reasons: Iterable[Sequence[str]]) -> tuple[ReasonCount, ...]:
    """Return the kinds of reasons, the most frequent first.

    Parameters
    ----------
    reasons : iterable of sequence of str
        Of each trial, all that it has; those that differ in figures alone are of one kind.
    """
    counts: dict[str, int] = {}
    examples: dict[str, str] = {}
    for of_trial in reasons:
        for kind, reason in {_FIGURE.sub("", reason): reason for reason in of_trial}.items():
            counts[kind] = counts.get(kind, 0) + 1
            examples.setdefault(kind, reason)
    ordered = sorted(counts, key=lambda kind: -counts[kind])
    return tuple(ReasonCount(counts[kind], examples[kind]) for kind in ordered)


def list_reasons(reasons: Iterable[Sequence[str]]) -> str:
    """Return all kinds of reasons with their counts as one line.

    Parameters
    ----------
    reasons : iterable of sequence of str
        As for `count_reasons`.
    """
    found = count_reasons(reasons)
    told = [f"{each.trials} x {each.example}" for each in found[:MOST]]
    rest = found[MOST:]
    if rest:
        told.append(f"and {len(rest)} rarer kinds")
    return "; ".join(told)
