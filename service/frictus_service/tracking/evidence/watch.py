"""Evidence that the model in force is wrong, valid whenever somebody looks at it.

For each cause an e-process: a likelihood ratio of the innovations (`innovations`),
averaged over both signs and over sizes beyond what is tolerated, against the model at the edge
of what is tolerated. Under a model within the tolerance its expectation is at most 1 at every
time, so that it ever exceeds 1/a has a chance of at most a (Ville's inequality). A process
begins every ten seconds, and they share what one would have: a change late in a session is
found as soon as one at its beginning.

Gain, cutoff and delay are judged against the model in force, the others free; effects against
any law at all; what is unknown against any law with any effects.

Ramdas, Grünwald, Vovk, Shafer 2023, Game-theoretic statistics and safe anytime-valid inference.
"""

from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import Final, Self

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.linear import TransferFunction
from frictus_service.tracking.estimation.batch import Batch
from frictus_service.tracking.estimation.finger_filters import COLUMNS, LAW, STATE
from frictus_service.tracking.estimation.law_estimate import LawEstimate
from frictus_service.tracking.estimation.strokes import Strokes
from frictus_service.tracking.evidence.innovations import (
    UNITS,
    WIDE,
    Nuisance,
    batch_score,
)
from frictus_service.tracking.evidence.mains_line import line_evidence
from frictus_service.tracking.evidence.signatures import (
    EFFECT_CAUSES,
    INSTRUMENT,
    LAW_CAUSES,
    LAW_SIZES,
    NOT_FITTED,
    PATTERNS,
    effect_directions,
    law_directions,
    pattern_directions,
)
from frictus_service.tracking.evidence.sums import Sums, with_another

__all__ = ["ALARM", "CAUSES", "INSTRUMENT", "ModelWatch"]

MAINS: Final = "mains_interference"
UNKNOWN: Final = "unknown"
CAUSES: Final = (*LAW_CAUSES, *EFFECT_CAUSES, MAINS, UNKNOWN)
LEVEL: Final = 0.01
"""Chance that a session in which the model is right ever raises an alarm."""
ALARM: Final = float(np.log(len(CAUSES) / LEVEL))
"""Of a cause's log evidence: causes share the level."""
SUSPECTED: Final = 0.5 * ALARM
"""Nats from which on a cause of the rig, or one like it, is waited for. While the rig is right
one cause ever reaches them in at most 2.4 % of sessions."""
WITHDRAWN: Final = 0.0
"""Nats below which an alarm ends: what came since speaks against its cause as clearly as what
raised it spoke for it. A gain that falls within one stroke follows the position there; for
causes that lasted the evidence stayed above 3."""
BEGIN_BATCHES: Final = 20
MOST: Final = 32
"""Processes of a cause that are followed; beyond, that with the least evidence ends."""
FLOOR: Final = -20.0
"""Nats; less is not told apart."""

_N_EFFECTS: Final = len(EFFECT_CAUSES)


