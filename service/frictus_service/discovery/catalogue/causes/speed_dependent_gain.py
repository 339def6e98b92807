"""Speed dependent gain, in words."""

from frictus_service.discovery.catalogue.cause import Cause

CAUSE = Cause(
    id="speed_dependent_gain",
    response="friction",
    statement=(
        "The same drive makes another friction at another speed: the gain changes with sliding "
        "speed."
    ),
    literature=(
        "Pasumarty et al., Tribol. Lett. 44, 2011: a finger pad's friction depends on velocity."
        " Vardar and Kuchenbecker, J. R. Soc. Interface 18, 2021: electrovibration needs "
        "motion. The paper, Results: not found between 20 and 100 mm/s."
    ),
    confusable=(
        (
            "stick_slip",
            "Slide at 5 to 30 mm/s with and without drive: stick-slip stands in the "
            "low-frequency power of both, a gain in neither.",
        ),
        (
            "gain_drift",
            "Randomise the order of the speeds, and repeat the first block of trials at the "
            "end.",
        ),
    ),
    next_experiment="Add speeds outside the measured range, at a tone well below the cutoff.",
    visible_with=(
        "Two speeds that differ by half or more, in random order, with tones below the cutoff."
    ),
)
