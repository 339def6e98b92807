"""A smooth discrepancy is an effect that every model can carry."""

import numpy as np

from frictus_hardware.physics.effects import extended
from frictus_hardware.physics.forms import BANDS_HZ
from frictus_hardware.physics.simulator import Simulator
from frictus_service.discovery.beyond.beyond import COVARIATES, SmoothDiscrepancy


def test_weights_beyond_their_range_still_make_an_effect() -> None:
    weights = np.array([-1.4, 5.0, *np.zeros(len(BANDS_HZ) - 2)])
    none = np.zeros((weights.size, weights.size))
    for covariate in COVARIATES:
        found = SmoothDiscrepancy(covariate, weights, none, 8, np.zeros(8))
        assert len(extended(Simulator(), [(found.effect, found.values)]).paths) == 1
