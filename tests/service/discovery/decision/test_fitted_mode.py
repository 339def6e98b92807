"""A mode of the skin that lies off the grid is named alone, where it is."""

import numpy as np
import pytest
from tests.service.discovery.made import skins_with_mode
from threadpoolctl import threadpool_limits

from frictus_service.discovery.decision.decision import decide
from frictus_service.discovery.inference.significance import signs


@pytest.mark.timeout(300)  # half a minute of arithmetic where nothing else runs
@pytest.mark.long
@pytest.mark.parametrize(
    ("share", "frequency_hz", "quality"),
    [(1.0, 300.0, 2.0), (0.4, 150.0, 6.0), (0.6, 140.0, 6.0)],
)
def test_a_mode_brings_no_other_cause(
    share: float, frequency_hz: float, quality: float, rng: np.random.Generator
) -> None:
    """The broad one was named at 450 Hz; those near the first do not show about the base."""
    problem = skins_with_mode(rng, share, frequency_hz, quality)
    with threadpool_limits(limits=1):
        found = decide(problem, signs(6, np.random.default_rng(0)))
    (named,) = found.named
    assert named.verdict == "confirmed"
    assert not found.unexplained
    mode = dict(found.problem.candidates[named.candidate].held)
    assert mode["frequency_hz"] == pytest.approx(frequency_hz, rel=0.02)
    assert mode["quality"] == pytest.approx(quality, rel=0.1)


@pytest.mark.timeout(300)
@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("channel_delay", {"delay_s": 2e-5}),
        ("speed_dependent_stiffness", {"exponent": 0.25}),
    ],
)
def test_a_mode_does_not_make_up_for_another_cause(
    name: str, values: dict[str, float], rng: np.random.Generator
) -> None:
    """Fitted alone it did, and the scatter about it hid the delay of 20 microseconds."""
    problem = skins_with_mode(rng, 0.6, 330.0, 3.0, [(name, values)], (20.0, 60.0, 100.0))
    with threadpool_limits(limits=1):
        found = decide(problem, signs(6, np.random.default_rng(0)))
    named = {found.problem.candidates[each.candidate].effect: each for each in found.named}
    assert set(named) == {"second_mode", name}
    (size,) = values.values()
    assert named[name].coefficients.mean() == pytest.approx(size, rel=0.05)
    mode = dict(found.problem.candidates[named["second_mode"].candidate].held)
    assert mode["frequency_hz"] == pytest.approx(330.0, rel=0.01)
