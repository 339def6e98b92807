"""All that slides without a drive show, and in sentences what they do not."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from frictus_service.data_import.friction.coefficient import (
    FrictionCoefficient,
    friction_coefficient,
)
from frictus_service.data_import.friction.slides import Slide
from frictus_service.data_import.friction.stick_slip import (
    LEAST_RATE_HZ,
    StickSlipStatistics,
    stick_slip,
)
from frictus_service.data_import.friction.texture import (
    ForceSpectrum,
    TextureLine,
    force_spectra,
    texture_line,
)
from frictus_service.data_import.motion import LOOK_AT, STROKES
from frictus_service.errors import StudyError


@dataclass(frozen=True, slots=True)
class FrictionReport:
    """Of a recording or a study.

    Attributes
    ----------
    slides, driven : int
        Found, and of these left out because a voltage drove them.
    coefficient : FrictionCoefficient or None
        Against speed and load.
    texture : TextureLine or None
        Lines of the spectrum.
    stick_slip : StickSlipStatistics or None
        Whether friction sticks and slips.
    spectra : tuple of ForceSpectrum
        Of the tangential force, else of the normal force, by speed.
    notes : tuple of str
        Why something is None, and what the intervals hold for.
    """

    slides: int
    driven: int
    coefficient: FrictionCoefficient | None
    texture: TextureLine | None
    stick_slip: StickSlipStatistics | None
    spectra: tuple[ForceSpectrum, ...]
    notes: tuple[str, ...]

    def fields(self) -> dict[str, Any]:
        """Return all of it as plain values, for JSON."""
        return asdict(self)


def report_friction(slides: Sequence[Slide]) -> FrictionReport:
    """Return what slides show of friction.

    Parameters
    ----------
    slides : sequence of Slide
        Of one finger on one surface.

    Raises
    ------
    StudyError
        If there is none without a drive.
    """
    if not slides:
        raise StudyError(f"no slide is found; accepted: {STROKES}; look at {LOOK_AT}")
    blank = [each for each in slides if not each.driven]
    if not blank:
        raise StudyError(
            f"all of {len(slides)} slides are driven by a voltage, which changes the friction; "
            "accepted: at least three slides without a drive"
        )
    coefficient, of_coefficient = friction_coefficient(blank)
    texture, slips = texture_line(blank), stick_slip(blank)
    notes = [
        "intervals take slides as independent, of this finger, surface and sensor alone",
        *of_coefficient,
    ]
    if texture is None:
        notes.append("no spectrum: slides are shorter than 64 samples")
    if slips is None:
        notes.append(
            "nothing on stick-slip: it takes three slides of tangential force at "
            f"{LEAST_RATE_HZ:g} Hz at least"
        )
    return FrictionReport(
        slides=len(slides),
        driven=len(slides) - len(blank),
        coefficient=coefficient,
        texture=texture,
        stick_slip=slips,
        spectra=force_spectra(blank),
        notes=tuple(notes),
    )
