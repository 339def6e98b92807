"""Whether what was learned is put in force: the bounds of a model that follows the finger.

The estimate replaces gain and cutoff of the model in force where it is known well, where the
model in force is not, and where nothing else happens that such a change would spoil. What is
the rig's (the delay of its channels) never goes into a finger's law.
"""

from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from frictus.errors import FrictusError
from frictus.model import FirstOrderSpeedLaw, Model
from frictus_hardware.arrays import FloatArray
from frictus_service.calibration import coordinates
from frictus_service.calibration.coordinates import Prior
from frictus_service.errors import EstimateError
from frictus_service.tracking.adaptation import ADAPT_EVERY_S, CONTACT, FITTED_TO
from frictus_service.tracking.estimation.law_estimate import LawEstimate
from frictus_service.tracking.evidence.advice import later
from frictus_service.tracking.evidence.signatures import (
    LAW_CAUSES,
    LAW_SIZES,
    NOT_FITTED,
    SHAPED_BY_A_FINGER,
)
from frictus_service.tracking.tracker import Tracker

KNOWN_WITHIN: Final = 0.05
"""Half of the 95 % interval of gain and cutoff at the speeds that were explored."""
WATCHED_WINDOWS: Final = 50
"""So long the watch has to tell a rig that is wrong from a finger: delay, mount and mains were
named within 6 s of free strokes, of which a third is used."""
WATCHED_AGAIN: Final = 20
"""Of another finger without notice, on a rig that was watched before: it may be the rig that
became another."""
WITHIN_SD: Final = 3.0
"""Standard deviations of the population within which a finger is believed."""
DIFFERENT: Final = 16.0
"""Squared distance of the model in force from the estimate, in standard deviations: at least.
Of three values that are right it exceeds this with a chance of 0.1 %."""
LEAST_DB: Final = 0.05
"""A rendering that differs by less is left as it is."""
FRESH_S: Final = 2.0
"""What was felt longer ago may have been another finger."""
FELT_HZ: Final = np.geomspace(40.0, 1_000.0, 15)
"""Where two laws are compared, as bands of a third of an octave are spaced."""
ANOTHER_FINGER: Final = "put back as it was set: the finger seems another"
LAW: Final = slice(0, 3)
"""The finger's part of `calibration.coordinates`: the cutoffs and the gain."""
DELAY: Final = 3
"""The rig's part."""
DELAY_WITHIN_S: Final = 0.5 * LAW_SIZES[LAW_CAUSES.index("delay")].tolerated
"""Half of what raises no alarm. A mount whose resonance shifts by a twentieth is felt as
another gain and cutoff, with some textures, and as a delay of 10 us or more, with all; where
the rig is right the delay is known within 1 us, and off by less."""


@dataclass(frozen=True, slots=True)
class Circumstances:
    """What the rig is doing, and of the finger what `concluded` fills in, as far as it matters.

    Attributes
    ----------
    source : str
        Of what plays: ``scene``, ``stream`` or ``excitation``.
    compensated : bool
        Whether the compensation mode is `model`.
    guided : bool
        Whether a participant is guided through a trial.
    since_change_s : float
        Since the model last became another.
    since_felt_s : float
        Since the newest window ended.
    adapted : bool
        Whether the model in force was adapted to a finger, and not put back since.
    returning : bool
        Whether the model in force was adapted to a contact that has ended.
    doubted : bool
        Whether the model in force was adapted to a finger that is another now, it seems
        (`Tracker.doubted`).
    watched : int
        Windows of this finger by which the watch could find the rig wrong.
    watched_before : int
        Likewise, of fingers before.
    suspected : collection of str
        What may be wrong with the rig: the evidence is not enough for an alarm.
    """

    source: str = "scene"
    compensated: bool = True
    guided: bool = False
    since_change_s: float = np.inf
    since_felt_s: float = 0.0
    adapted: bool = False
    returning: bool = False
    doubted: bool = False
    watched: int = WATCHED_WINDOWS
    watched_before: int = 0
    suspected: Collection[str] = ()


@dataclass(frozen=True, slots=True)
class Conclusion:
    """What follows from what was learned.

    Attributes
    ----------
    held_back : str
        Why the estimate is not put in force; empty: it is to be.
    model : Model or None
        To put in force: the estimate, or the model that was set; None: the one in force stays.
    reason : str
        For `model`, in words.
    """

    held_back: str
    model: Model | None = None
    reason: str = ""


