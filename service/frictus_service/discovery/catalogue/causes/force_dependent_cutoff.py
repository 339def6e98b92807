"""Force dependent cutoff, in words."""

from frictus_service.discovery.catalogue.cause import Cause

CAUSE = Cause(
    id="force_dependent_cutoff",
    response="friction",
    statement=(
        "How fast friction follows the drive depends on how hard the finger presses: the "
        "cutoff changes with the normal force."
    ),
    literature=(
        "The paper, Results: looked for between 0.2 and 0.6 N and not found. Wiertlewski and "
        "Hayward, J. Biomech. 45, 2012: the fingertip stiffens when pressed."
    ),
    confusable=(
        (
            "cutoff_drift",
            "Randomise the order of the forces, and repeat the first block of trials at the "
            "end.",
        ),
        (
            "force_dependent_gain",
            "Add tones well below the cutoff (30 to 150 Hz): there the gain shows alone; "
            "above, only gain times cutoff.",
        ),
        (
            "speed_dependent_cutoff",
            "Cross speeds and forces: every force at every speed, so that who presses harder "
            "is not always faster.",
        ),
    ),
    next_experiment="Widen the range of forces to 0.1 to 1 N at one speed.",
    visible_with=(
        "Two forces that differ by a factor of two or more, with tones below and above the "
        "cutoff."
    ),
)
