"""Speed dependent stiffness, in words."""

from frictus_service.discovery.catalogue.cause import Cause

CAUSE = Cause(
    id="speed_dependent_stiffness",
    response="mobility",
    statement="The skin is stiffer when the finger slides faster.",
    literature="The paper, Results: 4.04 N/m per mm/s.",
    confusable=(
        (
            "speed_dependent_mass",
            "Use tones on both sides of the skin's resonance (30 to 60 Hz and 200 to 500 Hz): "
            "stiffness rules below it, mass above.",
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
        "Two speeds that differ by half or more, with tones below the skin's resonance (about "
        "90 Hz)."
    ),
)
