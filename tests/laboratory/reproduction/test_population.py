"""People are spread as asked, positive, and centred where asked."""

import numpy as np
import pytest

from frictus_laboratory.reproduction.population import POPULATION, draw_people

MANY = 4000


def test_free_draws_have_mean_and_spread_of_the_population(rng: np.random.Generator) -> None:
    people = draw_people(MANY, rng)
    for name, population in POPULATION.items():
        middle = np.array([person.planes[name].middle for person in people])
        slope = np.array([person.planes[name].per_mm_s for person in people])
        assert np.mean(middle) == pytest.approx(
            population.mean.middle, abs=5.0 * population.between / np.sqrt(MANY)
        )
        assert np.std(middle) == pytest.approx(population.between, rel=0.1)
        assert np.mean(slope) == pytest.approx(
            population.mean.per_mm_s, abs=5.0 * np.std(slope) / np.sqrt(MANY)
        )
        assert np.std(slope) > 0.0


def test_everything_is_positive_wherever_it_is_used(rng: np.random.Generator) -> None:
    for person in draw_people(300, rng):
        for plane in person.planes.values():
            values = [plane.at(v, f) for v in (20.0, 100.0) for f in (0.2, 0.6)]
            assert min(values) > 0.0
            assert plane.at(0.0) > 0.0


def test_centred_people_have_the_means_of_the_paper(rng: np.random.Generator) -> None:
    people = draw_people(10, rng, centred=True)
    for name, population in POPULATION.items():
        planes = [person.planes[name] for person in people]
        for part in ("middle", "per_mm_s", "per_n"):
            mean = np.mean([getattr(plane, part) for plane in planes])
            scale = population.mean.middle
            assert mean == pytest.approx(getattr(population.mean, part), abs=1e-9 * scale)
        assert np.std([plane.middle for plane in planes]) > 0.2 * population.between


def test_line_of_the_cutoff_is_the_equation_of_the_paper() -> None:
    cutoff = POPULATION["cutoff_hz"].mean
    assert cutoff.at(0.0) == pytest.approx(385.68)
    assert cutoff.at(100.0) == pytest.approx(385.68 + 1381.1)
    assert POPULATION["stiffness_n_m"].mean.at(40.0) == pytest.approx(444.0, rel=0.002)
