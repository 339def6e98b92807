"""Evidence that the model in force is wrong, valid whenever somebody looks at it.

For each cause an e-process: a likelihood ratio of the innovations (`tracking.innovations`),
averaged over both signs and over sizes beyond what is tolerated, against the model at the edge
of what is tolerated. Under a model within the tolerance its expectation is at most 1 at every
time, so that it ever exceeds 1/a has a chance of at most a (Ville's inequality). A process
begins every ten seconds, and they share what one would have: a change late in a session is
found as soon as one at its beginning.

Gain, cutoff and delay are judged against the model in force, the others free; effects against
any law at all; what is unknown against any law with any effects.

Ramdas, Grünwald, Vovk, Shafer 2023, Game-theoretic statistics and safe anytime-valid inference.
"""

from dataclasses import dataclass, replace
from typing import Final, Self

import numpy as np
from scipy.special import log_ndtr

from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.linear import TransferFunction
from frictus_service.tracking.innovations import (
    LAW,
    STATE,
    UNITS,
    WIDE,
    Nuisance,
    batch_score,
)
from frictus_service.tracking.law_estimate import GAIN_PER_CONTACT, Batch, LawEstimate
from frictus_service.tracking.mains_line import AMPLITUDES_N, line_evidence
from frictus_service.tracking.signatures import (
    EFFECT_CAUSES,
    INSTRUMENT,
    LAW_CAUSES,
    LAW_SIZES,
    PATTERN_SIZE,
    PATTERNS,
    SHAPED,
    SIZES,
    effect_directions,
    law_directions,
    pattern_directions,
)

__all__ = ["ALARM", "CAUSES", "INSTRUMENT", "Sums", "Watch", "log_ratio"]

MAINS: Final = "mains_interference"
UNKNOWN: Final = "unknown"
CAUSES: Final = (*LAW_CAUSES, *EFFECT_CAUSES, MAINS, UNKNOWN)
LEVEL: Final = 0.01
"""Chance that a session in which the model is right ever raises an alarm."""
ALARM: Final = float(np.log(len(CAUSES) / LEVEL))
"""Of a cause's log evidence: causes share the level."""
BEGIN_BATCHES: Final = 20
MOST: Final = 32
"""Processes of a cause that are followed; beyond, that with the least evidence ends."""
UNMODELLED: Final = 0.0015
"""Relative error of the response, rms over bands, that lasts and that no cause has: a window is
not infinitely long, the speed changes within it, and a mount rings."""
FLOOR: Final = -20.0
"""Nats; less is not told apart."""

_N_EFFECTS: Final = len(EFFECT_CAUSES)
_EDGE: Final = np.array(
    [SIZES[name].tolerated / SIZES[name].expected for name in EFFECT_CAUSES]
)
_LAW_EDGE: Final = np.array([size.tolerated / size.expected for size in LAW_SIZES])
_PATTERN_EDGE: Final = PATTERN_SIZE.tolerated / PATTERN_SIZE.expected


@dataclass(frozen=True, slots=True)
class Sums:
    """Score and information of each process so far.

    Attributes
    ----------
    score, information : ndarray, shapes (n_begun, d) and (n_begun, d, d)
        Of effects, against any law.
    law_score, law_information : ndarray, shapes (n_begun, n_law, d + 1) and so on
        Of effects and, last, of each of `LAW_CAUSES`, against the model in force.
    pattern_score, pattern_information : ndarray, shape (n_begun, n_patterns)
    mains : ndarray, shape (n_begun, 2, n_amplitudes)
        Log likelihood ratios.
    certainty : ndarray, shape (n_begun,)
        Of all responses: inverse relative variances.
    log_share, law_log_share : ndarray, shape (n_begun,)
        Of the chance of an alarm, that each process has; of `LAW_CAUSES` only those count
        that began with the model in force or later.
    """

    score: FloatArray
    information: FloatArray
    law_score: FloatArray
    law_information: FloatArray
    pattern_score: FloatArray
    pattern_information: FloatArray
    mains: FloatArray
    certainty: FloatArray
    log_share: FloatArray
    law_log_share: FloatArray

    @classmethod
    def zeros(cls, count: int) -> Self:
        """Return the sums of so many processes that begin.

        Parameters
        ----------
        count : int
            Of processes.
        """
        d, patterns, law = _N_EFFECTS, len(PATTERNS), len(LAW_CAUSES)
        shapes: tuple[tuple[int, ...], ...] = (
            (d,),
            (d, d),
            (law, d + 1),
            (law, d + 1, d + 1),
            (patterns,),
            (patterns,),
            (2, AMPLITUDES_N.size),
            (),
            (),
            (),
        )
        return cls(*(np.zeros((count, *shape)) for shape in shapes))

    def arrays(self) -> tuple[FloatArray, ...]:
        """Return all of them, in order."""
        return tuple(getattr(self, name) for name in self.__slots__)

    def log_evidence(self) -> FloatArray:
        """Return log share times ratio, shape (n_begun, n_causes)."""
        slack = self.slack(_diagonal(self.information)) * SHAPED
        effects = log_ratio(self.score, _diagonal(self.information), _EDGE, slack)
        law = log_ratio(self.law_score[..., -1], self.law_information[..., -1, -1], _LAW_EDGE)
        unknown = _mean(self.patterns())
        mains = _mean(self.mains.reshape(self.mains.shape[0], -1))
        shared = np.column_stack([effects, mains, unknown]) + self.log_share[:, np.newaxis]
        return np.column_stack([law + self.law_log_share[:, np.newaxis], shared])

    def patterns(self) -> FloatArray:
        """Return the log likelihood ratio of each pattern, shape (n_begun, n_patterns)."""
        information = self.pattern_information
        return log_ratio(
            self.pattern_score, information, _PATTERN_EDGE, self.slack(information)
        )

    def slack(self, information: FloatArray) -> FloatArray:
        """Return how large a score errors of `UNMODELLED` can make at most (Cauchy-Schwarz).

        Parameters
        ----------
        information : ndarray, shape (n_begun, d)
            Of each deviation.
        """
        both = self.certainty[:, np.newaxis] * np.maximum(information, 0.0)
        bound: FloatArray = UNMODELLED * np.sqrt(both)
        return bound


