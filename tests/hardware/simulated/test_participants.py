"""The population: medians of the paper, lognormal spread."""

import numpy as np
import pytest

from frictus_hardware.simulated.participants import SPREAD, Participant, draw_participant


def test_medians_and_spread(rng: np.random.Generator) -> None:
    drawn = [draw_participant(rng).model_dump() for _ in range(4_000)]
    for name, spread in SPREAD.items():
        logs = np.log([one[name] for one in drawn])
        error = spread / np.sqrt(len(drawn))
        middle = np.log(Participant().model_dump()[name])
        assert np.mean(logs) == pytest.approx(middle, abs=5.0 * error), name
        assert np.std(logs) == pytest.approx(spread, rel=0.07), name


def test_the_same_seed_draws_the_same_person() -> None:
    one, same, other = (draw_participant(np.random.default_rng(seed)) for seed in (3, 3, 4))
    assert one == same
    assert one != other


def test_a_participant_is_a_law_and_a_skin() -> None:
    person = Participant(gain_n=0.5, mass_kg=0.002)
    assert person.law.gain_n == 0.5
    assert person.mobility.mass_kg == 0.002
    with pytest.raises(ValueError, match="greater than 0"):
        Participant(gain_n=-1.0)
