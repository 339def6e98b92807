"""Where effects show: what is a function of frequency is told as one, whatever the tones."""

import numpy as np
import pytest
from tests.service.discovery.made import MOUNT, PAPER, Design, made

from frictus_service.discovery.decision.caveats import place_of
from frictus_service.discovery.evidence.evidence_rows import subjects_of
from frictus_service.discovery.evidence.observation_table import rows_of, units_of, used
from frictus_service.discovery.inference.linearisation import linearise
from frictus_service.discovery.problem.candidates import candidates_of, patterns_of
from frictus_service.discovery.problem.problem import DiscoveryProblem

CANDIDATES = tuple(candidates_of("friction"))
PLACES = {
    "channel_delay": "none",
    "charge_leakage": "none",
    "fractional_rolloff": "none",
    "mount_resonance_shift": "none",
    "cutoff_drift": "minutes",
    "gain_drift": "minutes",
    "direction_asymmetry": "direction",
    "position_dependent_gain": "position",
    "force_dependent_cutoff": "force",
    "force_dependent_gain": "force",
    "speed_dependent_cutoff": "speed",
    "speed_dependent_gain": "speed",
}


@pytest.mark.long
@pytest.mark.parametrize(
    "tones_hz", [(31.0, 217.0, 907.0, 1888.0), (30.0, 160.0, 450.0, 1170.0, 1620.0, 2000.0)]
)
def test_an_effect_shows_in_what_it_depends_on(
    tones_hz: tuple[float, ...], rng: np.random.Generator
) -> None:
    trials = used(made(rng, design=Design(tones_hz=tones_hz)))
    rows = rows_of(trials, units_of(trials, "friction"), "friction")
    patterns = tuple(patterns_of(len(tones_hz), skin=False))
    subjects = tuple(subjects_of(rows, 8))
    units = linearise(
        DiscoveryProblem(PAPER, MOUNT, "friction", subjects, CANDIDATES, patterns), ()
    ).units
    found = {
        each.effect: place_of(units, place, patterns)
        for place, each in enumerate(CANDIDATES)
        if each.effect in PLACES
    }
    assert found == {name: ("response", covariate) for name, covariate in PLACES.items()}
