"""A whole calibration, from the first trial to the model; called again, it goes on."""

from collections.abc import Callable
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

import numpy as np

import frictus
from frictus.keys import Topics
from frictus.messages import GuidanceState, RigStatus
from frictus.session import declare_publisher
from frictus_hardware.physics.friction import FrictionLaw
from frictus_hardware.physics.linear import Mount, TransferFunction
from frictus_hardware.physics.screen import Screen
from frictus_service.calibration.checks import alignment_of, linearity_of
from frictus_service.calibration.conclusion import (
    conclude,
    precision_so_far,
    prior_of,
    why_wider,
)
from frictus_service.calibration.coordinates import of_people
from frictus_service.calibration.folder import CalibrationFolder
from frictus_service.calibration.job import CalibrationResult, CalibrationSpec, Phase, Progress
from frictus_service.calibration.plan import HOPELESS, Ask, is_hopeless, plan_of
from frictus_service.calibration.rehearsal import rehearse
from frictus_service.calibration.session import (
    REST_N,
    Cue,
    TrialSession,
    check_forces,
    span_of,
    status_of,
)
from frictus_service.errors import CaptureError, EstimateError, Exclusion, FieldError
from frictus_service.identification.observation.observe import observe
from frictus_service.identification.observation.response import TrialObservations
from frictus_service.study.plausible import check_measured
from frictus_service.study.reader import StudyReader
from frictus_service.study.trial import StudyInfo, Trial, TrialInfo
from frictus_service.synthesis.scene import compile_excitation

TRIES: Final = 3
"""How often a trial that comes in too incomplete is recorded before the calibration ends."""
PAPER_MOUNT: Final = Mount().lateral


def run_calibration(
    spec: CalibrationSpec,
    folder: Path,
    client: frictus.Client,
    site: str,
    tell: Callable[[Progress], None],
    cancelled: Callable[[], bool],
    mount: TransferFunction | None = PAPER_MOUNT,
) -> CalibrationResult:
    """Calibrate a participant on a rig; blocks until it is done.

    What is finished is kept in the folder: called again with the same specification (another
    session of it aside), it goes on where it ended, however that was.

    Parameters
    ----------
    spec : CalibrationSpec
        What the calibration was asked for.
    folder : Path
        Of this calibration alone.
    client : Client
        Takes the rig's lease while a trial runs.
    site : str
        Of the rig: another site's of the same name is another participant's.
    tell : callable
        Told at every change of phase, and twice a second.
    cancelled : callable
        Asked with every block.
    mount : TransferFunction or None
        Between the rig's screen and its force sensor, lateral, force to force.

    Raises
    ------
    CancelledError
        If `cancelled` said so; finished trials are kept.
    CalibrationError
        If the rig trips, takes the lease away, falls silent or loses too many samples, or would
        trip at a force that is asked for.
    FolderError
        If the folder holds another calibration.
    EstimateError
        If the trials, all of them kept, do not determine the law.
    FrictusError
        If the rig is not there, or refuses.
    """
    rig = client.rig(spec.rig, site)
    status = status_of(rig)
    check_forces(status, spec.protocol.forces_n)
    calibration = CalibrationRun(
        spec, CalibrationFolder.open(folder, spec), status, mount, tell
    )
    publisher = declare_publisher(client.session, rig.keys.of(Topics.GUIDANCE), Topics.GUIDANCE)

    def show(guidance: GuidanceState) -> None:
        publisher.put(guidance.to_json())

    try:
        longest_s = 1e-3 * (status.max_lead_ms or status.lead_ms)
        session = TrialSession(
            rig, longest_s, spec.participant, show, calibration.tell, cancelled
        )
        calibration.measure(session)
    finally:
        publisher.undeclare()  # type: ignore[no-untyped-call]
    return calibration.conclude()


