"""Which of several forms describes what is left."""

import numpy as np

from frictus_service.discovery.beyond.characterise import _Compared
from frictus_service.discovery.beyond.grammar import grammar

KNEE, RESONANCE, ECHO = (
    next(form for form in grammar() if form.id == id_)
    for id_ in ("cutoff_knee_above_speed", "extra_resonance", "echo")
)


def test_a_form_that_everybody_shows_comes_before_one_that_a_few_show_much(
    rng: np.random.Generator,
) -> None:
    everybody = rng.uniform(10.0, 50.0, 8)
    few = np.zeros(8)
    few[rng.integers(8)] = 2.0 * everybody.sum()
    compared = _Compared({RESONANCE: few, KNEE: everybody}, everybody)
    assert few.sum() > everybody.sum()
    assert compared.best is KNEE
    assert compared.rivals() == (RESONANCE,)  # that one person keeps it from being ruled out


def test_what_nobody_tells_from_the_best_is_named_once_a_family_the_surest_first(
    rng: np.random.Generator,
) -> None:
    gain = rng.uniform(10.0, 20.0, 8)
    alike = gain + np.array([1.0, -1.5] * 4)
    gains = {ECHO: alike - 0.1, KNEE: gain, RESONANCE: gain - rng.uniform(5.0, 9.0, 8)}
    compared = _Compared(gains, gain)
    assert compared.best is KNEE
    assert compared.rivals() == (ECHO,)
