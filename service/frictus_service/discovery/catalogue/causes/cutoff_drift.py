"""Cutoff drift, in words."""

from frictus_service.discovery.catalogue.cause import Cause

CAUSE = Cause(
    id="cutoff_drift",
    response="friction",
    statement=(
        "The cutoff changes in the course of a session: the skin under the finger grows moist "
        "and softens."
    ),
    literature=(
        "Adams et al., J. R. Soc. Interface 10, 2013, and Pasumarty et al., Tribol. Lett. 44, "
        "2011: moisture and occlusion change a finger pad within seconds to minutes."
    ),
    confusable=(
        (
            "gain_drift",
            "Repeat one low tone (30 to 100 Hz) through the session: there the gain shows "
            "alone.",
        ),
    ),
    next_experiment=(
        "Repeat one condition every few minutes, and once after a pause with the finger dried."
    ),
    visible_with=(
        "The same conditions early and late in the session, in random order, and the start time"
        " of every trial."
    ),
)
