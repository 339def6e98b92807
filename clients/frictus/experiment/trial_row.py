"""Starts and trials as rows of the log: as asked for, and as rendered."""

from typing import Any, Final

from frictus.experiment.presentation import WHOLE, PresentedInterval
from frictus.experiment.procedures.schedule import NOT_FELT, ScheduledTrial
from frictus.experiment.stimuli import Stimulus
from frictus.rig import Rig

EXTRAPOLATED_SHARE: Final = 0.2
"""Of an interval at speeds beyond the model's: less is the turn of a stroke."""


def status_of(flags: list[str]) -> str:
    """Return the status of an answered trial; without contact and motion none is felt.

    Parameters
    ----------
    flags : list of str
        As `flags_of` returns them.
    """
    return NOT_FELT if {"no contact", "still"} & set(flags) else "answered"


def start_row(rig: Rig, trials_before: int, utc_ns: int) -> dict[str, Any]:
    """Return what a log holds of a start, but for its recording.

    Parameters
    ----------
    rig : Rig
        The rig.
    trials_before : int
        Recorded before.
    utc_ns : int
        Now.
    """
    status = rig.status()
    return {
        "event": "start",
        "utc_ns": utc_ns,
        "trials_before": trials_before,
        "rig": rig.name,
        "site": rig.site,
        "run": status.run,
        "simulated": status.simulated,
        "version": status.version,
        "sample_rate_hz": status.sample_rate_hz,
        "model_etag": status.model_etag,
        "model_placeholder": status.model_placeholder,
        "compensation": str(status.compensation),
    }


def trial_row(
    trial: ScheduledTrial,
    level: float,
    stimulus: Stimulus,
    intervals: list[PresentedInterval],
    utc_ns: int,
    recording: str | None,
) -> dict[str, Any]:
    """Return what a row holds before the answer.

    Parameters
    ----------
    trial : ScheduledTrial
        The trial.
    level : float
        Asked for last.
    stimulus : Stimulus
        What the level means.
    intervals : list of PresentedInterval
        What was presented; none where it was refused.
    utc_ns : int
        Now.
    recording : str or None
        Name of the recording under way.
    """
    gains = {each.shows: each.applied.gain for each in intervals}
    rendered = 0.0  # a test that is not there has no height
    if "test" in trial.order:
        test, reference = gains.get("test", 1.0), gains.get("reference", 1.0)
        rendered = stimulus.rendered(level, test, reference)
    return {
        "trial": trial.number,
        "phase": trial.phase,
        "condition": trial.condition,
        "catch": trial.catch,
        "order": list(trial.order),
        "utc_ns": utc_ns,
        "level": level if "test" in trial.order else 0.0,
        "level_rendered": max(rendered, 0.0),
        "unit": stimulus.unit,
        "recording": recording,
        "intervals": [each.fields() for each in intervals],
    }


def flags_of(
    trial: ScheduledTrial,
    intervals: list[PresentedInterval],
    level_rendered: float,
    settings: list[float],
) -> list[str]:
    """Return what an analysis must know of a trial.

    Parameters
    ----------
    trial : ScheduledTrial
        The trial.
    intervals : list of PresentedInterval
        What was presented.
    level_rendered : float
        0 where the rig's scaling has undone the level.
    settings : list of float
        Levels set one after the other; the last wish was for more where two are the same.
    """
    fingers = [each.finger for each in intervals]
    forces = [each.force for each in intervals]
    found = {
        "scaled": any(each.applied.gain < WHOLE for each in intervals),
        "level lost": level_rendered <= 0.0 and "test" in trial.order,
        "limited": len(settings) > 1 and settings[-1] == settings[-2],
        "no contact": any(finger is None for finger in fingers),
        "still": any(finger is not None and finger.still for finger in fingers),
        "extrapolated": any(f and f.extrapolated > EXTRAPOLATED_SHARE for f in fingers),
        "blocks lost": any(force and force.lost_blocks > 0 for force in forces),
    }
    return [name for name, holds in found.items() if holds]
