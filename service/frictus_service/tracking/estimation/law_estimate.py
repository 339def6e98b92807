"""The law of the finger on the screen now: Kalman filters over windows, made linear at one law.

What may vary between updates is in `finger_filters`. Each update takes the windows of
half a second as `calibration.score_information` scores trials: the gain of a window wanders
about that of its contact.

All updates are linear about one law. Were each about its own, a direction along which little is
known, as that of a line's cutoff and delay, would turn from one to the next and so be taken to
be known (Huang, Mourikis, Roumeliotis 2010, Observability-based rules for designing consistent
EKF SLAM estimators). Once the estimate is off that law, what was felt is seen anew about the
estimate, which is a step of Gauss-Newton over all of it (Bell 1994, The iterated Kalman
smoother as a Gauss-Newton method).
"""

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Final, Self

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_service.calibration import coordinates
from frictus_service.calibration.coordinates import Prior
from frictus_service.calibration.posterior import STRANGE, wandered
from frictus_service.calibration.score_information import (
    Data,
    GainScatter,
    scores,
    spread_of,
)
from frictus_service.tracking.estimation.batch import Batch
from frictus_service.tracking.estimation.finger_filters import FELT, NOW, PERSON, FingerFilters
from frictus_service.tracking.estimation.speed_spread import SpeedSpread
from frictus_service.tracking.estimation.strokes import Strokes

RESPONSE_WITHIN: Final = 1e-3
"""Relative error of a response that no average makes smaller: a band's mean speed stands for
those within it, and a window is not infinitely long."""
GAIN_WITHIN: Final = 4e-4
"""Likewise of a gain. Friction is projected on the motion that touch reports tell, which
resolve no tremor: 0.02 mm across the stroke at 10 Hz are 1.3 mm/s, which turn friction away at
50 mm/s by an angle whose cosine is so much below 1."""
HIGHEST_HZ: Final = 1e3
"""About the highest band that a texture drives: what it tells of a cutoff and of a delay."""
CUTOFF_PER_WINDOW: Final = 0.01
"""Standard deviation of ln cutoff between windows: their speed is not known exactly."""
FORGETTING: Final = 0.05
"""Share of an update in the noise, once it is known."""
LEAST_NOISE_N2: Final = 1e-12
NEAR: Final = 0.03
"""Of ln cutoff, within which a law is nearly linear: responses are then off by 1e-4."""
UNLIKE: Final = 7.0
"""Nats by which a batch is likelier of another finger than of the one that is known, from which
on it is strange. Of one that was alike for long a change within what people scatter by is so,
too: it is taken to have begun to scatter only where nothing else explains it. A finger whose
contacts and strokes do scatter had 2 nats at most within minutes."""
MOST_FELT: Final = 120
"""Batches, a minute of sliding, that can be seen anew."""
SHARE_ANEW: Final = 0.25
"""So many batches must have come since, for each that is seen anew: that bounds the cost."""
_STEPS: Final = 12
_FURTHEST: Final = np.array([0.5, 0.5, 0.5, 50e-6])
"""Longest step of Gauss-Newton."""
_GAIN: Final = np.array([False, False, True, False])


@dataclass(frozen=True, slots=True)
class Felt:
    """A batch as it came.

    Attributes
    ----------
    seconds : float
        Since the one before.
    new_contact : bool
        Whether the finger left the screen meanwhile.
    batch : Batch
        What was felt.
    """

    seconds: float
    new_contact: bool
    batch: Batch


