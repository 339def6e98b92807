"""Stick slip, in words."""

from frictus_service.discovery.catalogue.cause import Cause

CAUSE = Cause(
    id="stick_slip",
    response="friction",
    statement=(
        "The finger sticks and slips: friction carries a saw-tooth of a fixed length in space, "
        "strongest when slow."
    ),
    literature=(
        "Derler and Rotaru, Wear 301, 2013: stick-slip of human skin. The paper, Procedure: "
        "strokes go sideways, where the finger rolls, to make it less likely."
    ),
    confusable=(),
    next_experiment="Slide at 5 to 30 mm/s without drive.",
    visible_with="Slow strokes (20 mm/s or less), at best without drive.",
)
