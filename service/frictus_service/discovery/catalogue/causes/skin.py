"""Causes in the moving skin, in words."""

from frictus_service.discovery.catalogue.cause import Cause

CAUSES = (
    Cause(
        id="speed_dependent_mass",
        response="mobility",
        statement="More of the skin moves along when the finger slides faster.",
        literature=(
            "The paper, Results (3.5e-5 kg per mm/s) and Conclusions (3.23e-5 kg per mm/s)."
        ),
        confusable=(
            (
                "fractional_damping",
                "Use tones from 100 Hz to 1 kHz at two speeds: mass changes with the speed, "
                "the order of the damping does not.",
            ),
        ),
        next_experiment=(
            "Measure at two more speeds between the extremes, with tones of 200 to 750 Hz."
        ),
        visible_with=(
            "Two speeds that differ by half or more, with tones above the skin's resonance "
            "(200 to 750 Hz)."
        ),
    ),
    Cause(
        id="speed_dependent_stiffness",
        response="mobility",
        statement="The skin is stiffer when the finger slides faster.",
        literature="The paper, Results: 4.04 N/m per mm/s.",
        confusable=(
            (
                "speed_dependent_mass",
                "Use tones on both sides of the skin's resonance (30 to 60 Hz and 200 to 500 "
                "Hz): stiffness rules below it, mass above.",
            ),
            (
                "second_mode",
                "Use tones a twelfth of an octave apart below the resonance at two speeds.",
            ),
        ),
        next_experiment=(
            "Measure at two more speeds between the extremes, with tones of 30 to 80 Hz."
        ),
        visible_with=(
            "Two speeds that differ by half or more, with tones below the skin's resonance "
            "(about 90 Hz)."
        ),
    ),
    Cause(
        id="fractional_damping",
        response="mobility",
        statement=(
            "The skin loses energy neither as a dashpot nor as a spring: its damping changes "
            "with frequency."
        ),
        literature=(
            "Fung, Biomechanics: Mechanical Properties of Living Tissues, 2nd ed., 1993: the "
            "loss of soft tissue hardly changes with frequency."
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
    ),
    Cause(
        id="second_mode",
        response="mobility",
        statement=(
            "The finger vibrates in a second way besides the first: a resonance of its own "
            "stands in the response."
        ),
        literature=(
            "Serhat and Kuchenbecker, Appl. Sci. 11, 2021: modes of the human fingertip. The "
            "paper, Discussion: only one was modelled."
        ),
        confusable=(),
        next_experiment=(
            "Use tones a twelfth of an octave apart around the mode, and measure the skin at a"
            " second place."
        ),
        visible_with=(
            "Tones closer than the width of the mode (a fifth of its frequency) around it."
        ),
    ),
    Cause(
        id="stick_slip",
        response="friction",
        statement=(
            "The finger sticks and slips: friction carries a saw-tooth of a fixed length in "
            "space, strongest when slow."
        ),
        literature=(
            "Derler and Rotaru, Wear 301, 2013: stick-slip of human skin. The paper, "
            "Procedure: strokes go sideways, where the finger rolls, to make it less likely."
        ),
        confusable=(),
        next_experiment="Slide at 5 to 30 mm/s without drive.",
        visible_with="Slow strokes (20 mm/s or less), at best without drive.",
    ),
)
