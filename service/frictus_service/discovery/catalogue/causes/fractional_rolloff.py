"""Fractional rolloff, in words."""

from frictus_service.discovery.catalogue.cause import Cause

CAUSE = Cause(
    id="fractional_rolloff",
    response="friction",
    statement=(
        "Above the cutoff friction falls at another rate than 20 dB per decade: the contact has"
        " many time constants instead of one."
    ),
    literature=(
        "Cole and Cole, J. Chem. Phys. 9, 1941: a spread of time constants makes a response of "
        "broken order; Yamamoto and Yamamoto, Med. Biol. Eng. 14, 1976: the horny layer of the "
        "skin has such an impedance."
    ),
    confusable=(
        (
            "speed_dependent_cutoff",
            "Add tones at a tenth and at ten times the cutoff at two speeds: there order and "
            "cutoff part.",
        ),
    ),
    next_experiment="Add tones of 1 to 5 kHz, with bursts on a dummy load to know the delay.",
    visible_with="Tones from below the cutoff to several times it, and a known delay.",
)
