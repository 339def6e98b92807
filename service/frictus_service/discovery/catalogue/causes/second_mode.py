"""Second mode, in words."""

from frictus_service.discovery.catalogue.cause import Cause

CAUSE = Cause(
    id="second_mode",
    response="mobility",
    statement=(
        "The finger vibrates in a second way besides the first: a resonance of its own stands "
        "in the response."
    ),
    literature=(
        "Serhat and Kuchenbecker, Appl. Sci. 11, 2021: modes of the human fingertip. The paper,"
        " Discussion: only one was modelled."
    ),
    confusable=(),
    next_experiment=(
        "Use tones a twelfth of an octave apart around the mode, and measure the skin at a "
        "second place."
    ),
    visible_with=(
        "Tones closer than the width of the mode (a fifth of its frequency) around it."
    ),
)
