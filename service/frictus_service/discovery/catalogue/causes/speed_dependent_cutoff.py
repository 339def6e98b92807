"""Speed dependent cutoff, in words."""

from frictus_service.discovery.catalogue.cause import Cause

CAUSE = Cause(
    id="speed_dependent_cutoff",
    response="friction",
    statement=(
        "How fast friction follows the drive depends on how fast the finger slides: the cutoff "
        "changes with speed."
    ),
    literature="The paper, Results and Conclusions: 13.8 Hz per mm/s between 20 and 100 mm/s.",
    confusable=(
        (
            "cutoff_drift",
            "Randomise the order of the speeds, and repeat the first block of trials at the "
            "end: speed then no longer stands for time.",
        ),
        (
            "speed_dependent_gain",
            "Add tones well below the cutoff (30 to 150 Hz): there the gain shows alone; "
            "above, only gain times cutoff.",
        ),
    ),
    next_experiment=(
        "Measure at two more speeds between the extremes: a straight line, or a bend, shows."
    ),
    visible_with=(
        "Two speeds that differ by half or more, in random order, with tones below and above "
        "the cutoff."
    ),
)