@dataclass(frozen=True, slots=True)
class ModelWatch:
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
        Causes whose evidence has reached `ALARM`, and was not below `WITHDRAWN` since.
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

    def of_another_model(self, delay_off_s: float) -> Self:
        """Return the watch over another model, on the same rig and finger.

        What was seen of effects remains: it does not depend on the law in force. So does what
        was seen of the delay, where the two models tell the same.

        Parameters
        ----------
        delay_off_s : float
            Of the model from that before, s.
        """
        as_late = abs(delay_off_s) <= LAW_SIZES[LAW_CAUSES.index("delay")].tolerated
        judged_anew = set(LAW_CAUSES) - ({"delay"} if as_late else set())
        return self._without(judged_anew, self.filters[:1] + self.filters[-1:])

    def of_another_finger(self) -> Self:
        """Return the watch over another finger on the same rig: what was the rig's remains."""
        return self._without(set(CAUSES) - INSTRUMENT, ())

    def _without(self, causes: Collection[str], filters: tuple[Nuisance, ...]) -> Self:
        """Return the watch in which some causes are judged by what comes from now on.

        An alarm of the rig stays, any other returns with the next batch if its evidence does.
        """
        kept = np.array([cause not in causes for cause in CAUSES])
        shares = np.where(kept, self.sums.log_share, -np.inf)
        return replace(
            self,
            batches=0,
            filters=filters,
            sums=replace(self.sums, log_share=shares),
            log_evidence=np.where(kept, self.log_evidence, 0.0),
            raised=tuple(name for name in self.raised if name in INSTRUMENT - set(causes)),
        )

    @property
    def suspected(self) -> tuple[str, ...]:
        """Causes of the rig, or like them, with an alarm, or half of the evidence for one."""
        return tuple(
            cause
            for cause, nats in zip(CAUSES, self.log_evidence, strict=True)
            if cause in NOT_FITTED and nats >= SUSPECTED
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
        strokes = Strokes.of(batch.conditions, estimate.last_direction, estimate.last_minutes)
        filters = tuple(
            each.advanced(seconds, new_contact, bool(strokes.begins[0])) for each in filters
        )
        own = law_directions(at) / UNITS
        filters, (*news, certainty) = _innovations(
            batch, strokes, filters, estimate, own, self.mount, began
        )
        none = np.zeros(())
        news += [line_evidence(batch, estimate, sample_rate_hz), certainty, none]
        sums, begun = self.sums, self.begun
        if self.batches % BEGIN_BATCHES == 0:
            begun += 1
            sums = with_another(sums, begun)
        sums = Sums(*(each + new for each, new in zip(sums.arrays(), news, strict=True)))
        each = sums.log_evidence()
        if each.shape[0] > MOST:
            kept = np.arange(each.shape[0]) != np.argmin(each.max(axis=1))
            sums, each = Sums(*(array[kept] for array in sums.arrays())), each[kept]
        evidence = np.maximum(np.logaddexp.reduce(each, axis=0), FLOOR)
        nats = dict(zip(CAUSES, evidence.tolist(), strict=True))
        lasting = [cause for cause in self.raised if nats[cause] >= WITHDRAWN]
        fresh = [cause for cause in CAUSES if nats[cause] >= ALARM and cause not in self.raised]
        return replace(
            self,
            batches=self.batches + 1,
            begun=begun,
            began_minutes=began,
            filters=filters,
            sums=sums,
            log_evidence=evidence,
            raised=(*lasting, *fresh),
        )


def _begun(
    filters: tuple[Nuisance, ...], at: FloatArray, estimate: LawEstimate
) -> tuple[Nuisance, ...]:
    """Return the filters, those that there are not yet at their beginning."""
    if len(filters) == 2 + len(LAW_CAUSES):
        return filters
    sd = np.array([WIDE, WIDE, WIDE, 5.0 * WIDE])
    free = estimate.mean / UNITS
    held = []
    for cause, own in zip(LAW_CAUSES, law_directions(at), strict=True):
        fixed = own != 0.0
        mean = np.where(fixed, at / UNITS, free)
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
    strokes: Strokes,
    filters: tuple[Nuisance, ...],
    estimate: LawEstimate,
    own: FloatArray,
    mount: TransferFunction | None,
    began_minutes: float,
) -> tuple[tuple[Nuisance, ...], tuple[FloatArray, ...]]:
    """Return the filters after a batch, and what is added to `Sums` (without `mains`)."""
    effects = effect_directions(batch, estimate.mean, mount, began_minutes)
    further = np.concatenate([effects, pattern_directions(batch)], axis=-1)
    scores, informations, certainty = batch_score(batch, estimate, further, strokes.part)
    places = np.append(COLUMNS, np.arange(LAW, LAW + _N_EFFECTS + len(PATTERNS)))
    at = np.concatenate([estimate.mean / UNITS, np.zeros(STATE - LAW)])
    sums: tuple[FloatArray, ...] = ()
    for number, (score, information) in enumerate(zip(scores, informations, strict=True)):
        if number:
            filters = tuple(each.advanced(0.0, False, True) for each in filters)
        filters, news = _of_a_part(
            score[places], information[np.ix_(places, places)], filters, at, own
        )
        sums = tuple(map(np.add, sums, news)) if sums else news
    return filters, (*sums, np.array(certainty))


def _of_a_part(
    score: FloatArray,
    information: FloatArray,
    filters: tuple[Nuisance, ...],
    at: FloatArray,
    own: FloatArray,
) -> tuple[tuple[Nuisance, ...], tuple[FloatArray, ...]]:
    """Return the filters after a part of a batch in one stroke, and what it says."""
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
    return (free, *after, everything), (
        pulled,
        known,
        np.array(scores),
        np.array(informations),
        patterns,
        np.diag(known_of_patterns),
    )
