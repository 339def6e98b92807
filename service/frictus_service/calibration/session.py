"""One participant at one rig: guidance, approaches, recordings and breaks.

The drive is on while a trial runs, and at no other time. All phases are measured in samples of
the device.
"""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import Final, Literal

from frictus.keys import spoken_name
from frictus.lease import CONFIRM_S, Lease
from frictus.messages import FingerState, GuidanceState, LastCall, RigStatus
from frictus.rig import Rig
from frictus_service.calibration.checks import StrokesCapture
from frictus_service.calibration.job import Phase
from frictus_service.calibration.plan import Ask
from frictus_service.calibration.trial_capture import BESIDE_S, StreamReader, TrialCapture
from frictus_service.errors import CalibrationError, CancelledError, CaptureError
from frictus_service.study.trial import Trial, TrialInfo

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
    )


LEASE_MS: Final = 1_000
SETTLE_S: Final = 0.25
"""Least approach beyond the rig's lead: the drive has faded in by then."""
GUIDANCE_S: Final = 1.0 / 30.0
TELL_S: Final = 0.5
REST_N: Final = 0.4
"""Shown when nothing is asked for."""
REASON_S: Final = CONFIRM_S + 1.0
"""A lease that was taken away before the rig confirmed it knows why only then."""

Tell = Callable[[Phase, str], None]
"""Told the phase, and what is worth saying."""


class TrialSession:
    """Runs trials.

    Parameters
    ----------
    rig : Rig
        An open rig of this client.
    lead_s : float
        The longest of the rig, from ordering a drive to its playing: it may grow meanwhile.
    participant : str
        Pseudonym.
    show : callable
        Publishes guidance.
    tell : callable
        Told at every change of phase and twice a second.
    cancelled : callable
        Asked with every block; true ends the session.
    """

    def __init__(
        self,
        rig: Rig,
        lead_s: float,
        participant: str,
        show: Callable[[GuidanceState], None],
        tell: Tell,
        cancelled: Callable[[], bool],
    ) -> None:
        self._rig = rig
        self._lead_s = lead_s
        self._participant = participant
        self._show = show
        self._tell = tell
        self._cancelled = cancelled
        self._former_stop = self._last_stop()
        self.strokes = StrokesCapture()
        """What was heard, for the alignment of the sensors."""

    def rest(self, seconds: float, cue: Cue) -> None:
        """Let the participant rest, the drive off; what comes next is shown.

        Raises
        ------
        CancelledError, CalibrationError
        """
        with StreamReader(self._rig, self.strokes) as heard:
            self._pass(heard, "break", cue, heard.sample, seconds, None)

    def record(self, ask: Ask, cue: Cue, info: TrialInfo) -> Trial:
        """Play what is asked for, let the participant get going, and record.

        Parameters
        ----------
        ask : Ask
            Tones, speed, force and lengths.
        cue : Cue
            What the participant is asked for.
        info : TrialInfo
            Its sample rate and start are set from what the rig says.

        Raises
        ------
        CancelledError
        CaptureError
            If too much of it did not arrive, or the drive was interrupted.
        CalibrationError
            If the rig took the lease away, or fell silent.
        RefusedError
            If the rig does not let itself be armed, or cannot play this.
        """
        self._check_stop()
        try:
            with self._rig.arm(LEASE_MS, keep_model=True) as lease:
                self._rig.excite(ask.excitation)
                # Only now: whatever is heard from here on is sensed with the drive ordered.
                with StreamReader(self._rig, self.strokes) as heard:
                    return self._listen(heard, lease, ask, cue, info)
        except BaseException:
            # Else screens ask for this trial still, and a virtual finger presses on.
            self._guide(replace(cue, force_n=REST_N), "break", 0.0, 0.0, None)
            raise

    def _listen(
        self, heard: StreamReader, lease: Lease, ask: Ask, cue: Cue, info: TrialInfo
    ) -> Trial:
        rate_hz, begin = heard.sample_rate_hz, heard.sample
        approach_s = max(ask.approach_s, self._lead_s + SETTLE_S)
        capture = TrialCapture(
            begin + round(approach_s * rate_hz), round(ask.record_s * rate_hz), rate_hz
        )
        heard.capture = capture
        self._pass(heard, "approach", cue, begin, approach_s, lease)
        if not heard.armed:
            raise CalibrationError(
                f"rig {self._rig.name} is not driven {approach_s:g} s after it was armed; see "
                "its status"
            )
        self._pass(heard, "record", cue, begin, approach_s + ask.record_s, lease)
        # Reports of where the finger was then are still on their way.
        end_s = approach_s + ask.record_s + BESIDE_S
        self._pass(heard, "record", cue, begin, end_s, lease)
        gaps = heard.gaps_within(capture.first_sample, capture.end_sample)
        if gaps:
            raise CaptureError(
                f"the drive of {gaps} blocks came too late to be played: the rig's machine is "
                "busy; close other programs on it, or raise lead_ms in its "
                "[backend]"
            )
        started = datetime.fromtimestamp(1e-9 * capture.utc_ns, UTC).isoformat()
        return capture.trial(replace(info, sample_rate_hz=rate_hz, started_utc=started))

    def _pass(
        self,
        heard: StreamReader,
        phase: Phase,
        cue: Cue,
        begin: int,
        until_s: float,
        lease: Lease | None,
    ) -> None:
        """Let device time pass until so long after `begin`, and show guidance meanwhile."""
        rate_hz = heard.sample_rate_hz
        shown_s = -GUIDANCE_S
        told_s = time.monotonic()
        self._tell(phase, "")
        while (elapsed_s := (heard.sample - begin) / rate_hz) < until_s:
            self._check(heard, lease)
            if elapsed_s - shown_s >= GUIDANCE_S:
                shown_s = elapsed_s
                left_s = until_s - elapsed_s
                self._guide(cue, phase, elapsed_s, left_s, heard)
            if time.monotonic() - told_s >= TELL_S:
                told_s = time.monotonic()
                self._tell(phase, "")
            heard.advance()

    def _check(self, heard: StreamReader, lease: Lease | None) -> None:
        if self._cancelled():
            raise CancelledError("cancelled; the finished trials are kept")
        # The blocks tell in which sample the drive went; the lease tells why, a little later.
        gone = heard.was_armed and not heard.armed
        if lease is not None and (gone or lease.lost):
            lease.wait_lost(REASON_S)
            reason = lease.reason or "it was stopped"
            raise CalibrationError(
                f"rig {self._rig.name} took the lease away: {reason}. The finished trials are "
                "kept; start the calibration again once the cause is gone"
            )
        self._check_stop()

    def _last_stop(self) -> LastCall | None:
        return self._rig.status().last_calls.get("stop")

    def _check_stop(self) -> None:
        """End where somebody has stopped the rig, also while nothing was driven."""
        stop = self._last_stop()
        if stop is not None and stop != self._former_stop:
            who = spoken_name(stop.client) if stop.client else "somebody"
            raise CalibrationError(
                f"rig {self._rig.name} was stopped by {who}. The finished trials are kept; "
                "start the calibration again once the cause is gone"
            )

    def _guide(
        self,
        cue: Cue,
        phase: Phase,
        elapsed_s: float,
        left_s: float,
        heard: StreamReader | None,
    ) -> None:
        finger = heard.finger if heard is not None else None
        self._show(
            guide(cue, self._participant, phase, elapsed_s, left_s, finger, time.time_ns())
        )

    def pause(self, phase: Phase, cue: Cue) -> None:
        """Show that nothing is asked for now: while a trial is judged, and at the end."""
        self._tell(phase, "")
        self._guide(cue, phase, 0.0, 0.0, None)