class CalibrationRun:
    """What is asked for, what was done, and what it says.

    Parameters
    ----------
    spec : CalibrationSpec
        What the calibration was asked for.
    kept : CalibrationFolder
        Trials that are done.
    status : RigStatus
        When the calibration began.
    mount : TransferFunction or None
        Force to force, in s; None: no mount.
    tell : callable
        Takes each progress.
    """

    def __init__(
        self,
        spec: CalibrationSpec,
        kept: CalibrationFolder,
        status: RigStatus,
        mount: TransferFunction | None,
        tell: Callable[[Progress], None],
    ) -> None:
        prior = of_people(spec.prior, status.simulated)
        self._left_out = len(spec.prior) - len(prior)
        self._spec = spec = spec.model_copy(update={"prior": prior})
        self._kept = kept
        self._status = status
        self._span = span_of(status.screen_mm)
        self._tell = tell
        self._plan = plan_of(spec.protocol, spec.seed, prior_of(spec))
        self._observed: dict[str, TrialObservations] = {}
        self._begun = len(kept.done)
        self._earlier = bool(kept.done)
        self._precision: float | None = None
        self._sensors: tuple[dict[str, Any] | None, tuple[str, ...]] = None, ()
        self._study = StudyInfo(
            rig=spec.rig,
            carrier_hz=Screen().carrier_hz,
            screen_peak_v=status.screen_peak_v,
            mount=mount,
            extras={
                "protocol": spec.protocol.kind,
                "seed": spec.seed,
                "software": f"frictus {version('frictus')}",
                "simulated": int(status.simulated),
            },
        )

    def measure(self, session: TrialSession) -> None:
        """Run what is left of the plan."""
        while (ask := self._next()) is not None:
            done = self._kept.done
            cue = Cue(
                len(done) + 1,
                self._plan.planned(done),
                ask.speed_mm_s,
                ask.force_n,
                self._span,
            )
            if len(done) == self._begun:
                self.tell("analyse", "preparing; half a minute on a new installation")
                rehearse(self._asked(ask), self._study)
            elif (pause_s := self._plan.break_s(done)) > 0.0:
                session.rest(pause_s, cue)
            trial = self._record(session, ask, cue)
            session.pause("analyse", cue)
            self._keep(trial)
        declared_s = self._status.touch_latency_s or 0.0
        self._sensors = alignment_of(list(session.strokes.strokes()), declared_s)
        finished = len(self._kept.done)
        session.pause("done", Cue(finished, finished, 0.0, REST_N, self._span))

    def _next(self) -> Ask | None:
        if is_hopeless(self._kept.done[self._begun :]):
            self.tell("analyse", f"{HOPELESS} trials, and all rejected: no more are asked for")
            return None
        if self._spec.protocol.kind == "quick":
            before = self._precision
            self._precision = precision_so_far(self._spec, self._observations())
            if wider := why_wider(before, self._precision):
                self.tell("analyse", wider)
        return self._plan.ask(self._kept.done, self._precision)

    def _record(self, session: TrialSession, ask: Ask, cue: Cue) -> Trial:
        asked = self._asked(ask)
        for _ in range(TRIES - 1):
            try:
                return session.record(ask, cue, asked)
            except CaptureError as error:
                self.tell("approach", f"recorded again: {error}")
        return session.record(ask, cue, asked)

    def _asked(self, ask: Ask) -> TrialInfo:
        """Return the attributes of the next trial; rate and start are known when it begins."""
        rate_hz = self._status.sample_rate_hz
        played = compile_excitation(ask.excitation, FrictionLaw(), rate_hz)
        return TrialInfo(
            id=self._kept.next_id,
            participant=self._spec.participant,
            session=self._spec.session,
            order=len(self._kept.done),
            speed_mm_s=ask.speed_mm_s,
            force_n=ask.force_n,
            tones_hz=ask.tones_hz,
            drive_vpp=2.0 * self._status.screen_peak_v * float(np.sqrt(played.peak)),
            sample_rate_hz=rate_hz,
            started_utc="",
        )

    def _keep(self, trial: Trial) -> None:
        """Judge a trial and put it on the disk."""
        observed = observe(trial, self._study)
        try:
            check_measured(trial, self._study)
        except FieldError as error:  # no reader gives it back either
            observed = replace(observed, valid=False, reasons=(str(error),))
        rejected = "; ".join(observed.reasons) if not observed.valid else ""
        done = self._kept.add(trial, self._study, rejected)
        self._observed[done.id] = observed
        verdict = f"rejected: {rejected}" if rejected else "accepted"
        self.tell("analyse", f"trial {done.id} {verdict}")

    def _observations(self) -> list[TrialObservations]:
        """Return what every trial that can be read says, those of earlier runs included."""
        if self._earlier:
            self._earlier = False
            for trial in self._kept.trials(self._tell_left_out):
                if trial.info.id not in self._observed:
                    self._observed[trial.info.id] = observe(trial, self._study)
        return [
            self._observed[done.id] for done in self._kept.done if done.id in self._observed
        ]

    def _tell_left_out(self, lost: Exclusion) -> None:
        self.tell("analyse", f"trial {lost.trial} is left out: {lost.field} {lost.reason}")

    def tell(self, phase: Phase, message: str) -> None:
        """Tell where the calibration stands."""
        done = self._kept.done
        self._tell(
            Progress(
                phase=phase,
                trials_done=len(done),
                trials_planned=self._plan.planned(done),
                trials_rejected=sum(bool(trial.rejected) for trial in done),
                recorded_s=sum(trial.record_s for trial in done),
                precision=self._precision,
                message=message,
            )
        )

    def conclude(self) -> CalibrationResult:
        """Merge the trials into one study and estimate the model."""
        self.tell("done", "estimating the model")
        done = self._kept.done
        excluded = self._kept.merge(self._study)
        sensors, notes = self._sensors
        try:
            result = conclude(
                self._spec,
                self._observations(),
                done,
                self._plan.left_out(done),
                self._kept.study,
                excluded,
            )
        except EstimateError as error:  # often because a sensor lies otherwise than configured
            if sensors is None or not notes:
                raise
            raise EstimateError("; ".join((str(error), *notes))) from error
        self._precision = result.precision
        self.tell("done", "estimating the model")
        details: dict[str, Any] = {"sensors": sensors}
        if self._spec.protocol.kind != "paper":
            accepted = {trial.id for trial in done if not trial.rejected}
            with StudyReader(self._kept.study) as study:
                details["linearity"], more = linearity_of(
                    study.read(info.id) for info in study.trials if info.id in accepted
                )
            notes = (*notes, *more)
        if self._left_out:
            notes = (
                *notes,
                f"the prior leaves out models of simulated participants: {self._left_out}",
            )
        told = result.model.provenance | {"simulated": self._status.simulated}
        return result.model_copy(
            update={
                "model": result.model.model_copy(update={"provenance": told}),
                "details": result.details | details,
                "notes": (*result.notes, *notes),
            }
        )
