"""Force dependent gain, in words."""

from frictus_service.discovery.catalogue.cause import Cause

CAUSE = Cause(
    id="force_dependent_gain",
    response="friction",
    statement=(
        "The same drive makes another friction when the finger presses harder: the gain changes"
        " with the normal force."
    ),
    literature=(
        "Guo et al., IEEE Trans. Haptics, 2019: friction by electrovibration grows with normal "
        "force. The paper, Results: not found between 0.2 and 0.6 N."
    ),
    confusable=(
        (
            "gain_drift",
            "Randomise the order of the forces, and repeat the first block of trials at the "
            "end.",
        ),
        (
            "speed_dependent_gain",
            "Cross speeds and forces: every force at every speed, so that who presses harder "
            "is not always faster.",
        ),
    ),
    next_experiment="Widen the range of forces to 0.1 to 1 N at one speed and one low tone.",
    visible_with="Two forces that differ by a factor of two or more.",
)