def concluded(
    tracker: Tracker,
    model: Model,
    as_set: Model | None,
    population: Prior,
    now: Circumstances,
) -> Conclusion:
    """Conclude which model is to be in force.

    Parameters
    ----------
    tracker : Tracker
        Of the finger.
    model : Model
        In force.
    as_set : Model or None
        That was set, before it was adapted; None: not known.
    population : Prior
        Of a person of whom nothing is known.
    now : Circumstances
        What the rig is doing.
    """
    now = replace(
        now,
        returning=tracker.lifted and now.adapted and follows_a_contact(model),
        doubted=tracker.doubted and now.adapted and as_set is not None,
        watched=tracker.watched,
        watched_before=tracker.watched_before,
        suspected=tracker.suspected,
    )
    estimate, in_force, speeds_mm_s = tracker.expected, tracker.in_force, tracker.speeds_mm_s
    wrong = NOT_FITTED.intersection(alarm.cause for alarm in tracker.alarms)
    why = held_back(estimate, in_force, population, speeds_mm_s, wrong, now)
    if goes_back(now):
        return Conclusion(why, as_set, ANOTHER_FINGER)
    if why or in_force is None:
        return Conclusion(why)
    try:
        followed = adapted(model, estimate, tracker.provenance)
    except EstimateError as error:
        return Conclusion(str(error))
    off_db = difference_db(estimate.mean, in_force, speeds_mm_s)
    reason = f"{off_db:.2f} dB off, as {estimate.windows} windows say"
    if tracker.lifted:
        reason += "; the contact has ended"
    return Conclusion("", followed, reason)


def held_back(
    estimate: LawEstimate,
    in_force: FloatArray | None,
    prior: Prior,
    speeds_mm_s: tuple[float, float],
    wrong: Collection[str],
    now: Circumstances,
) -> str:
    """Return why the model in force stays; empty: the estimate is to be put in force.

    Between contacts the estimate is of the next one, whose gain is the person's, at best. Where
    ln gains of contacts differ by a standard deviation S, that of the last is off the next by
    S sqrt(2), and the mean of n contacts by S sqrt(1 + 1/n): so a model that was adapted to a
    contact goes back to the person's law, however well that is known.

    Parameters
    ----------
    estimate : LawEstimate
        The newest; of the next contact, where the last has ended (`Tracker.expected`).
    in_force : ndarray, shape (4,), or None
        In `calibration.coordinates`; None where the model is not a law without effects.
    prior : Prior
        Of the population.
    speeds_mm_s : tuple of float
        Slowest and fastest that were explored.
    wrong : collection of str
        Causes with an alarm that no finger is fitted to (`signatures.NOT_FITTED`).
    now : Circumstances
        What the rig is doing.
    """
    if not estimate.updates:
        return "nothing was felt yet: play a texture, and slide over it at 10 to 150 mm/s"
    if in_force is None:
        return "the model in force has effects, or another law than gain and cutoff"
    if like := SHAPED_BY_A_FINGER.intersection(wrong):
        return (
            f"no gain and cutoff have the shape of the response ({', '.join(sorted(like))}), "
            "and a mount that has shifted may look so too: check the mount, or run "
            "`frictus discover` on a recording"
        )
    if wrong:
        return (
            f"the rig seems wrong ({', '.join(sorted(wrong))}), which no finger is fitted to: "
            "mend it, and start it anew"
        )
    if now.suspected:
        return f"the rig may be wrong ({', '.join(sorted(now.suspected))}): more will tell"
    late_s = float(estimate.mean[DELAY] - in_force[DELAY])
    if abs(late_s) - estimate.half_width[DELAY] > DELAY_WITHIN_S:
        return (
            f"friction comes {later(late_s)} than the model says, of which "
            f"{1e6 * DELAY_WITHIN_S:.1f} is believed, and no finger does that: check the mount "
            "and the channels, or calibrate on this rig"
        )
    if now.since_felt_s > FRESH_S:
        return f"the finger was last felt {now.since_felt_s:.0f} s ago"
    loosest = loosest_half_width(estimate, speeds_mm_s)
    if loosest > KNOWN_WITHIN and not now.returning:
        return (
            f"gain and cutoff are known within {100.0 * loosest:.1f} % where the finger went; "
            f"{100.0 * KNOWN_WITHIN:.0f} % is asked"
        )
    enough = WATCHED_AGAIN if now.watched_before >= WATCHED_WINDOWS else WATCHED_WINDOWS
    if now.watched < enough:
        return f"{now.watched} windows were felt; a rig that is wrong shows itself in {enough}"
    sd = np.sqrt(np.diag(prior.covariance))
    away = np.abs(estimate.mean - prior.mean)[LAW] / sd[LAW]
    if away.max() > WITHIN_SD:
        name = ("cutoff at 20 mm/s", "cutoff at 100 mm/s", "gain")[int(away.argmax())]
        return (
            f"its {name} is {away.max():.1f} standard deviations from that of other people "
            f"({WITHIN_SD:g} is believed): calibrate this person, or check the rig"
        )
    gap = (estimate.mean - in_force)[LAW]
    distance = gap @ coordinates.inverse(estimate.covariance[LAW, LAW]) @ gap
    alike = distance < DIFFERENT and not now.returning
    if alike or difference_db(estimate.mean, in_force, speeds_mm_s) < LEAST_DB:
        return "the model in force fits as well"
    return _spoilt(now)


