"""Mount resonance shift, in words."""

from frictus_service.discovery.catalogue.cause import Cause

CAUSE = Cause(
    id="mount_resonance_shift",
    response="both",
    statement=(
        "The mount rings at another frequency than the study says, so that too much or too "
        "little of it is removed."
    ),
    literature=(
        "The paper, Appendix B: two lateral resonances, the upper at 1714 Hz in the fit and "
        "1740 Hz in the text."
    ),
    confusable=(
        (
            "fractional_rolloff",
            "Strike the mount and read its resonances from the ring-down; add tones around "
            "them (1.4 to 2 kHz).",
        ),
        (
            "second_mode",
            "Strike the mount and read its resonances from the ring-down: what is not the "
            "mount's belongs to the finger.",
        ),
    ),
    next_experiment="Strike the mount and read its resonances from the ring-down.",
    visible_with="Tones around the resonance (1.4 to 2 kHz); harmonics near it add to them.",
)
