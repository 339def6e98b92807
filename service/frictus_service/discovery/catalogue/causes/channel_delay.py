"""Channel delay, in words."""

from frictus_service.discovery.catalogue.cause import Cause

CAUSE = Cause(
    id="channel_delay",
    response="both",
    statement=(
        "A channel is later than it says: the response turns ever faster in phase with "
        "frequency and keeps its size."
    ),
    literature=(
        "Pintelon and Schoukens, System Identification: A Frequency Domain Approach, 2nd ed., "
        "2012: a delay is fitted with the transfer function, or it biases it."
    ),
    confusable=(
        (
            "fractional_rolloff",
            "Send bursts, or drive a dummy load in place of the finger, and add tones of 2 to "
            "5 kHz: a delay keeps the size there, another roll-off does not.",
        ),
        (
            "mount_resonance_shift",
            "Strike the mount and read its resonances from the ring-down; add tones around "
            "them (1.4 to 2 kHz).",
        ),
        (
            "fractional_damping",
            "Add tones well above the skin's resonance (500 Hz to 1 kHz): a delay turns the "
            "phase there and keeps the size.",
        ),
    ),
    next_experiment=(
        "Send one edge to the drive and, by a wire, to the sensor's input: the delay is read "
        "from the samples."
    ),
    visible_with="Tones up to 1 kHz or more; the higher, the better.",
)
