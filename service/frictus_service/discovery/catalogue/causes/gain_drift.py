"""Gain drift, in words."""

from frictus_service.discovery.catalogue.cause import Cause

CAUSE = Cause(
    id="gain_drift",
    response="friction",
    statement=(
        "The same drive makes another friction as the session goes on: sweat and occlusion "
        "change the contact."
    ),
    literature=(
        "Pasumarty et al., Tribol. Lett. 44, 2011, and Adams et al., J. R. Soc. Interface 10, "
        "2013: friction of an occluded finger pad rises with time."
    ),
    confusable=(),
    next_experiment=(
        "Repeat one condition every few minutes, and once after a pause with the finger dried."
    ),
    visible_with=(
        "The same conditions early and late in the session, in random order, and the start time"
        " of every trial."
    ),
)
