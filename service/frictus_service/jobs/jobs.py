"""The calibrations that this API process runs: started, followed, cancelled, resumed.

Where a calibration stands is always what the registry says. One API process runs the
calibrations of a site: what the registry has as running when that process starts was
interrupted.
"""

import logging
import threading
from dataclasses import dataclass
from typing import Final

from frictus_service.calibration.job import CalibrationSpec, Progress
from frictus_service.config import Config
from frictus_service.errors import (
    CalibrationStateError,
    RegistryError,
    RegistryUnavailableError,
)
from frictus_service.jobs.process import Done, Failed, JobProcess, Moved, Order, Said
from frictus_service.registry.calibrations import RESUMABLE
from frictus_service.registry.database import Once
from frictus_service.registry.documents import Calibration, CalibrationState, Published
from frictus_service.registry.store import Registry, earlier_people

RUN: Final = "frictus_service.calibration.run:run_calibration"
CLOSE_S: Final = 4.0
_LOG: Final = logging.getLogger(__name__)


@dataclass(slots=True)
class _Job:
    """One calibration that runs."""

    thread: threading.Thread | None = None
    process: JobProcess | None = None
    cancelled: bool = False


class Jobs:
    """Runs the calibrations of one site. All methods may be called from any thread.

    Parameters
    ----------
    config : Config
        Its site, router and folder of studies are used.
    registry : Registry
        Where the calibrations are kept.
    run : str
        ``module:function`` that carries out one calibration.
    """

    def __init__(self, config: Config, registry: Registry, run: str = RUN) -> None:
        self._config = config
        self._registry = registry
        self._run = run
        self._lock = threading.Lock()
        self._jobs: dict[str, _Job] = {}
        self._recovered = False
        self.closing = False

    def recover(self) -> None:
        """Note what an earlier process left running as interrupted; once.

        Raises
        ------
        RegistryUnavailableError
        """
        with self._lock:
            if not self._recovered:
                self._registry.calibrations.interrupt(self._config.site)
                self._recovered = True

    def start(self, spec: CalibrationSpec, *, by: str, once: Once | None) -> Calibration:
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
        RigBusyError, KeyReusedError, RegistryUnavailableError
        """
        self.recover()
        protocol = spec.protocol
        if protocol.kind == "quick" and protocol.use_prior and not spec.prior:
            earlier = earlier_people(self._registry, spec.participant)
            spec = spec.model_copy(update={"prior": earlier})
        calibration, is_new = self._registry.calibrations.create(
            spec, site=self._config.site, by=by, once=once
        )
        if is_new:
            self._launch(calibration)
        return calibration

    def resume(self, calibration_id: str) -> Calibration:
        """Go on with a calibration that was interrupted or failed; finished trials are kept.

        Raises
        ------
        UnknownCalibrationError, CalibrationStateError, RigBusyError
        """
        self.recover()
        calibration = self._registry.calibrations.change(calibration_id, "queued", of=RESUMABLE)
        self._launch(calibration)
        return calibration

    def cancel(self, calibration_id: str) -> Calibration:
        """Tell a calibration to stop; it is cancelled once its process has ended.

        Raises
        ------
        UnknownCalibrationError, CalibrationStateError
        """
        self.recover()
        with self._lock:
            job = self._jobs.get(calibration_id)
            if job is not None:
                job.cancelled = True
                if job.process is not None:
                    job.process.stop()
        if job is not None:
            return self._registry.calibrations.get(calibration_id)
        return self._registry.calibrations.change(
            calibration_id, "cancelled", of=("queued", "running", "interrupted")
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
        calibration = self._registry.calibrations.get(calibration_id)
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

    def stop(self) -> None:
        """Tell everything that runs to stop; it is interrupted then, and can be resumed."""
        with self._lock:
            self.closing = True
            for job in self._jobs.values():
                if job.process is not None:
                    job.process.stop()

    def close(self) -> None:
        """Stop everything, and wait until it has ended."""
        self.stop()
        with self._lock:
            jobs = list(self._jobs.values())
        for job in jobs:
            if job.thread is not None:
                job.thread.join(CLOSE_S)

    def _launch(self, calibration: Calibration) -> None:
        job = _Job()
        job.thread = threading.Thread(
            target=self._follow, args=(calibration, job), name=f"calibration-{calibration.id}"
        )
        with self._lock:
            self._jobs[calibration.id] = job
        job.thread.start()

    def _follow(self, calibration: Calibration, job: _Job) -> None:
        """Run a calibration from beginning to end; the target of its thread."""
        try:
            self._registry.calibrations.change(calibration.id, "running", of=("queued",))
            self._conclude(calibration.id, job, self._carry_out(calibration, job))
        except RegistryError:
            # It stands there as running: the next API process makes that interrupted.
            _LOG.exception("calibration %s: its state could not be kept", calibration.id)
        finally:
            with self._lock:
                if self._jobs.get(calibration.id) is job:  # not if it was resumed meanwhile
                    del self._jobs[calibration.id]

    def _carry_out(self, calibration: Calibration, job: _Job) -> Said | None:
        """Return the last word of the calibration's process; None if it ended without one."""
        order = Order(
            run=self._run,
            # Whoever finds the rig held reads who began it.
            client=f"{calibration.created_by}.calibration-{calibration.id[-8:]}",
            router=self._config.router.endpoint,
            tls=self._config.tls("client"),
            spec=calibration.spec,
            folder=(self._config.studies / calibration.id).absolute(),
        )
        try:
            process = JobProcess(order)
        except OSError as error:
            return Failed(reason=f"its process could not be started: {error}")
        last: Said | None = None
        with process:
            with self._lock:
                job.process = process
                if job.cancelled or self.closing:
                    process.stop()
            for word in process.said():
                if isinstance(word, Moved):
                    self._keep(calibration.id, word.progress)
                else:
                    last = word
        return last

    def _keep(self, calibration_id: str, progress: Progress) -> None:
        try:
            self._registry.calibrations.progress(calibration_id, progress)
        except RegistryUnavailableError as error:
            # The participant goes on sliding; what counts is kept in the folder.
            _LOG.warning("calibration %s: progress was not kept: %s", calibration_id, error)

    def _conclude(self, calibration_id: str, job: _Job, last: Said | None) -> None:
        change = self._registry.calibrations.change
        if isinstance(last, Done):
            change(calibration_id, "done", of=("running",), result=last.result)
        elif isinstance(last, Failed):
            change(calibration_id, "failed", of=("running",), failure=last.reason)
        else:
            if last is None and not job.cancelled:
                _LOG.warning("calibration %s: its process ended by itself", calibration_id)
            end: CalibrationState = "cancelled" if job.cancelled else "interrupted"
            change(calibration_id, end, of=("running",))