@dataclass(frozen=True)
class LawEstimate:
    """What is known of the law.

    Attributes
    ----------
    prior : Prior
        Of a new person.
    filters : FingerFilters
        Of the person's law, and of how far off it this contact is.
    noise_n2 : ndarray, shape (n_bands,)
        Power of what the law does not explain of the friction, per frequency; NaN before the
        first update.
    gain_scatter : float
        Standard deviation of ln gain between windows of one contact.
    updates, windows : int
        That made it.
    last_direction, last_minutes : float
        Of the last window, by which strokes are told; 0 before the first.
    speeds : SpeedSpread
        Of the windows.
    tangent_at : ndarray, shape (4,), or None
        About which law updates are linear; None before the first.
    felt : tuple of Felt
        What it is made of, up to `MOST_FELT`.
    seen_anew : int
        Batches that it was made of when they were seen anew.
    seconds, new_contact : float, bool
        Since the last update.
    """

    prior: Prior
    filters: FingerFilters
    noise_n2: FloatArray
    gain_scatter: float
    updates: int
    windows: int
    last_direction: float = 0.0
    last_minutes: float = 0.0
    speeds: SpeedSpread = field(default_factory=SpeedSpread)
    tangent_at: FloatArray | None = None
    felt: tuple[Felt, ...] = ()
    seen_anew: int = 0
    seconds: float = 0.0
    new_contact: bool = False

    @classmethod
    def begin(cls, prior: Prior, n_bands: int) -> Self:
        """Return what is known before anything was felt.

        Parameters
        ----------
        prior : Prior
            Of a new person.
        n_bands : int
            Of the windows.
        """
        nothing = np.full(n_bands, np.nan)
        return cls(prior, FingerFilters.begin(prior), nothing, 0.02, 0, 0)

    @property
    def mean(self) -> FloatArray:
        """The law of this contact in `calibration.coordinates`, shape (4,)."""
        return self._now[0]

    @property
    def covariance(self) -> FloatArray:
        """Covariance of `mean`, shape (4, 4)."""
        return self._now[1]

    @cached_property
    def _now(self) -> tuple[FloatArray, FloatArray]:
        return self._known(NOW)

    @cached_property
    def person(self) -> tuple[FloatArray, FloatArray]:
        """The person's law, about which contacts lie: mean (4,) and covariance (4, 4)."""
        return self._known(PERSON)

    def _known(self, combination: FloatArray) -> tuple[FloatArray, FloatArray]:
        mean, covariance = self.filters.of(combination)
        cutoff = np.exp(mean[:2])
        least = RESPONSE_WITHIN * np.append(
            np.hypot(cutoff / HIGHEST_HZ, 1.0), [0.0, 0.5 / np.pi / HIGHEST_HZ]
        )
        least[2] = GAIN_WITHIN
        ends = np.array([coordinates.LOW_MM_S, coordinates.HIGH_MM_S])
        slope = (cutoff[1] - cutoff[0]) / (ends[1] - ends[0])
        steeper = self.speeds.attenuation * slope * (ends - self.speeds.mean_mm_s) / cutoff
        flat = np.append(steeper, [0.0, 0.0])
        return mean, covariance + np.diag(np.square(least)) + np.outer(flat, flat)

    def sliding_at(self, speed_mm_s: FloatArray) -> Self:
        """Return what is known, of a finger that slid at further speeds.

        Parameters
        ----------
        speed_mm_s : ndarray, shape (n_windows,)
            Of windows that are about to be used.
        """
        return replace(self, speeds=self.speeds.seen(speed_mm_s))

    @property
    def half_width(self) -> FloatArray:
        """Half of the central 95 % interval of each coordinate, shape (4,)."""
        half: FloatArray = 1.96 * np.sqrt(np.diag(self.covariance))
        return half


def of_another_finger(prior: Prior, known: LawEstimate) -> LawEstimate:
    """Return what is known of another finger on the same rig: nothing but the delay.

    The delay is the rig's, and so what was known of it holds.

    Parameters
    ----------
    prior : Prior
        Of the other finger.
    known : LawEstimate
        Of the finger before.
    """
    if known.updates:
        mean, covariance = known.filters.of(NOW)
        prior = prior.with_delay(float(mean[3]), float(covariance[3, 3]))
    return LawEstimate.begin(prior, known.noise_n2.size)


def advanced(estimate: LawEstimate, seconds: float, new_contact: bool) -> LawEstimate:
    """Return what is still known after some time.

    Parameters
    ----------
    estimate : LawEstimate
        After the last update.
    seconds : float
        Since the last update.
    new_contact : bool
        Whether the finger left the screen meanwhile.
    """
    return replace(
        estimate,
        filters=estimate.filters.advanced(seconds, new_contact),
        seconds=seconds,
        new_contact=new_contact,
    )


def updated(estimate: LawEstimate, batch: Batch) -> tuple[LawEstimate, bool]:
    """Return what is known after a batch, and whether the batch was strange.

    Parameters
    ----------
    estimate : LawEstimate
        Advanced to the batch.
    batch : Batch
        Windows that it has not seen.

    Returns
    -------
    LawEstimate
    bool
        Whether it is hardly of the same finger: its squared distance from what was expected is
        above `calibration.posterior.STRANGE`, or another one is likelier by `UNLIKE`.
    """
    found, strange = _seen(estimate, batch)
    mean, _ = found.filters.of(PERSON)
    if _is_near(found, mean):
        return found, strange
    if len(found.felt) == MOST_FELT:
        return replace(found, tangent_at=mean), strange
    if found.updates - found.seen_anew < SHARE_ANEW * found.updates:
        return found, strange
    return _seen_anew(found, mean), strange


def _is_near(estimate: LawEstimate, at: FloatArray) -> bool:
    """Return whether updates are linear about a law, at the speeds that were felt."""
    assert estimate.tangent_at is not None
    speeds = estimate.speeds
    span = np.sqrt(speeds.variance) * np.array([-1.0, 1.0])
    around = np.clip(speeds.mean_mm_s + span, coordinates.LOW_MM_S, coordinates.HIGH_MM_S)
    now, linear = (coordinates.cutoff_hz(each, around) for each in (at, estimate.tangent_at))
    return bool(np.abs(np.log(now / linear)).max() <= NEAR)


