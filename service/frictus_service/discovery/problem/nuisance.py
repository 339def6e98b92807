"""What every finger has of its own, no error of a model: gain and cutoff, or its skin."""

from dataclasses import replace
from typing import Final, Literal

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.mobility import Mobility
from frictus_hardware.physics.simulator import Simulator

ResponseName = Literal["friction", "mobility"]

NUISANCE: Final[dict[ResponseName, tuple[str, ...]]] = {
    "friction": ("gain_n", "cutoff_hz", "quiet_n2"),
    "mobility": ("mass_kg", "damping_n_s_m", "stiffness_n_m"),
}
"""What everybody has of their own, as a multiple of the base model's."""

QUIET: Final = 2
"""Which of a friction response's is the power from 4 to 30 Hz that is there anyway."""

RANDOM_EFFECTS: Final = frozenset(
    {
        "speed_dependent_gain",
        "speed_dependent_cutoff",
        "force_dependent_gain",
        "force_dependent_cutoff",
        "speed_dependent_mass",
        "speed_dependent_stiffness",
    }
)
"""Effects in which people differ by chance, whether or not they have some of them in common:
nobody's gain and cutoff follow speed and force quite as others' do."""

DEVIATING: Final[dict[ResponseName, int]] = {"friction": 2, "mobility": 3}
"""How many of these, from the first, deviate from condition to condition."""


def _own_friction(base: Simulator, own: FloatArray) -> Simulator:
    gain, cutoff = np.exp(own[:QUIET])
    law = replace(
        base.law,
        gain_n=base.law.gain_n * gain,
        cutoff_0_hz=base.law.cutoff_0_hz * cutoff,
        slope_hz_per_mm_s=base.law.slope_hz_per_mm_s * cutoff,
    )
    return replace(base, law=law)


def _own_skin(base: Simulator, own: FloatArray) -> Simulator:
    mass, damping, stiffness = np.exp(own)
    skin = base.mobility
    return replace(
        base,
        mobility=Mobility(
            skin.mass_kg * mass, skin.damping_n_s_m * damping, skin.stiffness_n_m * stiffness
        ),
    )


NUISANCE_SCALED: Final = {"friction": _own_friction, "mobility": _own_skin}
