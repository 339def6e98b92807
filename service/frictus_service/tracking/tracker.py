"""From what a rig publishes to what is known of the finger on it: windows, estimate, watch."""

from collections import deque
from collections.abc import Callable
from typing import Any, Final

import numpy as np

from frictus.aligned import AlignedSamples
from frictus.messages import BandRatio, EstimateState, Interval, LawNow
from frictus.model import Model, Validity
from frictus_hardware.arrays import FloatArray
from frictus_service.calibration import coordinates
from frictus_service.calibration.coordinates import Prior
from frictus_service.errors import EstimateError
from frictus_service.tracking.adaptation import CONTACT, FITTED_TO, PERSON
from frictus_service.tracking.estimation.batch import Batch
from frictus_service.tracking.estimation.law_estimate import (
    LawEstimate,
    advanced,
    of_another_finger,
    updated,
)
from frictus_service.tracking.evidence.advice import advice_of
from frictus_service.tracking.evidence.naming import NamedAlarm, named_alarms
from frictus_service.tracking.evidence.watch import ALARM, CAUSES, INSTRUMENT, ModelWatch
from frictus_service.tracking.measured_points import MeasuredPoints
from frictus_service.tracking.model_in_force import ModelInForce
from frictus_service.tracking.predictive_density import PrequentialGain
from frictus_service.tracking.prequential import PrequentialError
from frictus_service.tracking.windows import LawWindow, WindowCutter

BATCH: Final = 10
"""Windows of an update: half a second of sliding."""
BEGINNING: Final = 3
"""Windows from which an estimate begins, at least: one has no noise beside its own response."""
COHERENT: Final = 0.5
"""Least share of the friction in the bands that follows the drive."""
STATE_S: Final = 0.5
"""The estimate is told this often."""
LATELY: Final = 200
"""Windows of the last 10 s of sliding."""
MOST: Final = 1e15
MOST_DB: Final = 1e3
"""No number that is told is beyond: messages hold none that no finger has."""
ANOTHER: Final = 3
"""So many strange batches in a row are another finger; fewer are left out."""

Tell = Callable[[EstimateState], None]


