"""The calibrations of one site: one on a rig at a time, kept by the registry."""

import logging
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from frictus_service.calibration.job import CalibrationResult, CalibrationSpec, Progress
from frictus_service.config import Config
from frictus_service.errors import (
    CalibrationStateError,
    JobElsewhereError,
    RegistryUnavailableError,
    RigBusyError,
)
from frictus_service.job_folder import ACTIVE, State
from frictus_service.job_locks import hold, let_go
from frictus_service.jobs.engine import JobEngine, RigUse
from frictus_service.jobs.process import ParentLink, RigAccount, Work
from frictus_service.registry.documents import Calibration, Published

if TYPE_CHECKING:
    from frictus_service.registry.calibrations import Calibrations
    from frictus_service.registry.database import Once
    from frictus_service.registry.store import Registry

CALIBRATE: Final = "frictus_service.calibration.run:run_calibration"
AT_ONCE: Final = 64
HELD: Final = "calibrations"
"""Of what other kinds of jobs have a folder: here it names the locks alone."""
_LOG: Final = logging.getLogger(__name__)


class CalibrationWork(Work):
    """As `frictus_service.calibration.run.run_calibration` is called."""

    account: RigAccount
    site: str
    spec: CalibrationSpec

    def carry_out(self, run: Callable[..., Any], parent: ParentLink) -> CalibrationResult:
        """Calibrate."""
        with self.account.connect() as client:
            given = (self.spec, self.folder, client, self.site)
            result: CalibrationResult = run(*given, parent.report, parent.cancelled)
        return result


class HeldCalibrations:
    """The calibrations of a registry, of which each API process changes its own alone.

    Which one is said by who holds it (`job_locks`), as for jobs that are kept in folders.

    Parameters
    ----------
    kept : Calibrations
        Of the registry.
    studies : Path
        Folder of studies: where trials are kept, and so where one is held.
    """

    def __init__(self, kept: "Calibrations", studies: Path) -> None:
        self._kept = kept
        self._root = studies.absolute() / HELD

    def get(self, job: str) -> Calibration:
        """Return a calibration."""
        return self._kept.get(job)

    def state(self, job: str) -> State:
        """Return in which state a calibration is."""
        return self._kept.state(job)

    def hold(self, job: str) -> bool:
        """Return whether a calibration is this process's now; False where another runs it."""
        with suppress(OSError):  # then nothing is held there, and no trial kept either
            self._root.parent.mkdir(parents=True, exist_ok=True)
        return hold(self._root, job)

    def change(
        self,
        job: str,
        to: State,
        *,
        of: Sequence[State],
        result: CalibrationResult | None = None,
        failure: str | None = None,
    ) -> Calibration:
        """Put a calibration into another state, and return it.

        Raises
        ------
        UnknownCalibrationError, CalibrationStateError, RigBusyError
        JobElsewhereError
            If another process runs it.
        """
        if self._kept.state(job) in of and not self.hold(job):
            raise JobElsewhereError(
                f"calibration {job} is run by another API that works in the same folder: "
                "ask that one, or end it"
            )
        try:
            changed = self._kept.change(job, to, of=of, result=result, failure=failure)
        except (CalibrationStateError, RigBusyError):
            let_go(self._root, job)
            raise
        if to not in ACTIVE:
            let_go(self._root, job)
        return changed

    def interrupt(self, site: str) -> list[str]:
        """Note that what ran at a site runs no more, but for what another API runs.

        Returns
        -------
        list of str
            Ids of what was interrupted.
        """
        return [job for job in self._kept.active_at(site) if self._is_interrupted(job)]

    def _is_interrupted(self, job: str) -> bool:
        try:
            self.change(job, "interrupted", of=ACTIVE)
        except JobElsewhereError as error:
            _LOG.warning("%s", error)
            return False
        except CalibrationStateError:
            return False  # it has ended meanwhile
        return True


