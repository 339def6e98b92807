"""What the paper reports: its estimates, its verdicts, its likelihoods.

Balasubramanian, Pool and Vardar, Sections 3.1 and 3.2.
"""

from dataclasses import dataclass
from typing import Final

PARTICIPANTS: Final = 10
CONDITIONS: Final = 25
SPEEDS_MM_S: Final = (20.0, 40.0, 60.0, 80.0, 100.0)
FORCES_N: Final = (0.2, 0.3, 0.4, 0.5, 0.6)

CUTOFF_0_HZ: Final = 385.68
CUTOFF_SLOPE_HZ_PER_MM_S: Final = 13.811
GAIN_N_PER_V: Final = 0.0123
GAIN_N: Final = 0.39
"""Of a drive fraction of 1: K times 15.9 V of one upper sideband over its half drive."""
MASS_SLOPE_KG_PER_MM_S: Final = 3.5e-5
"""Section 3.2; abstract and discussion say 3.23e-5."""
MASS_SLOPE_ELSEWHERE_KG_PER_MM_S: Final = 3.23e-5
MASS_RISE_PER_MM_S: Final = 0.0082
"""The slope over the mass at the lowest speed."""
STIFFNESS_SLOPE_N_M_PER_MM_S: Final = 4.036
STIFFNESS_RISE_PER_MM_S: Final = 0.0111
DAMPING_N_S_M: Final = 1.3
CUTOFF_STIFFNESS_CORRELATION: Final = 0.34
CUTOFF_STIFFNESS_P: Final = 2.8e-8
"""Spearman's, over all participants and conditions."""

MASS_20_KG: Final = MASS_SLOPE_KG_PER_MM_S / MASS_RISE_PER_MM_S
STIFFNESS_20_N_M: Final = STIFFNESS_SLOPE_N_M_PER_MM_S / STIFFNESS_RISE_PER_MM_S
"""At the lowest speed. 20 mm/s further it is 444 N/m, the paper's example."""


@dataclass(frozen=True, slots=True)
class Likelihoods:
    """-2 log-likelihood without and with a random intercept of the participant."""

    reduced: float
    full: float


LIKELIHOODS: Final = {
    "gain": Likelihoods(-1594.327, -1631.082),
    "cutoff": Likelihoods(3732.094, 3698.635),
    "mass": Likelihoods(-2267.563, -2352.209),
    "damping": Likelihoods(592.744, 550.981),
    "stiffness": Likelihoods(3301.393, 3241.765),
}
"""Gain in N/V, cutoff in Hz, mass in kg, damping in N s/m, stiffness in N/m."""

P_VALUES: Final = {
    ("gain", "speed"): 0.399,
    ("gain", "force"): 0.578,
    ("gain", "interaction"): 0.346,
    ("cutoff", "speed"): 0.001,
    ("cutoff", "force"): 0.291,
    ("cutoff", "interaction"): 0.399,
    ("mass", "speed"): 0.008,
    ("mass", "force"): 0.724,
    ("mass", "interaction"): 0.271,
    ("damping", "speed"): 0.093,
    ("damping", "force"): 0.071,
    ("damping", "interaction"): 0.207,
    ("stiffness", "speed"): 0.001,
    ("stiffness", "force"): 0.285,
    ("stiffness", "interaction"): 0.053,
}
"""Of the mixed models; 0.001 where the paper says less than that."""
