"""What size of residual each model leaves, and where, also where everything is explained."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_service.discovery.document import Discovery, ResidualBin
from frictus_service.discovery.report.residuals import by_relevance


@dataclass(frozen=True, slots=True)
class Remainder:
    """What is left at one tone.

    Attributes
    ----------
    tone_hz : float
        Of the drive.
    before_db, after_db, before_deg, after_deg : float
        RMS over the levels of the covariate: base and extended model.
    noise_db, noise_deg : float
        What chance alone would leave with the extended model: RMS of its standard errors.
    largest : str
        The level of the covariate at which most is left in size.
    beyond : bool
        Whether more is left than twice what chance leaves.
    """

    tone_hz: float
    before_db: float
    after_db: float
    noise_db: float
    before_deg: float
    after_deg: float
    noise_deg: float
    largest: str
    beyond: bool


CHANCE = 2.0
"""Times the standard error: more than this is pointed at."""


def remaining(found: Discovery) -> tuple[str, list[Remainder]] | None:
    """Return what is left at each tone, by the covariate that fans out most; None without any.

    Parameters
    ----------
    found : Discovery
        The document of a discovery.
    """
    names = by_relevance(found)
    if not names:
        return None
    own = [one for one in found.residuals if one.covariate == names[0]]
    tones_hz = sorted({one.tone_hz for one in own})
    return names[0], [_at([one for one in own if one.tone_hz == hz]) for hz in tones_hz]


def _at(bins: Sequence[ResidualBin]) -> Remainder:
    def rms(name: str) -> float:
        values: FloatArray = np.array([getattr(one, name) for one in bins])
        return float(np.sqrt(np.mean(np.square(values))))

    after_db, noise_db = rms("after_db"), rms("error_db")
    after_deg, noise_deg = rms("after_deg"), rms("error_deg")
    largest = max(bins, key=lambda one: abs(one.after_db))
    return Remainder(
        tone_hz=bins[0].tone_hz,
        before_db=rms("before_db"),
        after_db=after_db,
        noise_db=noise_db,
        before_deg=rms("before_deg"),
        after_deg=after_deg,
        noise_deg=noise_deg,
        largest=f"{largest.level:.4g} ({largest.after_db:+.2g} dB)",
        beyond=after_db > CHANCE * noise_db or after_deg > CHANCE * noise_deg,
    )
