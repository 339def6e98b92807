"""Speed dependent mass, in words."""

from frictus_service.discovery.catalogue.cause import Cause

CAUSE = Cause(
    id="speed_dependent_mass",
    response="mobility",
    statement="More of the skin moves along when the finger slides faster.",
    literature=(
        "The paper, Results (3.5e-5 kg per mm/s) and Conclusions (3.23e-5 kg per mm/s)."
    ),
    confusable=(
        (
            "fractional_damping",
            "Use tones from 100 Hz to 1 kHz at two speeds: mass changes with the speed, the "
            "order of the damping does not.",
        ),
    ),
    next_experiment=(
        "Measure at two more speeds between the extremes, with tones of 200 to 750 Hz."
    ),
    visible_with=(
        "Two speeds that differ by half or more, with tones above the skin's resonance (200 to "
        "750 Hz)."
    ),
)
