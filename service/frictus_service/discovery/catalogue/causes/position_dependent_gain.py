"""Position dependent gain, in words."""

from frictus_service.discovery.catalogue.cause import Cause

CAUSE = Cause(
    id="position_dependent_gain",
    response="friction",
    statement=(
        "The same drive makes another friction elsewhere on the screen: the coating, or the "
        "finger's angle, changes along the stroke."
    ),
    literature=(
        "The paper, Discussion: participants could not hold their contact angle, and Data "
        "processing: only 0.2 s in the middle of a stroke was analysed, so it could not show "
        "there."
    ),
    confusable=(
        (
            "force_dependent_gain",
            "Hold the same measured normal force along the stroke, or measure several forces "
            "at each place.",
        ),
        (
            "speed_dependent_gain",
            "Use long strokes at constant speed: at short ones the ends are always slower than"
            " the middle.",
        ),
    ),
    next_experiment=(
        "Turn the screen by 180 degrees and repeat: what belongs to the coating turns with it."
    ),
    visible_with="Strokes over 30 mm or more, at steady speed, in both directions.",
)
