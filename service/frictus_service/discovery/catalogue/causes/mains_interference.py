"""Mains interference, in words."""

from frictus_service.discovery.catalogue.cause import Cause

CAUSE = Cause(
    id="mains_interference",
    response="friction",
    statement=(
        "The mains couples into the force channel: a steady line at 50 or 60 Hz that has "
        "nothing to do with the finger."
    ),
    literature=(
        "Horowitz and Hill, The Art of Electronics, 3rd ed., 2015, on grounding, shielding and "
        "interference."
    ),
    confusable=(
        (
            "stick_slip",
            "Record without drive at two speeds and once without a finger: mains stays at its "
            "frequency, stick-slip moves with the speed and vanishes with the finger.",
        ),
    ),
    next_experiment=(
        "Record some seconds without drive and without a finger; then with the amplifier "
        "switched off."
    ),
    visible_with=(
        "Trials of 1 s or more; tones 8 Hz or more away from 50 and 60 Hz; trials without "
        "drive."
    ),
)
