"""Charge leakage, in words."""

from frictus_service.discovery.catalogue.cause import Cause

CAUSE = Cause(
    id="charge_leakage",
    response="friction",
    statement=(
        "Charge leaks from the screen into the finger: slow changes of the drive die away."
    ),
    literature=(
        "The paper, Electrovibration; Shultz, Peshkin and Colgate, World Haptics 2015; Vezzoli "
        "et al., EuroHaptics 2014; AliAbbasi et al., IEEE Trans. Haptics, 2022."
    ),
    confusable=(
        (
            "fractional_rolloff",
            "Add tones of 5 to 20 Hz: leakage grows there with falling frequency, another "
            "roll-off vanishes.",
        ),
        (
            "speed_dependent_cutoff",
            "Add tones of 5 to 20 Hz at every speed: leakage shows there, a cutoff does not.",
        ),
    ),
    next_experiment=(
        "Drive a step that is held for seconds while the finger slides: its friction decays "
        "with the time constant."
    ),
    visible_with="Tones down to 30 Hz or lower; tones of 5 to 20 Hz show it best.",
)
