"""Amplitude compression, in words."""

from frictus_service.discovery.catalogue.cause import Cause

CAUSE = Cause(
    id="amplitude_compression",
    response="friction",
    statement=(
        "The drive is compressed: swings of the drive come out smaller or larger than the line "
        "from no to full drive, and a tone also makes friction at three times its frequency."
    ),
    literature=(
        "The paper, Experimental setup: an amplifier of gain 50, taken as linear. Shultz, "
        "Peshkin and Colgate, IEEE Trans. Haptics 11, 2018: the square root under which "
        "friction follows the drive, if nothing bends it before."
    ),
    confusable=(),
    next_experiment=(
        "Repeat at 75, 110 and 150 Vpp: compression grows with the amplitude, a gain does not. "
        "At one amplitude its part in the fundamental cannot be told from the gain."
    ),
    visible_with=(
        "Deep modulation, and tones whose third harmonic the mount and other tones leave free."
    ),
)