def status_of(rig: Rig) -> RigStatus:
    """Return the status of a rig that may be armed.

    Raises
    ------
    CalibrationError
        If it is tripped: only an operator may reset it; or if somebody holds it.
    """
    status = rig.status()
    if status.state == "tripped":
        fault = status.fault
        why = f": {fault.reason}. {fault.action}" if fault is not None else ""
        raise CalibrationError(f"rig {rig.name} is tripped{why}")
    if status.owner is not None:
        raise CalibrationError(
            f"{spoken_name(status.owner)} holds rig {rig.name}: wait until it disarms, or stop "
            "it; then start again"
        )
    return status


def check_forces(status: RigStatus, forces_n: Sequence[float]) -> None:
    """Refuse forces at which the rig would trip while the finger presses as it is asked to.

    Parameters
    ----------
    status : RigStatus
        Of the rig.
    forces_n : sequence of float
        Normal forces that are asked for, at least one.

    Raises
    ------
    CalibrationError
    """
    limit_n = status.force_limit_n
    if limit_n is None:  # a rig of another version
        return
    most_n = limit_n / (1.0 + IN_RANGE)
    if max(forces_n) > most_n:
        raise CalibrationError(
            f"rig {status.rig} trips above {limit_n:g} N, and a finger that is asked for "
            f"{max(forces_n):g} N may press with {IN_RANGE:.0%} more: ask for at most "
            f"{math.floor(100.0 * most_n) / 100.0:g} N, or raise force_limit_n in the rig's "
            "[limits]"
        )