@dataclass(frozen=True, slots=True)
class Watch:
    """The processes so far.

    Attributes
    ----------
    mount : TransferFunction or None
        Nominal, between screen and force sensor.
    batches : int
        Since a process began.
    begun : int
        Processes that have begun in the session, ended ones too.
    began_minutes : float
        Of the device, at the first batch; drifts count from there.
    filters : tuple of Nuisance
        With the law free; with each of `LAW_CAUSES` held; with law and effects free. Empty
        before the first batch.
    sums : Sums
        Of all processes.
    log_evidence : ndarray, shape (n_causes,)
        Of each of `CAUSES`, nats.
    raised : tuple of str
        Causes whose evidence has reached `ALARM`.
    """

    mount: TransferFunction | None
    batches: int
    begun: int
    began_minutes: float
    filters: tuple[Nuisance, ...]
    sums: Sums
    log_evidence: FloatArray
    raised: tuple[str, ...]

    @classmethod
    def begin(cls, mount: TransferFunction | None = None, begun: int = 0) -> Self:
        """Return the watch over a finger that was just put on the screen.

        Parameters
        ----------
        mount : TransferFunction or None
            Nominal, between screen and force sensor.
        begun : int
            Processes that have begun in the session before.
        """
        nothing = np.zeros(len(CAUSES))
        return cls(mount, 0, begun, 0.0, (), Sums.zeros(0), nothing, ())

    def of_another_model(self) -> Self:
        """Return the watch over another model, on the same finger.

        What was seen of effects remains: it does not depend on the law in force.
        """
        ended = np.full_like(self.sums.log_share, -np.inf)
        sums = replace(self.sums, law_log_share=ended)
        law = np.zeros(len(LAW_CAUSES))
        evidence = np.concatenate([law, self.log_evidence[law.size :]])
        filters = self.filters[:1] + self.filters[-1:]
        return replace(
            self, batches=0, filters=filters, sums=sums, log_evidence=evidence, raised=()
        )

    def seen(
        self,
        batch: Batch,
        at: FloatArray,
        estimate: LawEstimate,
        seconds: float = 0.5,
        new_contact: bool = False,
        sample_rate_hz: float = 20_000.0,
    ) -> Self:
        """Return the watch after one more batch.

        Parameters
        ----------
        batch : Batch
            That the estimate has not seen.
        at : ndarray, shape (4,)
            The model in force, in `calibration.coordinates`.
        estimate : LawEstimate
            Before the batch.
        seconds : float
            Since the batch before.
        new_contact : bool
            Whether the finger left the screen meanwhile.
        sample_rate_hz : float
            Samples per second of the device's clock.
        """
        first = float(batch.conditions.minutes[0])
        began = self.began_minutes if self.filters else first
        filters = _begun(self.filters, at, estimate)
        filters = tuple(each.advanced(seconds, new_contact) for each in filters)
        own = law_directions(at) / UNITS
        filters, (*news, certainty) = _innovations(
            batch, filters, estimate, own, self.mount, began
        )
        none = np.zeros(())
        news += [line_evidence(batch, estimate, sample_rate_hz), certainty, none, none]
        sums, begun = self.sums, self.begun
        if self.batches % BEGIN_BATCHES == 0:
            begun += 1
            sums = _with_another(sums, begun)
        sums = Sums(*(each + new for each, new in zip(sums.arrays(), news, strict=True)))
        each = sums.log_evidence()
        if each.shape[0] > MOST:
            kept = np.arange(each.shape[0]) != np.argmin(each.max(axis=1))
            sums, each = Sums(*(array[kept] for array in sums.arrays())), each[kept]
        evidence = np.maximum(np.logaddexp.reduce(each, axis=0), FLOOR)
        fresh = [
            cause
            for cause, nats in zip(CAUSES, evidence, strict=True)
            if nats >= ALARM and cause not in self.raised
        ]
        return replace(
            self,
            batches=self.batches + 1,
            begun=begun,
            began_minutes=began,
            filters=filters,
            sums=sums,
            log_evidence=evidence,
            raised=(*self.raised, *fresh),
        )