def goes_back(now: Circumstances) -> bool:
    """Return whether the model that was set takes the place of the one in force.

    It was set for whoever comes; one that was adapted to somebody else is further off, mostly,
    and what is known of the new finger is not enough for a while.

    Parameters
    ----------
    now : Circumstances
        What the rig is doing.
    """
    return now.doubted and not _spoilt(now)


def _spoilt(now: Circumstances) -> str:
    """Return what a change would spoil just now."""
    if now.source == "excitation":
        return "an excitation plays"
    if not now.compensated:
        return "another compensation mode than `model` was chosen"
    if now.guided:
        return "a participant is in a trial"
    if now.since_change_s < ADAPT_EVERY_S:
        return f"the model became another {now.since_change_s:.1f} s ago"
    return ""


def loosest_half_width(estimate: LawEstimate, speeds_mm_s: tuple[float, float]) -> float:
    """Return half of the widest 95 % interval of gain and cutoff, as a share of the value.

    Parameters
    ----------
    estimate : LawEstimate
        The newest.
    speeds_mm_s : tuple of float
        Slowest and fastest at which the cutoff counts.
    """
    speeds = np.clip(speeds_mm_s, coordinates.LOW_MM_S, coordinates.HIGH_MM_S)
    of_cutoffs = coordinates.cutoff_gradient(estimate.mean, speeds)
    directions = np.vstack([of_cutoffs, [0.0, 0.0, 1.0, 0.0]])
    variance = np.einsum("ni,ij,nj->n", directions, estimate.covariance, directions)
    return float(1.96 * np.sqrt(variance.max()))


def difference_db(
    one: FloatArray, other: FloatArray, speeds_mm_s: tuple[float, float]
) -> float:
    """Return how far renderings that undo two laws differ, dB rms over bands and speeds.

    Parameters
    ----------
    one, other : ndarray, shape (4,)
        In `calibration.coordinates`.
    speeds_mm_s : tuple of float
        Slowest and fastest at which they count.
    """
    low, high = np.clip(speeds_mm_s, coordinates.LOW_MM_S, coordinates.HIGH_MM_S)
    speeds = np.linspace(low, high, 5)
    size = [
        np.abs(coordinates.response(at, speeds[:, np.newaxis], FELT_HZ)) for at in (one, other)
    ]
    return float(np.sqrt(np.mean(np.square(20.0 * np.log10(size[0] / size[1])))))


def follows_a_contact(model: Model) -> bool:
    """Return whether a model was adapted to a contact, and not to the person.

    Parameters
    ----------
    model : Model
        That was adapted.
    """
    return bool(model.provenance.get(FITTED_TO) == CONTACT)


def adapted(model: Model, estimate: LawEstimate, told: dict[str, Any]) -> Model:
    """Return a model with gain and cutoff of the estimate; all else stays.

    Its delay, screen and validity are those of the model in force: they are not the finger's.

    Parameters
    ----------
    model : Model
        In force: a law without effects.
    estimate : LawEstimate
        The newest.
    told : dict
        What is said of it in its provenance.

    Raises
    ------
    EstimateError
        If there is no such model: its cutoff is not positive somewhere.
    """
    whole = coordinates.document(
        estimate.mean, estimate.covariance, model.participant, model.validity, {}
    )
    assert isinstance(whole.base, FirstOrderSpeedLaw)
    changed = {
        "base": whole.base,
        "covariance": whole.covariance,
        "placeholder": False,
        "provenance": model.provenance | {"source": "live"} | told,
    }
    try:
        return Model.model_validate(dict(model) | changed)
    except (FrictusError, ValueError) as error:
        raise EstimateError(f"the estimate makes no model: {error}") from error
