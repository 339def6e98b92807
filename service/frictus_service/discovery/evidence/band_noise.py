"""How well responses are known, and trials without what bands hold of hardly more than noise.

The line of a texture goes from band to band with the finger's speed: where it is not, a band
holds nothing but noise.
"""

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Any, Final, Literal

import numpy as np

from frictus_hardware.arrays import BoolArray, FloatArray
from frictus_service.discovery.evidence.bands import EDGE, WINDOW_S
from frictus_service.discovery.evidence.trial_evidence import TrialEvidence

RESOLVED: Final = 0.1
"""Error of a band's response, as a share, up to which it is used: of what is hardly more than
noise the logarithm is too large."""
LOBE: Final = 2.0
"""Half the main lobe of Hann's window, in frequencies of a spectrum."""
COLUMNS: Final = {
    "friction": ("friction_response", "friction_variance", "centroid_hz"),
    "mobility": ("mobility", "mobility_variance", "mobility_centroid_hz"),
}
"""Of a response, of its variance, and of the mean frequency of what it was seen at."""


def entries_of(columns: Any, kept: BoolArray) -> Any:
    """Return some entries of a dataclass of columns.

    Parameters
    ----------
    columns : dataclass
        Of arrays of one length.
    kept : ndarray of bool
        Which of their entries.
    """
    named = {field.name: getattr(columns, field.name)[kept] for field in fields(columns)}
    return replace(columns, **named)


def weight_of(message: FloatArray) -> FloatArray:
    """Return what rows weigh where they are averaged: the power that drives, 1 where none does.

    Parameters
    ----------
    message : ndarray, shape (n_rows,)
        Amplitude of the drive fraction; NaN without drive.
    """
    power = np.square(message)
    weight: FloatArray = np.where(np.isfinite(power) & (power > 0.0), power, 1.0)
    return weight


def reach_hz(centre_hz: FloatArray) -> FloatArray:
    """Return how far from a band what it has parts of may lie: its half, and Hann's main lobe.

    What lies farther away, such as what slow friction leaves in a spectrum, says nothing of it.

    Parameters
    ----------
    centre_hz : ndarray, shape (n,)
        Of each band.
    """
    reach: FloatArray = centre_hz * (EDGE - 1.0) + LOBE / WINDOW_S
    return reach


def resolved(
    evidence: Sequence[TrialEvidence], response: Literal["friction", "mobility"]
) -> list[TrialEvidence]:
    """Return trials whose noise is that of each person's band, without bands that are noise.

    Of a stretch alone noise is known to some ten per cent at best. Where something drives, it
    counts by how much: where there is nothing but noise, it is as large as what is taken for
    the response. Where nothing drives, that is told by the stretch alone. Bands of which all
    lies elsewhere are left out as well. What a tone says is kept, however noisy.

    Parameters
    ----------
    evidence : sequence of TrialEvidence
        Of one study; noise is that of the trials that may be used.
    response : {'friction', 'mobility'}
    """
    of, variance, at = COLUMNS[response]
    rows = [one.observed.rows for one in evidence]
    sizes = [each.tone_hz.size for each in rows]
    if not sum(sizes):
        return list(evidence)

    def column(name: str) -> Any:
        return np.concatenate([getattr(each, name) for each in rows])

    def repeated(values: Sequence[Any]) -> Any:
        return np.repeat(np.array(values), sizes)

    person = repeated([one.observed.info.participant for one in evidence])
    owner, tone = (np.unique(x, return_inverse=True)[1] for x in (person, column("tone_hz")))
    band = owner * (tone.max() + 1) + tone
    amplitude = np.abs(column("message"))
    square, weight = np.square(np.abs(column(of))), weight_of(amplitude)
    nothing = np.full(band.size, np.nan)
    share = np.divide(column(variance), square, out=nothing, where=square > 0.0)
    seen = (amplitude > 0.0) | (share < RESOLVED**2)
    told = np.isfinite(share) & seen & repeated([one.observed.valid for one in evidence])
    total, over = (
        np.bincount(band[told], values[told], minlength=band.max() + 1)
        for values in (share * np.square(weight), weight)
    )
    noise = np.divide(total, over, out=np.full(over.size, np.nan), where=over > 0.0)
    noise = noise[band] / weight
    centroid_hz = np.concatenate([getattr(one.harmonics, at) for one in evidence])
    kept = np.abs(centroid_hz - column("tone_hz")) <= reach_hz(column("tone_hz"))
    kept &= seen & (noise < RESOLVED**2)
    kept |= repeated([bool(one.observed.info.tones_hz) for one in evidence])
    kept |= ~np.isfinite(square)  # which says why a trial gives no response
    ends = np.cumsum(sizes)[:-1]
    parts = (np.split(values, ends) for values in (noise * square, kept))
    return [
        _with_noise(one, variance, *part) for one, *part in zip(evidence, *parts, strict=True)
    ]


def _with_noise(
    one: TrialEvidence, variance: str, noise: FloatArray, kept: BoolArray
) -> TrialEvidence:
    """Return a trial with the variance of its rows, and with those that are kept."""
    observed = one.observed
    columns: dict[str, Any] = {variance: noise}
    rows = entries_of(replace(observed.rows, **columns), kept)
    notes = observed.notes
    if kept.size and not kept.any():
        notes = (*notes, f"broadband: no band is known to {RESOLVED:.0%}, by its noise")
    observed = replace(observed, rows=rows, notes=notes)
    return replace(one, observed=observed, harmonics=entries_of(one.harmonics, kept))