class Tracker:
    """Follows the finger on one rig.

    Parameters
    ----------
    cutter : WindowCutter
        Of the rig's streams.
    prior : Prior
        Of a new person.
    rig : str
        Its name, for the document.

    Attributes
    ----------
    estimate : LawEstimate
        The newest.
    participant : str or None
        Pseudonym of whom the finger is taken to be of.
    new_fingers : int
        How often it began anew because nothing that was known fitted any more.
    """

    def __init__(self, cutter: WindowCutter, prior: Prior, rig: str = "") -> None:
        self._cutter = cutter
        self._prior = prior
        self._rig = rig
        self.participant: str | None = None
        n_bands = cutter.bands.centre_hz.size
        self.estimate = LawEstimate.begin(prior, n_bands)
        self.new_fingers = 0
        self._run = self._watched = self._watched_before = self._adapted_to = 0
        self._waiting: list[LawWindow] = []
        self._last: LawWindow | None = None
        self._rate_hz = 0.0
        self._strange = 0
        self._model = ModelInForce("", None)
        self._first: FloatArray | None = None
        self._speeds_mm_s = (np.inf, -np.inf)
        self._forces_n = (np.inf, -np.inf)
        self._lately_mm_s: deque[float] = deque(maxlen=LATELY)
        self._errors = {
            name: PrequentialError.begin(n_bands) for name in ("in_force", "first", "newest")
        }
        self._gain = PrequentialGain.begin()
        self._points = MeasuredPoints.begin(n_bands)
        self._watch = self._before_strange = ModelWatch.begin(cutter.mount)

    @property
    def in_force(self) -> FloatArray | None:
        """The model in force in `calibration.coordinates`; None where it is no law alone."""
        return None if self._model.effects else self._model.at

    @property
    def speeds_mm_s(self) -> tuple[float, float]:
        """Between which the finger slid in 80 % of the windows of the last 10 s of sliding."""
        if not self._lately_mm_s:
            return coordinates.LOW_MM_S, coordinates.HIGH_MM_S
        low, high = np.quantile(self._lately_mm_s, (0.1, 0.9)).tolist()
        return low, high

    @property
    def lifted(self) -> bool:
        """Whether the finger left the screen since the newest window that was used."""
        return self._last is not None and self._last.contact != self._cutter.contact

    @property
    def doubted(self) -> bool:
        """Whether the finger seems another than at the last change of the model.

        The newest that was felt is unlike what was known then; a batch is enough.
        """
        return self._strange > 0 or self.new_fingers != self._adapted_to

    @property
    def expected(self) -> LawEstimate:
        """What is known of the contact that is or, where it has ended, of the next one.

        The gain of the next one is the person's, and no better known than contacts are alike.
        """
        return advanced(self.estimate, 0.0, new_contact=True) if self.lifted else self.estimate

    @property
    def watched(self) -> int:
        """Windows of this finger by which the watch could find the rig, as it runs, wrong."""
        return self._watched

    @property
    def watched_before(self) -> int:
        """Likewise, of fingers before."""
        return self._watched_before

    @property
    def suspected(self) -> tuple[str, ...]:
        """What may be wrong with the rig, before it is an alarm."""
        return tuple(
            cause for cause in self._watch.suspected if cause not in self._model.effects
        )

    @property
    def provenance(self) -> dict[str, Any]:
        """What is said of a model that is made from the estimate."""
        return {
            "prior": self._prior.note,
            "windows": self.estimate.windows,
            "gain_spread_within_contacts": self.estimate.gain_scatter,
            "new_fingers": self.new_fingers,
            FITTED_TO: PERSON if self.lifted else CONTACT,
        }

    def begin_anew(self, prior: Prior, participant: str | None = None) -> None:
        """Forget the finger: another one is expected.

        Parameters
        ----------
        prior : Prior
            What is known of it beforehand.
        participant : str or None
            Pseudonym of whom it is of.
        """
        self._prior, self.participant = prior, participant
        self.estimate = of_another_finger(prior, self.estimate)
        self._waiting, self._last = [], None
        self._lately_mm_s.clear()
        self._forget_finger()
        self._strange = 0

    def _forget_finger(self) -> None:
        """Forget what was this finger's; a rig that was found wrong was not watched."""
        if INSTRUMENT.intersection(self._watch.raised):
            self._watched = self._watched_before = 0
        # What its first windows said against the rig was said of the finger before.
        watch = self._before_strange if self._strange else self._watch
        self._watch = watch.of_another_finger()
        self._watched, self._watched_before = 0, self._watched_before + self._watched
        self._speeds_mm_s = self._forces_n = (np.inf, -np.inf)

    def put_in_force(self, model: ModelInForce) -> None:
        """Compare with another model from now on; the same again changes nothing.

        Parameters
        ----------
        model : ModelInForce
            That the rig renders by.
        """
        if model.etag == self._model.etag:
            return
        delay_off_s = model.delay_off_s(self._model)
        self._model, self._adapted_to = model, self.new_fingers
        self._first = model.at if self._first is None else self._first
        self._errors["in_force"] = PrequentialError.begin(self._cutter.bands.centre_hz.size)
        self._gain = self._gain.without_noise_of("in_force")
        self._watch = self._watch.of_another_model(delay_off_s)

    def leave_out(self, reason: str) -> None:
        """Count something that could not be used.

        Parameters
        ----------
        reason : str
            Of a few: each is told with how often it was.
        """
        self._cutter.refused[reason] += 1

    def take(self, part: AlignedSamples) -> bool:
        """Take what was published; return whether the estimate is another.

        Parameters
        ----------
        part : AlignedSamples
            Of the streams `tracking.windows.STREAMS`.
        """
        if part.run != self._run:  # whoever mends a rig starts it anew
            self._watched = self._watched_before = 0
            self._watch = ModelWatch.begin(self._cutter.mount, self._watch.begun)
        self._run, self._rate_hz = part.run, part.sample_rate_hz
        changed = False
        for window in self._cutter.take(part):
            changed |= self._complete(window.contact)
            self._waiting.append(window)
            if len(self._waiting) == BATCH:
                changed |= self._update()
        return changed | self._complete(self._cutter.contact)

    def rest(self) -> bool:
        """Use the windows that wait for more; return whether the estimate is another."""
        return bool(self._waiting and self._update())

    def _complete(self, contact: int) -> bool:
        """Use the windows that wait, if they are of another contact."""
        return bool(self._waiting and self._waiting[0].contact != contact and self._update())

    def _update(self) -> bool:
        windows, self._waiting = self._waiting, []
        batch = Batch.of(windows, self._cutter.bands)
        if batch.coherence < COHERENT:
            self._cutter.refused["friction does not follow the drive"] += len(windows)
            return False
        if batch.opposes(self.estimate.mean):
            self._cutter.refused["friction falls where the drive has it rise"] += len(windows)
            return False
        if not self.estimate.updates and len(windows) < BEGINNING:
            self._cutter.refused["too short to begin with"] += len(windows)
            return False
        known, since, new_contact = self.estimate, 0.0, False
        if self._last is not None:
            since = abs(windows[-1].first_sample - self._last.first_sample) / self._rate_hz
            new_contact = windows[-1].contact != self._last.contact
            known = advanced(known, since, new_contact)
        known = known.sliding_at(batch.speed_mm_s)
        batch = batch.at_speeds_of(known.speeds)
        watch = self._watch
        self._judge(batch, known, since, new_contact)
        found, strange = updated(known, batch)
        if known.updates and strange:
            self._before_strange = self._before_strange if self._strange else watch
            self._strange += 1
            if self._strange < ANOTHER or len(windows) < BEGINNING:
                self._cutter.refused["unlike what was felt before"] += len(windows)
                return False
            self.new_fingers += 1
            found, _ = updated(of_another_finger(self._prior, known), batch)
            self._forget_finger()
        self._strange = 0
        self._last, self.estimate = windows[-1], found
        self._watched += len(windows) if self._model.at is not None else 0
        speeds, forces = (
            [getattr(window, name) for window in windows]
            for name in ("speed_mm_s", "normal_force_n")
        )
        self._speeds_mm_s = _widened(self._speeds_mm_s, speeds)
        self._forces_n = _widened(self._forces_n, forces)
        self._lately_mm_s.extend(speeds)
        return True

    def _judge(
        self, batch: Batch, known: LawEstimate, seconds: float, new_contact: bool
    ) -> None:
        """Predict a batch before it is used."""
        self._points = self._points.seen(batch)
        every = {"in_force": self._model.at, "first": self._first}
        models = {name: at for name, at in every.items() if at is not None}
        if known.updates:
            models["newest"] = known.mean
        for name, at in models.items():
            self._errors[name] = self._errors[name].judged(batch, at)
        if not known.updates or self._model.at is None:
            return
        self._gain = self._gain.judged(batch, models, known)
        self._watch = self._watch.seen(
            batch, self._model.at, known, seconds, new_contact, self._rate_hz
        )

    @property
    def alarms(self) -> tuple[NamedAlarm, ...]:
        """What is wrong with the model in force, the first with the most evidence."""
        return tuple(
            alarm
            for alarm in named_alarms(self._watch)
            if alarm.cause not in self._model.effects
        )

    def state(self, utc_ns: int) -> EstimateState:
        """Return what is published.

        Parameters
        ----------
        utc_ns : int
            UTC of this moment.
        """
        error = self._errors["in_force"]
        judged = zip(
            self._cutter.bands.centre_hz, error.band_db, error.band_half_width_db, strict=True
        )
        evidence = zip(CAUSES, self._watch.log_evidence, strict=True)
        rms = {name: error.rms_db for name, error in self._errors.items()}
        alarms, bands = self.alarms, self._cutter.bands
        return EstimateState(
            utc_ns=utc_ns,
            run=self._run,
            windows=self.estimate.windows,
            refused=dict(self._cutter.refused),
            new_fingers=self.new_fingers,
            model_etag=self._model.etag,
            participant=self.participant,
            law=_law_now(self.estimate) if self.estimate.updates else None,
            model=self.document(),
            in_force=self._model.values,
            points=self._points.points(bands.centre_hz, bands.lines),
            bands=tuple(
                BandRatio(centre_hz=centre, ratio_db=ratio, half_width_db=half)
                for centre, ratio, half in judged
                if abs(ratio) <= MOST_DB and half <= MOST_DB
            ),
            error_db={name: value for name, value in rms.items() if value <= MOST_DB},
            gain_nats={name: _told(nats) for name, nats in self._gain.nats.items()},
            evidence={
                cause: _told(nats)
                for cause, nats in evidence
                if cause not in self._model.effects
            },
            alarm_nats=ALARM,
            alarms=tuple(alarm.cause for alarm in alarms),
            advice={alarm.cause: advice_of(alarm) for alarm in alarms},
        )

    def document(self) -> Model | None:
        """Return the person's law as a document; None if nothing was felt, or it is no law."""
        if not self.estimate.updates:
            return None
        drive_vpp = 2.0 * self._cutter.screen_peak_v
        validity = Validity(
            speed_mm_s=self._speeds_mm_s,
            normal_force_n=self._forces_n,
            drive_vpp=(drive_vpp, drive_vpp),
        )
        told = {"source": "live", "rig": self._rig} | self.provenance | {FITTED_TO: PERSON}
        try:
            return coordinates.document(*self.estimate.person, self.participant, validity, told)
        except (EstimateError, ValueError):  # a cutoff that is not positive where it was felt
            return None


def _widened(span: tuple[float, float], values: list[float]) -> tuple[float, float]:
    return min(span[0], *values), max(span[1], *values)


def _told(value: float) -> float:
    """Return a number as messages hold it: what no rig sends can make it any."""
    return float(np.clip(value, -MOST, MOST))


def _law_now(estimate: LawEstimate) -> LawNow:
    ends = estimate.mean + np.multiply.outer([0.0, -1.0, 1.0], estimate.half_width)
    with np.errstate(over="ignore"):
        told = np.vstack([np.exp(ends[:, :3]).T, 1e6 * ends[:, 3]])
    at_20, at_100, gain, delay = (
        Interval(value=_told(value), low=_told(low), high=_told(high))
        for value, low, high in told
    )
    return LawNow(gain_n=gain, cutoff_20_hz=at_20, cutoff_100_hz=at_100, delay_us=delay)
