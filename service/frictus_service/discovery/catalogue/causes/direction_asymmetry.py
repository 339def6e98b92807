"""Direction asymmetry, in words."""

from frictus_service.discovery.catalogue.cause import Cause

CAUSE = Cause(
    id="direction_asymmetry",
    response="friction",
    statement="The same drive makes another friction to the right than to the left.",
    literature=(
        "The paper, Data processing: only strokes from left to right were analysed, so it could"
        " not show there. Nakazawa, Ikeura and Inooka, Biol. Cybern. 82, 2000: a fingertip's "
        "shear impedance depends on direction."
    ),
    confusable=(
        (
            "force_dependent_gain",
            "Hold the same measured normal force in both directions, or measure several forces"
            " in each direction.",
        ),
        (
            "speed_dependent_gain",
            "Hold the same measured speed in both directions, or measure several speeds in "
            "each direction.",
        ),
    ),
    next_experiment=(
        "Repeat with the finger turned by 180 degrees: what belongs to the finger changes sign,"
        " what belongs to the rig stays."
    ),
    visible_with="Strokes in both directions, each over the whole stroke.",
)
