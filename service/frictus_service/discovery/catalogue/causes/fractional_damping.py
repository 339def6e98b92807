"""Fractional damping, in words."""

from frictus_service.discovery.catalogue.cause import Cause

CAUSE = Cause(
    id="fractional_damping",
    response="mobility",
    statement=(
        "The skin loses energy neither as a dashpot nor as a spring: its damping changes with "
        "frequency."
    ),
    literature=(
        "Fung, Biomechanics: Mechanical Properties of Living Tissues, 2nd ed., 1993: the loss "
        "of soft tissue hardly changes with frequency."
    ),
    confusable=(
        (
            "second_mode",
            "Use tones a twelfth of an octave apart: a mode is narrow, damping is not.",
        ),
    ),
    next_experiment=(
        "Add tones so that they reach from 20 Hz to 1 kHz evenly in the logarithm."
    ),
    visible_with="Tones on both sides of the skin's resonance, three or more on each.",
)
