"""What a participant is shown: where to be, how hard to press, and how it goes."""

from dataclasses import dataclass
from typing import Final, Literal

from frictus.messages import FingerState, GuidanceState
from frictus_service.calibration.job import Phase

Colour = Literal["green", "yellow", "red", "grey"]

IN_RANGE: Final = 0.10
"""Of the target force: the paper's tracking square is green so far from it."""
MARGIN_MM: Final = 5.0
"""Between the ends of the strokes and of the screen."""


@dataclass(frozen=True, slots=True)
class Cue:
    """What is asked for during one trial, or after a break.

    Attributes
    ----------
    trial : int
        From 1.
    trials : int or None
        How many there will be, if that is known.
    speed_mm_s, force_n : float
        Targets.
    span_mm : tuple of float
        Ends of the strokes.
    """

    trial: int
    trials: int | None
    speed_mm_s: float
    force_n: float
    span_mm: tuple[float, float]


def span_of(screen_mm: tuple[float, float]) -> tuple[float, float]:
    """Return the ends of the strokes on a screen, along x."""
    margin = min(MARGIN_MM, 0.1 * screen_mm[0])
    return (margin, screen_mm[0] - margin)


def reference_x_mm(elapsed_s: float, speed_mm_s: float, span_mm: tuple[float, float]) -> float:
    """Return where the reference is: back and forth at the target speed, from the left.

    Parameters
    ----------
    elapsed_s : float
        Since it started, 0 or more.
    speed_mm_s : float
        Target.
    span_mm : tuple of float
        Left and right end of the stroke.
    """
    low, high = span_mm
    way = (elapsed_s * speed_mm_s) % (2.0 * (high - low))
    return low + (way if way <= high - low else 2.0 * (high - low) - way)


def colour_of(force_n: float, target_n: float, in_contact: bool) -> Colour:
    """Return the colour of the cue that follows the finger (paper, Procedure)."""
    if not in_contact:
        return "grey"
    if force_n < (1.0 - IN_RANGE) * target_n:
        return "yellow"
    return "red" if force_n > (1.0 + IN_RANGE) * target_n else "green"


def guide(
    cue: Cue,
    participant: str,
    phase: Phase,
    elapsed_s: float,
    left_s: float,
    finger: FingerState | None,
    utc_ns: int,
    message: str = "",
) -> GuidanceState:
    """Return what to show.

    Parameters
    ----------
    cue : Cue
        What the participant is asked for.
    participant : str
        Pseudonym.
    phase : str
        Of the trial, as `GuidanceState` names it.
    elapsed_s : float
        Since the reference started to move.
    left_s : float
        Of this phase.
    finger : FingerState or None
        The newest; None or stale: the finger is not seen.
    utc_ns : int
        UTC of this moment.
    message : str
        Shown to the participant.
    """
    seen = finger is not None and not finger.stale
    touching = seen and finger is not None and finger.in_contact
    moves = phase in ("approach", "record")
    return GuidanceState(
        utc_ns=utc_ns,
        participant=participant,
        phase=phase,
        trial=cue.trial,
        trials=cue.trials,
        seconds_left=max(left_s, 0.0),
        target_speed_mm_s=cue.speed_mm_s,
        target_force_n=cue.force_n,
        reference_x_mm=reference_x_mm(elapsed_s if moves else 0.0, cue.speed_mm_s, cue.span_mm),
        span_mm=cue.span_mm,
        x_mm=finger.x_mm if touching and finger else None,
        speed_mm_s=abs(finger.vx_mm_s) if touching and finger else None,
        force_n=finger.normal_force_n if touching and finger else None,
        colour=colour_of(
            finger.normal_force_n if finger else 0.0, cue.force_n, in_contact=touching
        ),
        message=message,
    )
