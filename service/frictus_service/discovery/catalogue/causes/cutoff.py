"""Causes in the cutoff and the roll-off, in words."""

from frictus_service.discovery.catalogue.cause import Cause

CAUSES = (
    Cause(
        id="speed_dependent_cutoff",
        response="friction",
        statement=(
            "How fast friction follows the drive depends on how fast the finger slides: the "
            "cutoff changes with speed."
        ),
        literature=(
            "The paper, Results and Conclusions: 13.8 Hz per mm/s between 20 and 100 mm/s."
        ),
        confusable=(
            (
                "cutoff_drift",
                "Randomise the order of the speeds, and repeat the first block of trials at "
                "the end: speed then no longer stands for time.",
            ),
            (
                "speed_dependent_gain",
                "Add tones well below the cutoff (30 to 150 Hz): there the gain shows alone; "
                "above, only gain times cutoff.",
            ),
        ),
        next_experiment=(
            "Measure at two more speeds between the extremes: a straight line, or a bend, "
            "shows."
        ),
        visible_with=(
            "Two speeds that differ by half or more, in random order, with tones below and "
            "above the cutoff."
        ),
    ),
    Cause(
        id="force_dependent_cutoff",
        response="friction",
        statement=(
            "How fast friction follows the drive depends on how hard the finger presses: the "
            "cutoff changes with the normal force."
        ),
        literature=(
            "The paper, Results: looked for between 0.2 and 0.6 N and not found. Wiertlewski "
            "and Hayward, J. Biomech. 45, 2012: the fingertip stiffens when pressed."
        ),
        confusable=(
            (
                "cutoff_drift",
                "Randomise the order of the forces, and repeat the first block of trials at "
                "the end.",
            ),
            (
                "force_dependent_gain",
                "Add tones well below the cutoff (30 to 150 Hz): there the gain shows alone; "
                "above, only gain times cutoff.",
            ),
            (
                "speed_dependent_cutoff",
                "Cross speeds and forces: every force at every speed, so that who presses "
                "harder is not always faster.",
            ),
        ),
        next_experiment="Widen the range of forces to 0.1 to 1 N at one speed.",
        visible_with=(
            "Two forces that differ by a factor of two or more, with tones below and above the"
            " cutoff."
        ),
    ),
    Cause(
        id="cutoff_drift",
        response="friction",
        statement=(
            "The cutoff changes in the course of a session: the skin under the finger grows "
            "moist and softens."
        ),
        literature=(
            "Adams et al., J. R. Soc. Interface 10, 2013, and Pasumarty et al., Tribol. Lett. "
            "44, 2011: moisture and occlusion change a finger pad within seconds to minutes."
        ),
        confusable=(
            (
                "gain_drift",
                "Repeat one low tone (30 to 100 Hz) through the session: there the gain shows "
                "alone.",
            ),
        ),
        next_experiment=(
            "Repeat one condition every few minutes, and once after a pause with the finger "
            "dried."
        ),
        visible_with=(
            "The same conditions early and late in the session, in random order, and the start"
            " time of every trial."
        ),
    ),
    Cause(
        id="fractional_rolloff",
        response="friction",
        statement=(
            "Above the cutoff friction falls at another rate than 20 dB per decade: the "
            "contact has many time constants instead of one."
        ),
        literature=(
            "Cole and Cole, J. Chem. Phys. 9, 1941: a spread of time constants makes a "
            "response of broken order; Yamamoto and Yamamoto, Med. Biol. Eng. 14, 1976: the "
            "horny layer of the skin has such an impedance."
        ),
        confusable=(
            (
                "speed_dependent_cutoff",
                "Add tones at a tenth and at ten times the cutoff at two speeds: there order "
                "and cutoff part.",
            ),
        ),
        next_experiment=(
            "Add tones of 1 to 5 kHz, with bursts on a dummy load to know the delay."
        ),
        visible_with="Tones from below the cutoff to several times it, and a known delay.",
    ),
)