def _begun(
    filters: tuple[Nuisance, ...], at: FloatArray, estimate: LawEstimate
) -> tuple[Nuisance, ...]:
    """Return the filters, those that there are not yet at their beginning."""
    if len(filters) == 2 + len(LAW_CAUSES):
        return filters
    sd = np.array([WIDE, WIDE, WIDE, 5.0 * WIDE, GAIN_PER_CONTACT])
    free = np.append(estimate.mean / UNITS, 0.0)
    held = []
    for cause, own in zip(LAW_CAUSES, law_directions(at), strict=True):
        fixed = np.append(own != 0.0, False)
        mean = np.where(fixed, np.append(at / UNITS, 0.0), free)
        begun = Nuisance.begin(mean, np.where(fixed, 0.0, sd), _N_EFFECTS + 1)
        if cause == "speed_dependent_cutoff":  # both ends may be off, alike
            begun.covariance[:2, :2] = WIDE**2
        held.append(begun)
    if filters:
        return (filters[0], *held, filters[-1])
    effects = np.zeros(_N_EFFECTS)
    everything = Nuisance.begin(
        np.concatenate([free, effects]), np.concatenate([sd, effects + 2.0]), len(PATTERNS)
    )
    return (Nuisance.begin(free, sd, _N_EFFECTS), *held, everything)


def _innovations(
    batch: Batch,
    filters: tuple[Nuisance, ...],
    estimate: LawEstimate,
    own: FloatArray,
    mount: TransferFunction | None,
    began_minutes: float,
) -> tuple[tuple[Nuisance, ...], tuple[FloatArray, ...]]:
    """Return the filters after a batch, and what is added to `Sums` (without `mains`)."""
    effects = effect_directions(batch, estimate.mean, mount, began_minutes)
    further = np.concatenate([effects, pattern_directions(batch)], axis=-1)
    score, information, certainty = batch_score(batch, estimate, further)
    at = np.append(estimate.mean / UNITS, 0.0)
    # The gain's wandering has the column of the gain.
    place = np.array([0, 1, 2, 3, 2, *range(LAW, LAW + _N_EFFECTS + len(PATTERNS))])
    score, information = score[place], information[np.ix_(place, place)]
    small = STATE + _N_EFFECTS
    free, *held, everything = filters
    free, pulled, known = free.seen(score[:small], information[:small, :small], at)
    after, scores, informations = [], [], []
    for each, direction in zip(held, own, strict=True):
        turn = np.eye(small + 1, small)
        turn[-1, :LAW] = direction
        seen = turn @ information[:small, :small] @ turn.T
        new, of_law, known_of_law = each.seen(turn @ score[:small], seen, at)
        after.append(new)
        scores.append(of_law)
        informations.append(known_of_law)
    none = np.concatenate([at, np.zeros(_N_EFFECTS)])
    everything, patterns, known_of_patterns = everything.seen(score, information, none)
    sums = (
        pulled,
        known,
        np.array(scores),
        np.array(informations),
        patterns,
        np.diag(known_of_patterns),
        np.array(certainty),
    )
    return (free, *after, everything), sums


def _with_another(sums: Sums, begun: int) -> Sums:
    """Return the sums with those of a process that begins."""
    # The shares 6 / (pi k)^2 of all that will ever begin sum to 1.
    share = np.log(6.0) - 2.0 * np.log(np.pi * begun)
    fresh = replace(Sums.zeros(1), log_share=np.full(1, share), law_log_share=np.full(1, share))
    both = zip(sums.arrays(), fresh.arrays(), strict=True)
    return Sums(*(np.concatenate(pair) for pair in both))


def log_ratio(
    score: FloatArray,
    information: FloatArray,
    edge: FloatArray | float,
    slack: FloatArray | float = 0.0,
) -> FloatArray:
    """Return the log of the likelihood ratio, averaged over both signs and half-normal sizes.

    Parameters
    ----------
    score, information : ndarray
        Of a deviation per its expected size.
    edge : float or ndarray
        Of what is tolerated, likewise.
    slack : float or ndarray
        Part of the score that may be an error that lasts.
    """
    information = np.maximum(information, 0.0)
    width = 1.0 + information
    sides = np.stack([score, -score]) - edge * information - slack
    each = 0.5 * np.square(sides) / width + log_ndtr(sides / np.sqrt(width))
    ratio: FloatArray = np.logaddexp.reduce(each, axis=0) - 0.5 * np.log(width)
    return ratio


def _mean(log_ratios: FloatArray) -> FloatArray:
    """Return the log of the mean of ratios, shape (n_begun,)."""
    mean: FloatArray = np.logaddexp.reduce(log_ratios, axis=1) - np.log(log_ratios.shape[1])
    return mean


def _diagonal(matrices: FloatArray) -> FloatArray:
    return np.diagonal(matrices, axis1=-2, axis2=-1)
