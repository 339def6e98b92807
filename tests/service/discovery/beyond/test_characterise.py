"""Which of several forms describes what is left."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike
from tests.service.discovery.made import MOUNT, Design, facts, made

from frictus_service.discovery.beyond.characterise import (
    _Compared,
    _grammar_of,
    _named,
    _Screen,
)
from frictus_service.discovery.beyond.form_fit import Remainder
from frictus_service.discovery.beyond.grammar import Form, grammar
from frictus_service.discovery.discover import pose
from frictus_service.discovery.inference.linearisation import linearise
from frictus_service.discovery.problem.base_models import base_model

KNEE, SWITCH, RESONANCE, ECHO = (
    next(form for form in grammar() if form.id == id_)
    for id_ in ("cutoff_knee_above_speed", "cutoff_switch_by_speed", "extra_resonance", "echo")
)
TONES = tuple(np.round(np.geomspace(31.0, 1888.0, 12), 1).tolist())
MANY_TONES = Design(tones_hz=TONES, tones_per_trial=4, forces_n=(0.4,), repeats=1)
MANY_SPEEDS = Design(speeds_mm_s=(25.0, 40.0, 55.0, 75.0, 100.0), forces_n=(0.4,), repeats=1)


def test_a_form_that_everybody_shows_comes_before_one_that_a_few_show_much(
    rng: np.random.Generator,
) -> None:
    everybody = rng.uniform(10.0, 50.0, 8)
    few = np.zeros(8)
    few[rng.integers(8)] = 2.0 * everybody.sum()
    compared = _Compared({RESONANCE: few, KNEE: everybody}, everybody)
    assert few.sum() > everybody.sum()
    assert compared.alike() == (KNEE, RESONANCE)
    assert compared.gaining() == (KNEE,)
    assert compared.rivals(KNEE) == (
        RESONANCE,
    )  # that one person keeps it from being ruled out


def test_what_nobody_tells_from_the_best_is_named_once_a_family_the_surest_first(
    rng: np.random.Generator,
) -> None:
    gain = rng.uniform(10.0, 20.0, 8)
    alike = gain + np.array([1.0, -1.5] * 4)
    gains = {ECHO: alike - 0.1, KNEE: gain, RESONANCE: gain - rng.uniform(5.0, 9.0, 8)}
    compared = _Compared(gains, gain)
    assert compared.alike() == (KNEE, ECHO)
    assert compared.rivals(KNEE) == (ECHO,)
    assert compared.rivals(ECHO) == (KNEE,)


@pytest.mark.long
@pytest.mark.parametrize(
    ("true", "other", "values", "design"),
    [
        (ECHO, RESONANCE, {"share": 0.08, "delay_s": 0.0006}, MANY_TONES),
        (KNEE, SWITCH, {"exponent": -0.6, "threshold_mm_s": 65.0}, MANY_SPEEDS),
    ],
)
def test_of_forms_not_told_apart_the_one_is_named_that_leaves_least_beside_own_parameters(
    true: Form, other: Form, values: dict[str, float], design: Design, rng: np.random.Generator
) -> None:
    evidence = made(rng, [(true.id, values)], design)
    problem = pose(evidence, facts(evidence), MOUNT, base_model("paper", "friction")).problem
    assert problem is not None
    model = linearise(problem, ())
    remainder, screen = Remainder.of(problem, model), _Screen.of(problem, model)
    forms = [next(form for form in screen.forms if form == one) for one in (other, true)]
    named = _named(problem, model, remainder, screen, forms)
    assert named is not None
    assert named[0].form == true
    assert remainder.misfit(*named[1]) < 0.9 * remainder.misfit(problem, model)
    assert _named(problem, model, remainder, screen, ()) is None


def in_sessions(people: bool, *minutes: ArrayLike) -> Any:
    """A problem of which only the times of its trials are known."""
    subjects = [
        SimpleNamespace(
            trials=SimpleNamespace(circumstances=SimpleNamespace(minutes=np.array(each)))
        )
        for each in minutes
    ]
    return SimpleNamespace(subjects=subjects, people=people)


def steps_in(problem: Any) -> tuple[list[float], float]:
    """Return the times at which a step is looked for, and over how long it turns."""
    step = next(each for each in _grammar_of(problem) if each.id == "gain_switch_by_time")
    held = [dict(each) for each in step.grid]
    (over,) = {each["width_min"] for each in held}
    return [each["threshold_min"] for each in held], over


def test_a_step_is_looked_for_in_the_sessions_that_there_were() -> None:
    short = np.arange(30) * 0.2
    times_min, over = steps_in(in_sessions(True, short, short))
    assert over == pytest.approx(0.1)  # half of what lies between two trials
    assert 0.1 <= min(times_min) < 0.4
    assert 5.4 < max(times_min) < 5.8
    long = np.arange(600) * 0.2
    times_min, over = steps_in(in_sessions(True, long, long))
    assert 110.0 < max(times_min) < 119.8
    assert over == pytest.approx(0.4 * 119.8 / 39, rel=0.01)  # or none leads to the next


def test_blocks_of_one_persons_trials_share_the_times_of_its_session() -> None:
    session = np.arange(30) * 0.2
    blocks = [session[first::6] for first in range(6)]
    assert steps_in(in_sessions(False, *blocks)) == steps_in(in_sessions(True, session))


def test_trials_that_all_began_together_tell_no_times() -> None:
    assert _grammar_of(in_sessions(True, np.zeros(8), np.zeros(9))) == grammar()
