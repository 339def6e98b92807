"""Causes in the rig, in words."""

from frictus_service.discovery.catalogue.cause import Cause

CAUSES = (
    Cause(
        id="amplitude_compression",
        response="friction",
        statement=(
            "The drive is compressed: swings of the drive come out smaller or larger than the "
            "line from no to full drive, and a tone also makes friction at three times its "
            "frequency."
        ),
        literature=(
            "The paper, Experimental setup: an amplifier of gain 50, taken as linear. Shultz, "
            "Peshkin and Colgate, IEEE Trans. Haptics 11, 2018: the square root under which "
            "friction follows the drive, if nothing bends it before."
        ),
        confusable=(),
        next_experiment=(
            "Repeat at 75, 110 and 150 Vpp: compression grows with the amplitude, a gain does "
            "not. At one amplitude its part in the fundamental cannot be told from the gain."
        ),
        visible_with=(
            "Deep modulation, and tones whose third harmonic the mount and other tones leave "
            "free."
        ),
    ),
    Cause(
        id="residual_quadratic",
        response="friction",
        statement=(
            "Part of the drive still acts squared: a tone also makes friction at twice its "
            "frequency."
        ),
        literature=(
            "The paper, Appendix A (voltage doubling); Kaczmarek et al., IEEE Trans. Biomed. "
            "Eng. 53, 2006 (polarity and trapped charge)."
        ),
        confusable=(
            (
                "amplitude_compression",
                "Use tones whose second and third harmonics are both below 2 kHz, at full "
                "modulation: the square makes the second, compression the third.",
            ),
        ),
        next_experiment=(
            "Repeat at half the modulation depth: its share of the fundamental halves."
        ),
        visible_with=(
            "Deep modulation, and tones whose second harmonic the mount and other tones leave "
            "free."
        ),
    ),
    Cause(
        id="charge_leakage",
        response="friction",
        statement=(
            "Charge leaks from the screen into the finger: slow changes of the drive die away."
        ),
        literature=(
            "The paper, Electrovibration; Shultz, Peshkin and Colgate, World Haptics 2015; "
            "Vezzoli et al., EuroHaptics 2014; AliAbbasi et al., IEEE Trans. Haptics, 2022."
        ),
        confusable=(
            (
                "fractional_rolloff",
                "Add tones of 5 to 20 Hz: leakage grows there with falling frequency, another "
                "roll-off vanishes.",
            ),
            (
                "speed_dependent_cutoff",
                "Add tones of 5 to 20 Hz at every speed: leakage shows there, a cutoff does "
                "not.",
            ),
        ),
        next_experiment=(
            "Drive a step that is held for seconds while the finger slides: its friction "
            "decays with the time constant."
        ),
        visible_with="Tones down to 30 Hz or lower; tones of 5 to 20 Hz show it best.",
    ),
    Cause(
        id="channel_delay",
        response="both",
        statement=(
            "A channel is later than it says: the response turns ever faster in phase with "
            "frequency and keeps its size."
        ),
        literature=(
            "Pintelon and Schoukens, System Identification: A Frequency Domain Approach, 2nd "
            "ed., 2012: a delay is fitted with the transfer function, or it biases it."
        ),
        confusable=(
            (
                "fractional_rolloff",
                "Send bursts, or drive a dummy load in place of the finger, and add tones of 2"
                " to 5 kHz: a delay keeps the size there, another roll-off does not.",
            ),
            (
                "mount_resonance_shift",
                "Strike the mount and read its resonances from the ring-down; add tones around"
                " them (1.4 to 2 kHz).",
            ),
            (
                "fractional_damping",
                "Add tones well above the skin's resonance (500 Hz to 1 kHz): a delay turns "
                "the phase there and keeps the size.",
            ),
        ),
        next_experiment=(
            "Send one edge to the drive and, by a wire, to the sensor's input: the delay is "
            "read from the samples."
        ),
        visible_with="Tones up to 1 kHz or more; the higher, the better.",
    ),
    Cause(
        id="mount_resonance_shift",
        response="both",
        statement=(
            "The mount rings at another frequency than the study says, so that too much or too"
            " little of it is removed."
        ),
        literature=(
            "The paper, Appendix B: two lateral resonances, the upper at 1714 Hz in the fit "
            "and 1740 Hz in the text."
        ),
        confusable=(
            (
                "fractional_rolloff",
                "Strike the mount and read its resonances from the ring-down; add tones around"
                " them (1.4 to 2 kHz).",
            ),
            (
                "second_mode",
                "Strike the mount and read its resonances from the ring-down: what is not the "
                "mount's belongs to the finger.",
            ),
        ),
        next_experiment="Strike the mount and read its resonances from the ring-down.",
        visible_with=(
            "Tones around the resonance (1.4 to 2 kHz); harmonics near it add to them."
        ),
    ),
    Cause(
        id="mains_interference",
        response="friction",
        statement=(
            "The mains couples into the force channel: a steady line at 50 or 60 Hz that has "
            "nothing to do with the finger."
        ),
        literature=(
            "Horowitz and Hill, The Art of Electronics, 3rd ed., 2015, on grounding, shielding"
            " and interference."
        ),
        confusable=(
            (
                "stick_slip",
                "Record without drive at two speeds and once without a finger: mains stays at "
                "its frequency, stick-slip moves with the speed and vanishes with the finger.",
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
    ),
)
