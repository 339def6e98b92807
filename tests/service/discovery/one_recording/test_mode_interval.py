"""What is said of a mode's frequency and quality where the recording hardly knows them."""

import numpy as np

from frictus_service.discovery.document import ParameterEstimate
from frictus_service.discovery.inference.mode_shape import ModeShape, mode_in, moved
from frictus_service.discovery.one_recording.analysis import _model
from frictus_service.discovery.one_recording.ranking import FittedModel, Ranking
from frictus_service.discovery.problem.candidates import candidates_of


def told(share: float, standard_errors: list[float]) -> dict[str, ParameterEstimate]:
    candidates = candidates_of("mobility")
    place = mode_in(candidates, range(len(candidates)))
    assert place is not None
    mode = moved(candidates[place], np.zeros(2))
    one = np.array([share])
    shape = ModeShape(np.zeros(2), np.array(standard_errors))
    fitted = FittedModel((0,), np.zeros(5), 0.0, 0.0, one, 0.1 * np.ones(1), one, shape)
    return _model(Ranking((mode,), (fitted,), 1, ()), fitted).parameters["second_mode"]


def test_what_is_not_known_lies_where_a_model_may_have_it() -> None:
    said = told(1e-6, [1e3, 1e3])
    assert np.allclose(said["frequency_hz"].ci95 or (), (50.0, 2000.0))
    assert np.allclose(said["quality"].ci95 or (), (0.5, 50.0))


def test_a_mode_of_no_share_has_no_interval_of_its_place() -> None:
    said = told(0.0, [0.0, 0.0])
    assert said["frequency_hz"].ci95 is None
    assert said["quality"].ci95 is None


def test_what_is_known_has_its_interval() -> None:
    low, high = told(0.2, [0.01, 0.05])["frequency_hz"].ci95 or (0.0, 0.0)
    assert 75.0 < low < 80.0 < high < 85.0