def _seen_anew(estimate: LawEstimate, tangent_at: FloatArray) -> LawEstimate:
    """Return what is known of all that was felt, linear about another law."""
    begun = LawEstimate.begin(estimate.prior, estimate.noise_n2.size)
    found = replace(begun, speeds=estimate.speeds, tangent_at=tangent_at)
    for each in estimate.felt:
        found, _ = _seen(advanced(found, each.seconds, each.new_contact), each.batch)
    return replace(found, seen_anew=found.updates)


def _seen(estimate: LawEstimate, batch: Batch) -> tuple[LawEstimate, bool]:
    noise = estimate.noise_n2
    if not estimate.updates:
        noise = np.maximum(_scatter(batch), LEAST_NOISE_N2)
    mean, covariance = estimate.filters.of(FELT)
    information = coordinates.inverse(covariance)
    strokes = Strokes.of(batch.conditions, estimate.last_direction, estimate.last_minutes)
    data, weights = (
        batch.rows(noise, mean, strokes.part),
        np.ones(np.count_nonzero(batch.heard)),
    )
    at = mean
    for _ in range(2):  # scatter from the fit, weights from the scatter
        at = _settle(data, at, estimate.gain_scatter, weights, mean, information)
        scatter, weights = spread_of(data, at)
    tangent_at = at if estimate.tangent_at is None else estimate.tangent_at
    # A law is linear in its gain, which no direction of the others turns with.
    linear = np.where(_GAIN, at, tangent_at)
    filters, another = estimate.filters, of_another_finger(estimate.prior, estimate).filters
    strange, unlike = 0.0, 0.0
    of_parts = _scores(data, linear, estimate.gain_scatter, weights)
    for begins, score, own in zip(strokes.begins, *of_parts, strict=True):
        if begins:
            filters, another = (each.of_another_stroke() for each in (filters, another))
        filters, likely, away = filters.seen(score, own, linear)
        another, otherwise, _ = another.seen(score, own, linear)
        strange, unlike = max(strange, away), unlike + otherwise - likely
    share = max(1.0 / (estimate.updates + 1), FORGETTING)
    left = batch.unexplained(batch.law_response(at)).mean(axis=0)
    segment = (1.0 - share) * estimate.gain_scatter**2 + share * scatter.segment**2
    felt = Felt(estimate.seconds, estimate.new_contact, batch)
    found = replace(
        estimate,
        filters=filters,
        noise_n2=np.maximum((1.0 - share) * noise + share * left, LEAST_NOISE_N2),
        gain_scatter=float(np.clip(np.sqrt(segment), 1e-3, 1.0)),
        updates=estimate.updates + 1,
        windows=estimate.windows + batch.speed_mm_s.size,
        last_direction=float(batch.conditions.direction[-1]),
        last_minutes=float(batch.conditions.minutes[-1]),
        tangent_at=tangent_at,
        felt=(*estimate.felt, felt)[:MOST_FELT],
        seconds=0.0,
        new_contact=False,
    )
    return found, strange > STRANGE or unlike > UNLIKE


def _settle(
    data: Data,
    at: FloatArray,
    gain_scatter: float,
    weights: FloatArray,
    mean: FloatArray,
    information: FloatArray,
) -> FloatArray:
    """Return where Gauss-Newton ends."""
    for _ in range(_STEPS):
        score, own = _scores(data, at, gain_scatter, weights)
        total = own.sum(axis=0) + information
        step = np.linalg.solve(total, score.sum(axis=0) + information @ (mean - at))
        step /= max(1.0, float(np.max(np.abs(step) / _FURTHEST)))
        at = at + step
        if step @ total @ step < 1e-4:
            break
    return at


def _scores(
    data: Data, at: FloatArray, gain_scatter: float, weights: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return score and information of each part in a stroke, (n_parts, 4) and (n_parts, 4, 4).

    Gain and cutoff differ from window to window.
    """
    each = replace(data, trial_of_segment=np.arange(data.n_segments))
    score, own = scores(each, at, GainScatter(gain_scatter, 0.0), weights)
    _, score, own = wandered(score, own, CUTOFF_PER_WINDOW)
    begins = np.flatnonzero(np.diff(data.trial_of_segment, prepend=-1))
    return np.add.reduceat(score, begins), np.add.reduceat(own, begins)


def _scatter(batch: Batch) -> FloatArray:
    """Return the noise of a first batch: what its own mean response leaves."""
    power = batch.drive_power.sum(axis=0)
    own = batch.cross.sum(axis=0) / np.maximum(power, np.finfo(float).tiny)
    scatter: FloatArray = batch.unexplained(np.broadcast_to(own, batch.cross.shape)).mean(0)
    return scatter
