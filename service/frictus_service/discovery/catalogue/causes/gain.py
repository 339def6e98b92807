"""Causes in the gain, in words; equations stand in `frictus_hardware.physics.effects.gain`."""

from frictus_service.discovery.catalogue.cause import Cause

CAUSES = (
    Cause(
        id="speed_dependent_gain",
        response="friction",
        statement=(
            "The same drive makes another friction at another speed: the gain changes with "
            "sliding speed."
        ),
        literature=(
            "Pasumarty et al., Tribol. Lett. 44, 2011: a finger pad's friction depends on "
            "velocity. Vardar and Kuchenbecker, J. R. Soc. Interface 18, 2021: "
            "electrovibration needs motion. The paper, Results: not found between 20 and 100 "
            "mm/s."
        ),
        confusable=(
            (
                "stick_slip",
                "Slide at 5 to 30 mm/s with and without drive: stick-slip stands in the low-"
                "frequency power of both, a gain in neither.",
            ),
            (
                "gain_drift",
                "Randomise the order of the speeds, and repeat the first block of trials at "
                "the end.",
            ),
        ),
        next_experiment=(
            "Add speeds outside the measured range, at a tone well below the cutoff."
        ),
        visible_with=(
            "Two speeds that differ by half or more, in random order, with tones below the "
            "cutoff."
        ),
    ),
    Cause(
        id="force_dependent_gain",
        response="friction",
        statement=(
            "The same drive makes another friction when the finger presses harder: the gain "
            "changes with the normal force."
        ),
        literature=(
            "Guo et al., IEEE Trans. Haptics, 2019: friction by electrovibration grows with "
            "normal force. The paper, Results: not found between 0.2 and 0.6 N."
        ),
        confusable=(
            (
                "gain_drift",
                "Randomise the order of the forces, and repeat the first block of trials at "
                "the end.",
            ),
            (
                "speed_dependent_gain",
                "Cross speeds and forces: every force at every speed, so that who presses "
                "harder is not always faster.",
            ),
        ),
        next_experiment=(
            "Widen the range of forces to 0.1 to 1 N at one speed and one low tone."
        ),
        visible_with="Two forces that differ by a factor of two or more.",
    ),
    Cause(
        id="position_dependent_gain",
        response="friction",
        statement=(
            "The same drive makes another friction elsewhere on the screen: the coating, or "
            "the finger's angle, changes along the stroke."
        ),
        literature=(
            "The paper, Discussion: participants could not hold their contact angle, and Data "
            "processing: only 0.2 s in the middle of a stroke was analysed, so it could not "
            "show there."
        ),
        confusable=(
            (
                "force_dependent_gain",
                "Hold the same measured normal force along the stroke, or measure several "
                "forces at each place.",
            ),
            (
                "speed_dependent_gain",
                "Use long strokes at constant speed: at short ones the ends are always slower "
                "than the middle.",
            ),
        ),
        next_experiment=(
            "Turn the screen by 180 degrees and repeat: what belongs to the coating turns with"
            " it."
        ),
        visible_with="Strokes over 30 mm or more, at steady speed, in both directions.",
    ),
    Cause(
        id="direction_asymmetry",
        response="friction",
        statement="The same drive makes another friction to the right than to the left.",
        literature=(
            "The paper, Data processing: only strokes from left to right were analysed, so it "
            "could not show there. Nakazawa, Ikeura and Inooka, Biol. Cybern. 82, 2000: a "
            "fingertip's shear impedance depends on direction."
        ),
        confusable=(
            (
                "force_dependent_gain",
                "Hold the same measured normal force in both directions, or measure several "
                "forces in each direction.",
            ),
            (
                "speed_dependent_gain",
                "Hold the same measured speed in both directions, or measure several speeds in"
                " each direction.",
            ),
        ),
        next_experiment=(
            "Repeat with the finger turned by 180 degrees: what belongs to the finger changes "
            "sign, what belongs to the rig stays."
        ),
        visible_with="Strokes in both directions, each over the whole stroke.",
    ),
    Cause(
        id="gain_drift",
        response="friction",
        statement=(
            "The same drive makes another friction as the session goes on: sweat and occlusion"
            " change the contact."
        ),
        literature=(
            "Pasumarty et al., Tribol. Lett. 44, 2011, and Adams et al., J. R. Soc. Interface "
            "10, 2013: friction of an occluded finger pad rises with time."
        ),
        confusable=(),
        next_experiment=(
            "Repeat one condition every few minutes, and once after a pause with the finger "
            "dried."
        ),
        visible_with=(
            "The same conditions early and late in the session, in random order, and the start"
            " time of every trial."
        ),
    ),
)
