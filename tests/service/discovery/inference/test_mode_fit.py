"""A further mode of the skin is found where it is, and not where modes are tested."""

import numpy as np
import pytest
from tests.service.discovery.made import skins_with_mode
from threadpoolctl import threadpool_limits

from frictus_service.discovery.inference.linearisation import linearise
from frictus_service.discovery.inference.mode_fit import (
    fit_mode,
    likeliest_beside,
    modes_of,
    shape_of,
    starts_of,
)


@pytest.mark.long
def test_a_mode_is_where_it_is_whatever_its_quality(rng: np.random.Generator) -> None:
    truth = rng.uniform(200.0, 450.0), np.exp(rng.uniform(np.log(2.0), np.log(8.0)))
    problem = skins_with_mode(rng, rng.uniform(0.4, 1.2), *truth)
    with threadpool_limits(limits=1):
        base = linearise(problem, (), patterns=())
        mode = modes_of(problem)[0]
        found = fit_mode(problem, base, starts_of(problem), mode)
        model = linearise(found, (mode,), (mode,), (), start=base)
        shape = shape_of(found, model, mode)
    held = dict(found.candidates[mode].held)
    off = np.log((held["frequency_hz"], held["quality"])) - np.log(truth)
    assert np.all(np.abs(off) < 2.0 * shape.half_widths)
    assert np.all(shape.half_widths < (0.05, 0.5))


@pytest.mark.parametrize("share", [pytest.param(0.4, marks=pytest.mark.long), 0.0])
def test_the_likelihood_shows_a_mode_where_there_is_one(
    share: float, rng: np.random.Generator
) -> None:
    """Mass, damping and stiffness take up one of 140 Hz, so that no test shows it."""
    problem = skins_with_mode(rng, share, 140.0, 6.0)
    with threadpool_limits(limits=1):
        base = linearise(problem, (), patterns=())
        found = likeliest_beside(problem, base, ())
    assert (found in modes_of(problem)) is (share > 0.0)
    assert (found is None) is (share == 0.0)
