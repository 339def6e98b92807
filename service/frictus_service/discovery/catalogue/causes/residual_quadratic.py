"""Residual quadratic, in words."""

from frictus_service.discovery.catalogue.cause import Cause

CAUSE = Cause(
    id="residual_quadratic",
    response="friction",
    statement=(
        "Part of the drive still acts squared: a tone also makes friction at twice its "
        "frequency."
    ),
    literature=(
        "The paper, Appendix A (voltage doubling); Kaczmarek et al., IEEE Trans. Biomed. Eng. "
        "53, 2006 (polarity and trapped charge)."
    ),
    confusable=(
        (
            "amplitude_compression",
            "Use tones whose second and third harmonics are both below 2 kHz, at full "
            "modulation: the square makes the second, compression the third.",
        ),
    ),
    next_experiment=(
        "Repeat at half the modulation depth: its share of the fundamental halves."
    ),
    visible_with=(
        "Deep modulation, and tones whose second harmonic the mount and other tones leave free."
    ),
)