class CalibrationEngine(JobEngine[Calibration]):
    """Runs calibrations. All methods may be called from any thread.

    Parameters
    ----------
    config : Config
        Its site, router and folder of studies are used.
    registry : Registry
        Where the calibrations are kept.
    use : RigUse
        Of the rigs, with the other kinds of jobs.
    run : str
        ``module:function`` that carries out one calibration.
    """

    kind = "calibration"
    cancellable = ("queued", "running", "interrupted")
    resumable = ("interrupted", "failed")

    def __init__(
        self, config: Config, registry: "Registry", use: RigUse, run: str = CALIBRATE
    ) -> None:
        self._config, self._registry, self._use, self._run = config, registry, use, run
        use.checks.append(self.require_free)
        self.store = registry.calibrations
        self._held = HeldCalibrations(self.store, config.studies)
        super().__init__(self._held, self._interrupt_left, AT_ONCE)

    def start(self, spec: CalibrationSpec, *, by: str, once: "Once | None") -> Calibration:
        """Start a calibration; return it as it was queued.

        A quick protocol that uses a prior, and was given none, learns from the published models
        of other participants.

        Parameters
        ----------
        spec : CalibrationSpec
            What the calibration was asked for.
        by : str
            Who asks.
        once : Once or None
            Idempotency key: the same request again returns the first one's calibration.

        Raises
        ------
        RigBusyError, RigInExperimentError, KeyReusedError, RegistryUnavailableError
        """
        self.recover()
        protocol = spec.protocol
        if protocol.kind == "quick" and protocol.use_prior and not spec.prior:
            # The process of a calibration, too, loads this module; it needs no database.
            from frictus_service.registry.store import earlier_people

            earlier = earlier_people(self._registry, spec.participant)
            spec = spec.model_copy(update={"prior": earlier})
        with self._use.beginning, self._lock:
            if once is None or self.store.made_by(once) is None:
                self._use.require_free(spec.rig)
            site = self._config.site
            calibration, is_new = self.store.create(spec, site=site, by=by, once=once)
            if is_new:
                self._held.hold(calibration.id)
                self._launch(calibration)
        return calibration

    def require_free(self, rig: str) -> None:
        """Raise if a calibration is under way on a rig of this site, as far as is known.

        Raises
        ------
        RigBusyError
        """
        if not self._registry.database.exists:
            return
        with suppress(RegistryUnavailableError):
            if (other := self.store.active_on(self._config.site, rig)) is not None:
                raise RigBusyError(
                    f"calibration {other.id} ({other.participant}) is under way on rig "
                    f"{rig!r}: wait for its end, or cancel it"
                )

    def cancel(self, job: str) -> Calibration:
        """Cancel a calibration of this site, as any job."""
        self._require_ours(job)
        return super().cancel(job)

    def resume(self, job: str) -> Calibration:
        """Go on with a calibration of this site, as any job, once its rig is free."""
        self._require_ours(job)
        with self._use.beginning:
            found = self.get(job)
            if found.state in self.resumable:
                self._use.require_free(found.rig)
            return super().resume(job)

    def _require_ours(self, job: str) -> None:
        # Sites may share a registry: its rig, and what is finished, are elsewhere.
        if (site := self.get(job).site) != self._config.site:
            raise CalibrationStateError(
                f"calibration {job} is of site {site!r}, and this is {self._config.site!r}: "
                "ask the API of its site"
            )

    def publish(
        self, calibration_id: str, *, name: str | None, by: str, comment: str
    ) -> Published:
        """Publish the model of a calibration, once; again returns what was published.

        Parameters
        ----------
        calibration_id : str
            Of the registry.
        name : str or None
            None: ``RIG/PARTICIPANT``.
        by, comment : str
            Who, and what there is to say.

        Raises
        ------
        UnknownCalibrationError, CalibrationStateError, RegistryNameError, ProvenanceError
        """
        calibration = self.store.get(calibration_id)
        if calibration.result is None:
            raise CalibrationStateError(
                f"calibration {calibration_id} is {calibration.state}: it has no model yet"
            )
        return self._registry.publish(
            calibration.result.model,
            name or f"{calibration.rig}/{calibration.participant}",
            by=by,
            rig=calibration.rig,
            comment=comment,
            calibration=calibration_id,
        )

    def _interrupt_left(self) -> None:
        if self._registry.database.exists:  # or nothing was ever calibrated
            self._held.interrupt(self._config.site)

    def _work(self, job: Calibration) -> CalibrationWork:
        return CalibrationWork(
            run=self._run,
            folder=(self._config.studies / job.id).absolute(),
            account=RigAccount.of(self._config, job.created_by, self.kind, job.id),
            site=self._config.site,
            spec=job.spec,
        )

    def _hear(self, job: str, progress: str) -> None:
        self.store.progress(job, Progress.model_validate_json(progress))

    def _outcome(self, result: str) -> dict[str, Any]:
        return {"result": CalibrationResult.model_validate_json(result)}
